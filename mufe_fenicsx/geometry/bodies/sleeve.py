"""A sleeve: a thin tube around a cylindrical sample."""

import itertools
import math

import numpy as np

from ...arguments import checked
from ...errors import InputError
from ...machine.memory import check_room
from ..measure import positively_oriented
from .contact_mesh import require_positive

#: Fewest edges around: the angle between two of its facets stays below that of a sharp edge.
FEWEST = 20
#: Growth of the distance of rings over the way from an end.
GROWTH = 0.2


@checked
def sleeve(
    radius: float,
    thickness: float,
    height: float,
    h: float,
    layers: int = 1,
    at_ends: float | None = None,
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
        at_ends: Length of edges along at both ends [m], from where they grow to h; None: h.

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
    if at_ends is not None:
        require_positive("element size at the ends of sleeve", at_ends)
    bricks = layers * around * height / h
    check_room(1000 * bricks, f"a sleeve of {bricks:.2g} bricks", ": expected longer edges")
    level = _levels(height, h, h if at_ends is None else at_ends)
    up = len(level) - 1
    n = np.array([layers, around, up])
    axes = [np.arange(k + 1) for k in n]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = mirrored_bricks(n)
    round_ = math.sqrt(2 * math.pi / around / math.sin(2 * math.pi / around))
    r = round_ * (radius + thickness * grid[:, 0] / layers)
    angle = 2 * math.pi * grid[:, 1] / around
    z = level[grid[:, 2]]
    # The seam: angle 2π is that of 0.
    strides = np.array([(around + 1) * (up + 1), up + 1, 1])
    number = grid % [layers + 1, around, up + 1] @ strides
    used, cells = np.unique(number[cells], return_inverse=True)
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])[used]
    cells = cells.reshape(-1, 4)
    return points, positively_oriented(points, cells)


def _levels(height, h, at_ends):
    """Heights of rings that are ``at_ends`` apart at both ends and at most ``h`` [m] elsewhere.

    Distances grow by the part ``GROWTH`` of the way from an end.
    """
    z = np.linspace(0.0, height, 2001)
    size = np.minimum(h, at_ends + GROWTH * np.minimum(z, height - z))
    rings = np.append(0.0, np.cumsum(0.5 * np.diff(z) * (1.0 / size[1:] + 1.0 / size[:-1])))
    up = max(round(float(rings[-1])), 1)
    return np.interp(np.arange(up + 1) * rings[-1] / up, rings, z)


@checked
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
