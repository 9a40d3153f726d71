"""Triangles of one surface that cut through each other."""

import numpy as np
from scipy.spatial import cKDTree


def crossing_triangles(points, triangles, tolerance=1e-7):
    """Pairs of triangles without a common vertex of which an edge of one goes through the other.

    Edges that only touch, within the tolerance, do not count.

    Args:
        points: Shape (n, 3).
        triangles: Shape (m, 3).
        tolerance: Times the extent of the surface.

    Returns:
        Pairs of triangles, shape (k, 2).
    """
    x = points[triangles]
    low, high = x.min(axis=1), x.max(axis=1)
    pairs = _close_pairs((low + high) / 2, np.linalg.norm(high - low, axis=1) / 2)
    first, second = pairs.T
    overlap = np.all((low[first] <= high[second]) & (low[second] <= high[first]), axis=1)
    pairs = pairs[overlap]
    common = (triangles[pairs[:, 0], :, None] == triangles[pairs[:, 1], None, :]).any(axis=(1, 2))
    pairs = pairs[~common]
    eps = tolerance * np.ptp(points, axis=0).max()
    through = np.zeros(len(pairs), dtype=bool)
    for one, other in ((0, 1), (1, 0)):
        a, b, c = np.moveaxis(x[pairs[:, other]], 1, 0)
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        for i in range(3):
            start, end = x[pairs[:, one], i], x[pairs[:, one], (i + 1) % 3]
            above = ((start - a) * normal).sum(axis=1)
            below = ((end - a) * normal).sum(axis=1)
            apart = (above > eps) & (below < -eps) | (above < -eps) & (below > eps)
            at = start + (end - start) * (above / np.where(apart, above - below, 1))[:, None]
            inside = apart
            for p, q in ((a, b), (b, c), (c, a)):
                inside = inside & ((np.cross(q - p, at - p) * normal).sum(axis=1) > 0)
            through |= inside
    return pairs[through]


def _close_pairs(centres, radii):
    """Pairs of balls that may overlap, i < j; the few large ones are asked for separately."""
    large = radii > 2 * np.median(radii)
    tree, found = cKDTree(centres), []
    small = np.flatnonzero(~large)
    if len(small):
        pairs = cKDTree(centres[small]).query_pairs(2 * radii[small].max(), output_type="ndarray")
        found.append(small[pairs])
    for i in np.flatnonzero(large):
        near = np.array(tree.query_ball_point(centres[i], radii[i] + radii.max()))
        near = near[~large[near] | (near > i)]
        near = near[np.linalg.norm(centres[near] - centres[i], axis=1) <= radii[i] + radii[near]]
        found.append(np.column_stack([np.full(len(near), i), near]))
    return np.concatenate(found) if found else np.zeros((0, 2), dtype=np.int64)
