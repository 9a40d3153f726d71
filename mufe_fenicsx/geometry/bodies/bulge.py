"""Bodies with curved surfaces whose facets enclose the volume of the body, not less."""

import numpy as np

from ..measure import boundary_triangles


def bulged(points, cells, curved, normal, curvature):
    """Move the nodes of a curved surface outward until its facets cut through it.

    A flat triangle of edge h with its nodes on a surface of principal curvatures κ₁ and κ₂
    lies behind it, by h² (κ₁ + κ₂)/16 on average. A node moves by the mean of that over
    its facets, by area: what is left of the volume's error is of the next order in h. Grains
    from images keep their volume too, so contact meets the same kind of surface in both.

    Args:
        points: Nodes [m], shape (num_nodes, 3).
        cells: Tetrahedra, shape (num_cells, 4).
        curved: Whether a node lies on the curved surface and may move, shape (num_nodes,).
        normal: Outward unit normals there, shape (num_nodes, 3); others do not matter.
        curvature: κ₁ + κ₂ there [1/m], shape (num_nodes,) or a number.

    Returns:
        New points.
    """
    triangles = boundary_triangles(cells)
    a, b, c = (points[triangles[:, i]] for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    edge2 = 4 / np.sqrt(3) * area
    n = len(points)
    weight = np.bincount(triangles.ravel(), np.repeat(area, 3), n)
    mean = np.bincount(triangles.ravel(), np.repeat(area * edge2, 3), n)
    moved = points.copy()
    at = np.flatnonzero(curved)
    sag = mean[at] / weight[at] * np.broadcast_to(curvature, n)[at] / 16
    moved[at] += sag[:, None] * normal[at]
    return moved


def bulged_ball(points, cells, low=-np.inf):
    """A unit ball, cut at y = ``low``, whose facets enclose its volume."""
    distance = np.linalg.norm(points, axis=1)
    curved = (distance > 1 - 1e-9) & (points[:, 1] > low + 1e-9)
    return bulged(points, cells, curved, points, 2.0)
