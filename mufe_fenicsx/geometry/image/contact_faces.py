"""Faces between labelled grains: their area, how wide a neck they are, and whether they touch."""

import numpy as np


def faces(labels):
    """Faces of voxels between two grains.

    Args:
        labels: 0 void, grains from 1, (z, y, x).

    Returns:
        A list, one entry an axis, of (pair, low, high): pair = a · (n + 1) + b with a < b ≤ n the
        two labels, and the flat indices of the voxels below and above the face.
    """
    base, found = int(labels.max(initial=0)) + 1, []
    index = np.int32 if labels.size < 2**31 else np.int64
    flat = labels.ravel()
    for axis in range(3):
        cut = [slice(None)] * 3
        cut[axis] = slice(None, -1)
        meet = np.zeros(labels.shape, dtype=bool)
        here, there = labels[tuple(cut)], np.moveaxis(np.moveaxis(labels, axis, 0)[1:], 0, axis)
        meet[tuple(cut)] = (here != there) & (here > 0) & (there > 0)
        low = np.flatnonzero(meet).astype(index)
        high = low + index(np.prod(labels.shape[axis + 1 :], dtype=np.int64))
        a, b = flat[low].astype(np.int64), flat[high].astype(np.int64)
        found.append((np.minimum(a, b) * base + np.maximum(a, b), low, high))
    return found


def contact_table(labels, voxel_size):
    """One dictionary a pair of labels that share faces: label_a, label_b, area_m2, neck_ratio.

    A flat face with normal n shows A |n_i| faces of voxels along axis i, so its area is the root
    of the sum of their squares. The neck ratio is that area over the section of the smaller
    grain, the circle of its equivalent diameter: two halves of a ball have one.
    """
    base = int(labels.max(initial=0)) + 1
    voxels = np.bincount(labels.ravel(), minlength=base)
    square = {}
    for pair, _, _ in faces(labels):
        for key, count in zip(*np.unique(pair, return_counts=True), strict=True):
            square[int(key)] = square.get(int(key), 0.0) + float(count) ** 2
    rows = []
    for key in sorted(square):
        a, b = divmod(key, base)
        area = np.sqrt(square[key])
        section = np.pi / 4 * np.cbrt(6 / np.pi * min(voxels[a], voxels[b])) ** 2
        rows.append(
            {
                "label_a": a,
                "label_b": b,
                "area_m2": float(area * voxel_size**2),
                "neck_ratio": float(area / section),
            }
        )
    return rows


def open_gaps(labels, grey, void, solid, level):
    """Part the grains between which the image nowhere gets as bright as grains that touch.

    Blur closes a gap narrower than the point-spread function at any threshold, but the grey level
    in it stays below that of the grains. Where the brightest face between two grains is
    darker than ``level``, the darker voxel of each of their faces becomes void, in place.

    Args:
        labels: 0 void, grains from 1, (z, y, x); changed in place.
        grey: Grey level on the same voxels, smoothed over about a voxel of the image.
        void, solid: Grey levels of the phases.
        level: From 0, as the void, to 1, as the solid.

    Returns:
        Number of pairs that were parted, and the flat indices of the voxels that became void.
    """
    flat, grey = labels.ravel(), grey.ravel()
    found = faces(labels)
    pair = np.concatenate([key for key, _, _ in found])
    low = np.concatenate([low for _, low, _ in found])
    high = np.concatenate([high for _, _, high in found])
    if len(pair) == 0:
        return 0, low
    bridge = (np.minimum(grey[low], grey[high]) - void) / (solid - void)
    pairs, number = np.unique(pair, return_inverse=True)
    brightest = np.full(len(pairs), -np.inf)
    np.maximum.at(brightest, number, bridge)
    parted = brightest[number] < level
    darker = np.where(grey[low] < grey[high], low, high)[parted]
    darker = np.unique(darker)
    flat[darker] = 0
    return int((brightest < level).sum()), darker
