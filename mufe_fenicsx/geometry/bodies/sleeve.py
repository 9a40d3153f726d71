"""A sleeve: a thin tube around a cylindrical sample."""

import itertools
import math

import numpy as np

from ...errors import InputError
from ..measure import positively_oriented
from .contact_mesh import require_positive

#: Fewest edges around: the angle between two of its facets stays below that of a sharp edge.
FEWEST = 20


def sleeve(
    radius: float, thickness: float, height: float, h: float, layers: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """An upright tube on z = 0 around the z axis, of bricks of six tetrahedra each.

    Bricks next to each other are mirror images, so that the mesh has no sense of turn. The inner
    polygon encloses the area of its circle; so does the outer one.

    Args:
        radius: Inner radius [m].
        thickness: Of its wall [m].
        height: Along z [m].
        h: Length of edges around and along [m].
        layers: Bricks through the wall.

    Returns:
        points (N, 3) [m] and positively oriented cells (M, 4).

    Raises:
        InputError: A size is not > 0, or the edges are too long for a round tube.
    """
    for name, value in (("radius", radius), ("thickness", thickness), ("height", height)):
        require_positive(f"{name} of sleeve", value)
    require_positive("element size", h)
    require_positive("layers of sleeve", layers)
    around = 2 * math.ceil(math.pi * (radius + 0.5 * thickness) / h)
    if around < FEWEST:
        longest = 2 * math.pi * (radius + 0.5 * thickness) / FEWEST
        raise InputError(
            f"element size of sleeve = {h:.3g} m, expected at most {longest:.3g} m: "
            f"{FEWEST} edges around"
        )
    up = max(round(height / h), 1)
    n = np.array([layers, around, up])
    axes = [np.arange(k + 1) for k in n]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = mirrored_bricks(n)
    round_ = math.sqrt(2 * math.pi / around / math.sin(2 * math.pi / around))
    r = round_ * (radius + thickness * grid[:, 0] / layers)
    angle = 2 * math.pi * grid[:, 1] / around
    z = grid[:, 2] * height / up
    # The seam: angle 2π is that of 0.
    strides = np.array([(around + 1) * (up + 1), up + 1, 1])
    number = grid % [layers + 1, around, up + 1] @ strides
    used, cells = np.unique(number[cells], return_inverse=True)
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])[used]
    cells = cells.reshape(-1, 4)
    return points, positively_oriented(points, cells)


def sleeve_around(
    radius: float, thickness: float, height: float, h: float, layers: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """A :func:`sleeve` with no facet within the circle of that ``radius`` [m]."""
    around = 2 * math.ceil(math.pi * (radius + 0.5 * thickness) / h)
    angle = math.pi / max(around, FEWEST)
    # Nodes stand out of the circle of the same area, and middles of facets into it.
    out = math.sqrt(2 * angle / math.sin(2 * angle))
    return sleeve(radius / (out * math.cos(angle)), thickness, height, h, layers)


def mirrored_bricks(n):
    """Tetrahedra of a grid of bricks, each the mirror image of those beside it.

    All paths along edges of a brick from its even corner to the one across it (Kuhn 1960).
    """
    strides = np.array([(n[1] + 1) * (n[2] + 1), n[2] + 1, 1])
    bricks = np.stack(np.meshgrid(*map(np.arange, n), indexing="ij"), axis=-1).reshape(-1, 3)
    odd = bricks % 2
    first = (bricks + odd) @ strides
    steps = (1 - 2 * odd) * strides
    paths = []
    for a, b, c in itertools.permutations(range(3)):
        second = first + steps[:, a]
        third = second + steps[:, b]
        paths.append(np.column_stack([first, second, third, third + steps[:, c]]))
    return np.stack(paths, axis=1).reshape(-1, 4)
