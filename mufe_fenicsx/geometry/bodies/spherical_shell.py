"""A hollow ball."""

import itertools

import numpy as np

from ..measure import positively_oriented
from .contact_mesh import require_positive

#: Corners of the eight faces of an octahedron.
_AXES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)


def spherical_shell(
    radius: float, thickness: float, divisions: int, layers: int = 1, octant: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """A sphere's wall around the origin, of prisms of three tetrahedra each.

    Nodes lie on spheres; triangles are those of an octahedron, divided and put on the sphere.

    Args:
        radius: Inner radius [m].
        thickness: Of the wall [m].
        divisions: Edges along a quarter of a great circle.
        layers: Prisms through the wall.
        octant: Only the eighth where no coordinate is negative.

    Returns:
        points (N, 3) [m] and positively oriented cells (M, 4).
    """
    require_positive("radius of shell", radius)
    require_positive("thickness of shell", thickness)
    require_positive("divisions of shell", divisions)
    require_positive("layers of shell", layers)
    points, triangles = _sphere_of_triangles(divisions, (0,) if octant else (0, 1))
    triangles = np.sort(triangles, axis=1)  # so that prisms share the diagonals of their sides
    count = len(points)
    radii = radius + thickness * np.arange(layers + 1) / layers
    nodes = (radii[:, None, None] * points).reshape(-1, 3)
    cells = []
    for layer in range(layers):
        low, high = triangles + layer * count, triangles + (layer + 1) * count
        for k in range(3):
            cells.append(np.column_stack([low[:, : k + 1], high[:, k:]]))
    cells = np.concatenate(cells)
    return nodes, positively_oriented(nodes, cells)


def _sphere_of_triangles(n, sides):
    """Points of the unit sphere and its triangles, on the positive ``sides`` of planes or both."""
    points, triangles = [], []
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    i, j = i[i + j <= n], j[i + j <= n]
    number = np.full((n + 2, n + 2), -1)
    number[i, j] = np.arange(i.size)
    up = np.column_stack([number[i, j], number[i + 1, j], number[i, j + 1]])[i + j < n]
    down = np.column_stack([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]])[
        i + j < n - 1
    ]
    weights = np.column_stack([i, j, n - i - j]) / n
    for side in itertools.product(sides, repeat=3):
        triangles.append(np.concatenate([up, down]) + len(points) * i.size)
        # Evenly by angle, not by length.
        face = np.sin(0.5 * np.pi * weights) @ _AXES[np.array([0, 2, 4]) + side]
        points.append(face / np.linalg.norm(face, axis=1)[:, None])
    every = np.concatenate(points)
    _, first, same = np.unique(
        np.round(every, 9) + 0.0, axis=0, return_index=True, return_inverse=True
    )
    return every[first], same.ravel()[np.concatenate(triangles)]
