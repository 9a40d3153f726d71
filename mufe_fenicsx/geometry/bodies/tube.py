"""A hollow cylinder."""

import numpy as np

from ...errors import InputError
from .shapes import box, positively_oriented, require_positive


def tube(
    radius: float, inner_radius: float, height: float, divisions: tuple[int, int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """An upright hollow cylinder on z = 0 around the z axis, of regular tetrahedra.

    A box is bent around the axis until its ends meet. Nodes lie on both cylinders.

    Args:
        radius: Of the outer side [m].
        inner_radius: Of the hole [m].
        height: [m].
        divisions: Numbers of bricks around, across the wall and along the axis; at least three
            around.

    Returns:
        Nodes [m], shape (num_nodes, 3), and tetrahedra.

    Raises:
        InputError: A size is not positive, the hole is wider than the tube, or there are fewer
            than three bricks around.
    """
    for name, value in (("radius", radius), ("inner_radius", inner_radius), ("height", height)):
        require_positive(f"{name} of tube", value)
    if not inner_radius < radius:
        raise InputError(f"inner_radius of tube = {inner_radius}, expected less than {radius}")
    if divisions[0] < 3:
        raise InputError(f"divisions around tube = {divisions[0]}, expected at least 3")
    points, cells = box((1.0, 1.0, 1.0), divisions)
    around = np.rint(points[:, 0] * divisions[0]).astype(int) % divisions[0]
    angle = 2.0 * np.pi * around / divisions[0]
    r = inner_radius + points[:, 1] * (radius - inner_radius)
    bent = np.column_stack([r * np.cos(angle), r * np.sin(angle), height * points[:, 2]])
    key = np.column_stack([around, np.rint(points[:, 1:] * divisions[1:])]).astype(int)
    _, first, node = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return bent[first], positively_oriented(bent[first], node.ravel()[cells])
