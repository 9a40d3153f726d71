"""A direct shear test of balls: surfaces of both halves of the box and of its lid, and stages."""

import numpy as np

from ..geometry.tets.foreign import write_surface

#: Walls of the box and thickness of floor and lid, over its width; the lid goes in freely.
THICK, FLOOR, CLEARANCE = 0.3, 0.15, 0.01
#: Gap between the halves, over the width: less than a ball, so that none comes out.
GAP = 0.04
#: What the scene says beside materials. The load is 2 MPa on the lid.
SCENE = """
[[tool]]                  # the lower half, with its floor: at rest
name = "lower"
surface = "lower.stl"     # in metres; another unit of length: unit = "1 mm"
friction = 0.5

[[tool]]                  # the upper half, led by the stages
name = "upper"
surface = "upper.stl"
friction = 0.5

[[tool]]                  # the lid goes along x with it, and is free along z under a dead load
name = "lid"
surface = "lid.stl"
free = "z"
force = [0, 0, "-2.5 N"]
friction = 0.5

[solver]
time_step_factor = 0.45   # coarse balls on the edges of the box
damping = "200 ms^-1"     # 1/ms: stills what the load shakes when it comes; counted as damping

[loading]                 # the walls stand around the box and do nothing
speed = "1 m/s"

[[stage]]                 # the load comes, as a seating that is not judged
zero = true
until = { time = "40 us" }

[[stage]]
name = "shear"
tools.upper = { velocity = ["0.5 m/s", 0, 0], ramp = "20 us" }
tools.lid = { velocity = ["0.5 m/s", 0, 0], ramp = "20 us" }
until = { time = "240 us" }
"""


def write_shear_box(folder, grains):
    """Write the surfaces of a shear box around ``grains``, which the scene names.

    Args:
        folder: Where to.
        grains: :class:`~mufe_fenicsx.geometry.grains.Grains`.
    """
    low, high = grains.points.min(axis=0), grains.points.max(axis=0)
    inner, width = (low[:2], high[:2]), float((high - low)[:2].max())
    middle, gap = 0.5 * (low[2] + high[2]), GAP * width
    lower = cup(inner, THICK * width, low[2] - FLOOR * width, low[2], middle - 0.5 * gap)
    upper = ring(inner, THICK * width, middle + 0.5 * gap, high[2] + FLOOR * width)
    room = CLEARANCE * width
    lid = plate((low[:2] + room, high[:2] - room), high[2], high[2] + FLOOR * width)
    for name, surface in (("lower", lower), ("upper", upper), ("lid", lid)):
        write_surface(folder / f"{name}.stl", *surface)


def _corners(low, high, z):
    """Corners of a rectangle at a height, counter-clockwise from above."""
    return np.array([[low[0], low[1], z], [high[0], low[1], z], [high[0], high[1], z],
                     [low[0], high[1], z]])  # fmt: skip


def _between(a, b):
    """Triangles between two rings of four corners, numbered from ``a`` and ``b``."""
    found = []
    for k in range(4):
        n = (k + 1) % 4
        found += [[a + k, a + n, b + n], [a + k, b + n, b + k]]
    return found


def _square(a, up):
    """Triangles across a ring of four corners."""
    found = [[a, a + 1, a + 2], [a, a + 2, a + 3]]
    return found if up else [triangle[::-1] for triangle in found]


def ring(inner, thick, bottom, top):
    """A frame around the rectangle ``inner``: points [m] and triangles, seen from outside."""
    outer = inner[0] - thick, inner[1] + thick
    points = [_corners(*sides, z) for sides in (outer, inner) for z in (bottom, top)]
    # Rings: 0 outer bottom, 4 outer top, 8 inner bottom, 12 inner top.
    triangles = [*_between(0, 4), *_between(4, 12), *_between(12, 8), *_between(8, 0)]
    return np.vstack(points), np.array(triangles)


def cup(inner, thick, bottom, floor, top):
    """A frame with a floor."""
    outer = inner[0] - thick, inner[1] + thick
    points = [_corners(*outer, bottom), _corners(*outer, top), _corners(*inner, floor),
              _corners(*inner, top)]  # fmt: skip
    triangles = [*_between(0, 4), *_between(4, 12), *_between(12, 8), *_square(8, True),
                 *_square(0, False)]  # fmt: skip
    return np.vstack(points), np.array(triangles)


def plate(sides, bottom, top):
    """A brick."""
    points = [_corners(*sides, bottom), _corners(*sides, top)]
    return np.vstack(points), np.array([*_between(0, 4), *_square(4, True), *_square(0, False)])
