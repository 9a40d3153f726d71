"""Triangulated spheres, and surfaces divided into smaller triangles."""

import numpy as np
import scipy.spatial


def icosphere(level):
    """Unit vectors and triangles, seen from outside, of an icosahedron divided ``level`` times."""
    a = (1 + np.sqrt(5)) / 2
    points = [(-1, a, 0), (1, a, 0), (-1, -a, 0), (1, -a, 0), (0, -1, a), (0, 1, a)]
    points += [(0, -1, -a), (0, 1, -a), (a, 0, -1), (a, 0, 1), (-a, 0, -1), (-a, 0, 1)]
    x = np.array(points) / np.sqrt(1 + a * a)
    hull = scipy.spatial.ConvexHull(x).simplices
    normal = np.cross(x[hull[:, 1]] - x[hull[:, 0]], x[hull[:, 2]] - x[hull[:, 0]])
    inside_out = np.einsum("ij,ij->i", normal, x[hull[:, 0]]) < 0
    faces = np.where(inside_out[:, None], hull[:, ::-1], hull).astype(np.int64)
    for _ in range(level):
        num_points = len(x)
        x, faces = divided(x, faces)
        x[num_points:] /= np.linalg.norm(x[num_points:], axis=1, keepdims=True)
    return x, faces


def divided(points, triangles):
    """A surface whose triangles are cut into four at the middles of their edges."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, number = np.unique(edges, axis=0, return_inverse=True)
    p, q, r = (len(points) + number.reshape(-1, 3)).T
    a, b, c = triangles.T
    parts = [(a, p, r), (p, b, q), (r, q, c), (p, q, r)]
    middle = points[edges].mean(axis=1)
    return np.vstack([points, middle]), np.concatenate([np.column_stack(part) for part in parts])


def vertex_areas(points, triangles):
    """A third of the triangles around each vertex, points (n, m, 3) -> (n, m) [m²]."""
    a, b, c = (points[:, triangles[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=2) / 6
    out = np.zeros(points.shape[:2])
    for i in range(3):
        for g in range(len(points)):
            out[g] += np.bincount(triangles[:, i], area[g], points.shape[1])
    return out
