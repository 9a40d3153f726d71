"""Is a heap of grains a sample? How many diameters it is high, and which grains bridge walls."""

import numpy as np

#: Walls that face each other, by the axis between them.
OPPOSITE = (("x_min", "x_max"), ("y_min", "y_max"), ("z_min", "z_max"))
#: Median diameters that a sample is high at least; below the second, walls order all of it.
LEAST_HEIGHT, ORDERED = 2.0, 5.0
#: A grain bridges a box where it is this part of its length long.
REACHES = 0.95
#: So many grains are named.
NAMED = 5
#: With fewer grains nothing is said of a sample.
FEW = 8


def median_diameter(volumes):
    """Diameter that half of the volume is finer than, of balls of these volumes [m]."""
    volume = np.sort(np.asarray(volumes, dtype=float))
    middle = np.searchsorted(np.cumsum(volume), 0.5 * volume.sum())
    return float(np.cbrt(6 * volume[min(middle, volume.size - 1)] / np.pi))


def bridges(labels, low, high, box):
    """Labels of grains that reach from one side of a box to the other, by axis: a dict of lists.

    Args:
        labels: Of the grains, shape (num_grains,).
        low, high: Corners of the box around each [m], shape (num_grains, 3).
        box: Corners of that around all [m], shape (2, 3).
    """
    long = (high - low) >= REACHES * (box[1] - box[0])
    axes = zip("xyz", long.T, strict=True)
    return {axis: np.asarray(labels)[of].tolist() for axis, of in axes if of.any()}


def words_of_height(diameters):
    """What a height of so many median diameters means, in words."""
    if diameters < LEAST_HEIGHT:
        return "less than two: no sample of a packing"
    if diameters < ORDERED:
        return f"below {ORDERED:g} its walls order all of it"
    return f"{ORDERED:g} or more"


def warnings_of_proportions(grains):
    """Lines about a heap of grains that is no sample; none of fewer than FEW.

    Args:
        grains: :class:`~mufe_fenicsx.geometry.grains.Grains`.
    """
    labels, starts = grains.labels, grains.node_offset[:-1]
    if len(labels) < FEW:
        return []
    low, high = (least.reduceat(grains.points, starts) for least in (np.minimum, np.maximum))
    box = np.array([low.min(axis=0), high.max(axis=0)])
    diameters = float(np.ptp(box, axis=0)[2] / median_diameter(grains.volumes))
    lines = [
        f"{'grain' if len(own) == 1 else 'grains'} {', '.join(map(str, own[:NAMED]))}"
        f"{f' and {len(own) - NAMED} more' if len(own) > NAMED else ''} "
        f"{'reaches' if len(own) == 1 else 'reach'} from {axis}_min to {axis}_max: the walls press "
        f"{'it' if len(own) == 1 else 'them'}, not a packing; cut a larger sample"
        for axis, own in bridges(labels, low, high, box).items()
    ]
    if diameters < ORDERED:
        lines.append(
            f"the sample is {diameters:.1f} median diameters high; {words_of_height(diameters)}"
        )
    return lines
