"""A body joined with its mirror image."""

import numpy as np

from ...errors import InputError


def with_image(points, cells, normal):
    """A body that ends on a plane through the origin, and its image beyond, as one body.

    Args:
        points: Nodes [m], shape (num_nodes, 3).
        cells: Tetrahedra, shape (num_cells, 4).
        normal: Normal of the plane, shape (3,).

    Returns:
        Nodes, those of the body first, and cells; nodes on the plane belong to both halves.

    Raises:
        InputError: Nodes on both sides of the plane, or fewer than three on it.
    """
    unit = np.asarray(normal, float) / np.linalg.norm(normal)
    height = points @ unit
    tiny = 1e-9 * np.ptp(points, axis=0).max()
    on = np.abs(height) <= tiny
    if height.min() < -tiny and height.max() > tiny:
        raise InputError("nodes lie on both sides of the plane, expected a body on one side of it")
    if on.sum() < 3:
        raise InputError(f"nodes on the plane = {on.sum()}, expected at least 3")
    image = points[~on] - 2.0 * height[~on, None] * unit
    number = np.arange(len(points))
    number[~on] = len(points) + np.arange(len(image))
    # The image of a tetrahedron has the other orientation.
    return np.vstack([points, image]), np.vstack([cells, number[cells][:, [1, 0, 2, 3]]])
