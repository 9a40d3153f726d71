"""Closed surfaces that bound bodies: which lie inside others, and so are cavities of these."""

import numpy as np

from ..measure import surface_volume
from ..pieces import piece_of_cell


def shells(points, triangles):
    """The connected parts of closed surfaces, and how many others each lies in.

    Args:
        points: Shape (n, 3).
        triangles: Shape (m, 3); no two parts cross.

    Returns:
        Part of each triangle, shape (m,); depth of each part, shape (num_parts,): a part of odd
        depth is a cavity; and the part right around each, -1 where there is none.
    """
    part = piece_of_cell(triangles)
    num_parts = 1 + part.max(initial=-1)
    if num_parts == 1:
        return part, np.zeros(1, dtype=int), np.full(1, -1)
    of_part = [triangles[part == p] for p in range(num_parts)]
    low = np.array([points[t].min(axis=(0, 1)) for t in of_part])
    high = np.array([points[t].max(axis=(0, 1)) for t in of_part])
    volume = np.array([abs(surface_volume(points, t)) for t in of_part])
    depth, around = np.zeros(num_parts, dtype=int), np.full(num_parts, -1)
    for p in range(num_parts):
        for q in np.flatnonzero((low < low[p]).all(axis=1) & (high > high[p]).all(axis=1)):
            if is_inside(points[of_part[p][0, 0]], points, of_part[q]):
                depth[p] += 1
                if around[p] < 0 or volume[q] < volume[around[p]]:
                    around[p] = q
    return part, depth, around


def is_inside(x, points, triangles):
    """Whether a point lies in a closed surface: its solid angle from there is not zero.

    Source: A. van Oosterom, J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125-126.
    """
    a, b, c = np.moveaxis(points[triangles] - x, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    triple = np.einsum("ij,ij->i", a, np.cross(b, c))
    flat = (
        la * lb * lc
        + np.einsum("ij,ij->i", a, b) * lc
        + np.einsum("ij,ij->i", b, c) * la
        + np.einsum("ij,ij->i", c, a) * lb
    )
    return abs(2 * np.arctan2(triple, flat).sum()) > 2 * np.pi


def in_largest_body(points, triangles):
    """True for triangles of the part that encloses the largest volume, and of its cavities."""
    part, _, around = shells(points, triangles)
    volumes = [abs(surface_volume(points, triangles[part == p])) for p in range(len(around))]
    largest = np.argmax(volumes)
    return (part == largest) | (around[part] == largest)
