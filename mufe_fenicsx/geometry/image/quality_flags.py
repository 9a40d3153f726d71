"""Grains and necks that look as if the segmentation cut too much or too little."""

import numpy as np
import scipy.spatial

from .labels import grains_in

#: Distance of the logarithm of a size from the median, over the deviation of a normal
#: distribution with the same median deviation, beyond which a grain is an outlier.
OUTLIER = 3.5
#: A neck wider than this part of the smaller grain's section may cut one grain in two.
WIDE_NECK = 0.6
#: A grain that fills less than this part of its convex hull may be two.
CONCAVE = 0.85


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
    """Volume of each grain over that of its convex hull: a dictionary by label.

    The hull is that of the middles of voxels, half a voxel wider on all sides.
    """
    result = {}
    for grain, where in grains_in(labels):
        mask = labels[where] == grain
        # Ends of rows along x hold all corners of the hull.
        z, y = np.nonzero(mask.any(axis=2))
        first = mask.argmax(axis=2)[z, y]
        last = mask.shape[2] - 1 - mask[:, :, ::-1].argmax(axis=2)[z, y]
        points = np.concatenate([np.column_stack([z, y, x]) for x in (first, last)])
        volume = np.count_nonzero(mask)
        try:
            hull = scipy.spatial.ConvexHull(points)
            result[grain] = float(volume / (hull.volume + 0.5 * hull.area))
        except scipy.spatial.QhullError:
            result[grain] = 1.0  # flat: all middles in one plane
    return result
