"""Grains and necks that look as if the segmentation cut too much or too little."""

import numpy as np
import scipy.ndimage
import scipy.spatial

from .labels import grains_in

#: Distance of the logarithm of a size from the median, over the deviation of a normal
#: distribution with the same median deviation, beyond which a grain is an outlier.
OUTLIER = 3.5
#: A neck wider than this part of the smaller grain's section may cut one grain in two.
WIDE_NECK = 0.6
#: A grain that fills less than this part of its convex hull may be two: two balls whose neck is
#: half as wide as they are fill 0.86 of it.
CONCAVE = 0.9
#: Standard deviation of the filter before grains are held against their hulls [voxels].
SMOOTHING = 1.0


def mark_doubts(rows, contacts, labels):
    """Add columns ``solidity`` and ``doubt`` to a table of grains, and ``doubt`` to contacts.

    A doubt is "small", "large" (outliers of size among grains that the border does not cut),
    "concave" (perhaps several grains), "wide neck" (perhaps one grain), or none.

    Args:
        rows: Of `label_files.grain_table`; changed.
        contacts: Of `contact_faces.contact_table`; changed.
        labels: (z, y, x).

    Returns:
        Numbers by kind: small_grains, large_grains, concave_grains, wide_necks.
    """
    full = solidity(labels)
    size = {row["label"]: np.log(row["voxels"]) / 3 for row in rows}
    whole = [size[row["label"]] for row in rows if not row["touches_border"]]
    middle, spread = 0.0, np.inf
    if len(whole) >= 10:
        middle = np.median(whole)
        spread = max(1.4826 * np.median(np.abs(np.array(whole) - middle)), 1e-3)
    counts = dict.fromkeys(("small_grains", "large_grains", "concave_grains", "wide_necks"), 0)
    for row in rows:
        away = (size[row["label"]] - middle) / spread
        doubts = []
        if away < -OUTLIER and not row["touches_border"]:
            doubts.append("small")
        if away > OUTLIER:
            doubts.append("large")
        if full[row["label"]] < CONCAVE:
            doubts.append("concave")
        for doubt in doubts:
            counts[f"{doubt}_grains"] += 1
        row["solidity"], row["doubt"] = full[row["label"]], " ".join(doubts)
    for row in contacts:
        row["doubt"] = "wide neck" if row["neck_ratio"] > WIDE_NECK else ""
        counts["wide_necks"] += bool(row["doubt"])
    return counts


def solidity(labels):
    """Voxels of each grain over those in its convex hull: a dictionary by label.

    Both are counted after a filter that keeps the number of voxels, so that roughness of a voxel
    does not count. A convex body has no voxel more in its hull, whatever its size; a Gaussian keeps
    it convex (A. Prékopa, Acta Sci. Math. 34, 1973, 335-343).
    """
    result = {}
    for grain, where in grains_in(labels):
        mask = _smoothed(labels[where] == grain)
        # Ends of rows along x hold all corners of the hull.
        z, y = np.nonzero(mask.any(axis=2))
        first = mask.argmax(axis=2)[z, y]
        last = mask.shape[2] - 1 - mask[:, :, ::-1].argmax(axis=2)[z, y]
        points = np.concatenate([np.column_stack([z, y, x]) for x in (first, last)])
        try:
            hull = scipy.spatial.ConvexHull(points)
            result[grain] = np.count_nonzero(mask) / _voxels_within(hull.equations, mask.shape)
        except scipy.spatial.QhullError:
            result[grain] = 1.0  # flat: all middles in one plane
    return result


def _smoothed(mask):
    """As many voxels, or more where levels are equal, where a filtered mask is highest."""
    mask = np.pad(mask, 3).astype(np.float32)
    number = np.count_nonzero(mask)
    level = scipy.ndimage.gaussian_filter(mask, SMOOTHING, truncate=3.0, mode="constant")
    return level >= np.partition(level, -number, axis=None)[-number]


def _voxels_within(planes, shape):
    """Number of middles of voxels within planes a·x + b <= 0, rows (a, b), (z, y, x)."""
    ahead, behind = planes[:, 2] > 1e-9, planes[:, 2] < -1e-9
    along, y, number = ~ahead & ~behind, np.arange(shape[1])[:, None], 0
    for z in range(shape[0]):
        room = 1e-9 - (planes[:, 0] * z + planes[:, 1] * y + planes[:, 3])  # of a_x x
        last = np.floor((room[:, ahead] / planes[ahead, 2]).min(axis=1))
        first = np.ceil((room[:, behind] / planes[behind, 2]).max(axis=1))
        inside = (room[:, along] >= 0).all(axis=1) & (last >= first)
        number += int((last - first + 1)[inside].sum())
    return number
