"""A plane band in which strain gathers: where it is, how thick, and whether there is one."""

from dataclasses import dataclass

import numpy as np

#: Directions that are tried over the half sphere: neighbours are 4° apart.
NUM_DIRECTIONS = 1200
#: Steps of the place and the width of a band over the grains' diameter.
STEP = 0.25
#: A band is at least so many diameters thick, and at most this part of the sample.
THINNEST, THICKEST = 1.0, 0.5
#: Strain gathers in a band if that explains more than this share of the variance, and has at least
#: so many times the mean strain beside it.
ENOUGH, TWICE = 0.5, 2.0
#: Fewer grains say nothing about a band.
FEWEST = 60


@dataclass(frozen=True)
class Band:
    """The slab between two planes that sets strains apart best."""

    normal: np.ndarray  #: unit vector, upwards, shape (3,)
    middle: np.ndarray  #: a place in its middle plane [m], shape (3,)
    width: float  #: distance of its two planes [m]
    share: float  #: of the variance of the strain that two means, in it and beside it, explain [-]
    strain: tuple  #: mean in it, and beside it [-]
    members: np.ndarray  #: grains in it, shape (num_grains,)

    @property
    def contrast(self):
        """Mean strain in it over that beside it [-]."""
        return self.strain[0] / self.strain[1] if self.strain[1] > 0 else np.inf

    @property
    def inclination(self):
        """Angle between the band and the horizontal [degrees]."""
        return float(np.degrees(np.arccos(np.clip(abs(self.normal[2]), 0, 1))))


def spread(strain, weight):
    """Standard deviation of a strain over its mean [-].

    Args:
        strain: Shape (num_grains,).
        weight: Volumes of the grains' cells [m³], shape (num_grains,).
    """
    mean = weight @ strain / weight.sum()
    return float(np.sqrt(weight @ (strain - mean) ** 2 / weight.sum()) / mean)


def find_band(centre, strain, weight, diameter):
    """The slab that explains most of the variance of the strain of grains.

    Of a slab with the mean m₁ in it, m₂ beside it and shares w₁, w₂ of the volume the variance
    between the two is w₁ w₂ (m₁ - m₂)² (Otsu 1979 parts grey values so). Normals are tried over the
    half sphere, places and widths in steps of a quarter of a diameter.

    Args:
        centre: Of the grains [m], shape (num_grains, 3).
        strain: Deviatoric strains [-], shape (num_grains,).
        weight: Volumes of their cells [m³], shape (num_grains,).
        diameter: Mean one of the grains [m].

    Returns:
        :class:`Band`; None where strain is the same everywhere, or the sample has no room for one.
    """
    weight = weight / weight.sum()
    middle = weight @ centre
    away, deviation = centre - middle, strain - weight @ strain
    total = weight @ deviation**2
    if not total > (1e-9 * np.abs(strain).max(initial=0.0)) ** 2:
        return None
    best = 0.0, None, None, None  # variance between, normal, and the two planes
    for normal in _directions():
        found = _best_slab(away @ normal, weight, deviation, diameter)
        if found[0] > best[0]:
            best = found[0], normal, *found[1:]
    between, normal, low, high = best
    if normal is None:
        return None
    along = away @ normal
    members = (along >= low) & (along <= high)
    means = [weight[m] @ strain[m] / weight[m].sum() for m in (members, ~members)]
    return Band(
        normal=normal,
        middle=middle + 0.5 * (low + high) * normal,
        width=high - low,
        share=float(between / total),
        strain=tuple(map(float, means)),
        members=members,
    )


def _best_slab(along, weight, deviation, diameter):
    """(variance between, lower plane, upper plane) of the best slab across one direction.

    Args:
        along: Places of the grains [m], shape (num_grains,).
        weight: Their sum is 1.
        deviation: Strains less their mean.
        diameter: [m].
    """
    low, length = along.min(), np.ptp(along)
    step = STEP * diameter
    num = int(np.ceil(length / step)) or 1
    bins = np.minimum(((along - low) / step).astype(int), num - 1)
    w = np.append(0.0, np.cumsum(np.bincount(bins, weight, num)))
    d = np.append(0.0, np.cumsum(np.bincount(bins, weight * deviation, num)))
    start, end = np.triu_indices(num + 1, round(THINNEST / STEP))
    room = (end - start) * step <= THICKEST * length
    start, end = start[room], end[room]
    inside, excess = w[end] - w[start], d[end] - d[start]
    part = inside * (1.0 - inside)
    between = np.divide(
        excess**2, part, out=np.zeros_like(excess), where=(part > 1e-9) & (excess > 0)
    )
    if not between.size:
        return 0.0, low, low
    best = int(np.argmax(between))
    return between[best], low + step * start[best], low + step * end[best]


def _directions():
    """Unit vectors spread evenly over the upper half sphere (Fibonacci), and the axes."""
    k = np.arange(NUM_DIRECTIONS) + 0.5
    height, angle = k / NUM_DIRECTIONS, np.pi * (1 + np.sqrt(5)) * k
    flat = np.sqrt(1 - height**2)
    return np.vstack(
        [np.eye(3), np.column_stack([flat * np.cos(angle), flat * np.sin(angle), height])]
    )
