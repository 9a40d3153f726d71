"""Distances of points from the surface that a mesh is to follow."""

import itertools

import numpy as np
import pyvista
from scipy.spatial import cKDTree


def voxel_distance(inside, at):
    """Distances of points from the faces between the voxels of a grain and all others [voxels].

    Args:
        inside: True for the grain's voxels; none on the border of the array.
        at: Positions by index, where (0, 0, 0) is the corner of the first voxel, shape (n, 3).
    """
    centres, normals = [], []
    for axis in range(3):
        low = np.argwhere(np.diff(inside, axis=axis))
        centre = low + 0.5
        centre[:, axis] = low[:, axis] + 1.0
        centres.append(centre)
        normals.append(np.full(len(low), axis))
    centres, normals = np.concatenate(centres), np.concatenate(normals)
    # The centre of the closest face is at most half a diagonal farther than its closest point;
    # squares whose centres lie within that are few.
    _, near = cKDTree(centres).query(at, k=min(16, len(centres)))
    away = np.abs(at[:, None, :] - centres[near])
    for axis, other in itertools.product(range(3), repeat=2):
        if axis != other:
            square = normals[near] == other
            away[..., axis] = np.where(
                square, np.maximum(away[..., axis] - 0.5, 0), away[..., axis]
            )
    return np.linalg.norm(away, axis=2).min(axis=1)


def surface_distance(points, triangles, at):
    """Distances of positions from a triangle surface, in the unit of the points."""
    surface = pyvista.PolyData.from_regular_faces(np.asarray(points, dtype=float), triangles)
    _, closest = surface.find_closest_cell(np.ascontiguousarray(at), return_closest_point=True)
    return np.linalg.norm(closest - at, axis=1)
