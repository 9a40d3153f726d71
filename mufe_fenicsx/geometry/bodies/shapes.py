"""Bodies of simple shape, as tetrahedra: nodes [m] (N, 3) and cells (M, 4).

All cells are positively oriented and every node belongs to a cell.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import checked
from ...errors import finite_array
from ...machine.memory import check_room
from ..measure import positively_oriented
from ..tets.gmsh_model import gmsh_model
from .bulge import bulged_ball
from .contact_mesh import (
    checked_contact,
    even_edges,
    refine_at,
    require_positive,
    rotation_from_y,
    tets,
)


@checked
def box(
    lengths: Sequence[float],
    divisions: Sequence[int],
    origin: Sequence[float] = (0.0, 0.0, 0.0),
) -> tuple[np.ndarray, np.ndarray]:
    """A block of bricks of six tetrahedra each, which share a diagonal (Kuhn 1960).

    Args:
        lengths: Edges along x, y, z [m].
        divisions: Bricks along x, y, z.
        origin: The corner with the smallest coordinates [m].
    """
    for name, values in (("lengths", lengths), ("divisions", divisions), ("origin", origin)):
        finite_array(f"{name} of box", values, (3,))
    require_positive("edge of box", *lengths)
    require_positive("divisions of box", *divisions)
    check_room(1000 * math.prod(divisions), f"divisions of box = {list(divisions)}")
    n = np.asarray(divisions, dtype=np.int64)
    axes = [
        np.linspace(o, o + length, k + 1) for o, length, k in zip(origin, lengths, n, strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    stride = np.array([(n[1] + 1) * (n[2] + 1), n[2] + 1, 1])
    bricks = np.stack(np.meshgrid(*map(np.arange, n), indexing="ij"), axis=-1).reshape(-1, 3)
    first = bricks @ stride
    paths = []
    for a, b, c in itertools.permutations(stride):
        paths.append(np.column_stack([first, first + a, first + a + b, first + a + b + c]))
    cells = np.stack(paths, axis=1).reshape(-1, 4)
    return points, positively_oriented(points, cells)


@checked
def tetrahedron(edge: float) -> tuple[np.ndarray, np.ndarray]:
    """One regular tetrahedron of the given edge [m], its centre at the origin."""
    require_positive("edge of tetrahedron", edge)
    corners = np.array([[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]], dtype=float)
    points = corners * edge / np.sqrt(8)
    return points, positively_oriented(points, np.array([[0, 1, 2, 3]]))


@checked
def sphere(
    radius: float, h: float, centre: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray]:
    """A ball of edges of length ``h`` [m]; its surface nodes lie on the sphere."""
    require_positive("radius of sphere", radius)
    require_positive("element size", h)
    with gmsh_model(even_edges(h / radius)) as gmsh:
        gmsh.model.occ.addSphere(0, 0, 0, 1)
        gmsh.model.occ.synchronize()
        points, cells = tets(gmsh)
    return points * radius + np.asarray(centre), cells


@checked
def cylinder(radius: float, height: float, h: float) -> tuple[np.ndarray, np.ndarray]:
    """An upright cylinder on z = 0 around the z axis, edges of length ``h`` [m]."""
    require_positive("radius of cylinder", radius)
    require_positive("height of cylinder", height)
    require_positive("element size", h)
    with gmsh_model(even_edges(h / radius)) as gmsh:
        gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, height / radius, 1)
        gmsh.model.occ.synchronize()
        points, cells = tets(gmsh)
    return points * radius, cells


@checked
def sphere_near_contact(
    radius: float,
    h_contact: float,
    growth: float = 0.1,
    direction: ArrayLike = (0.0, 0.0, -1.0),
    contact_radius: float | None = None,
    *,
    both_poles: bool = False,
    h_max: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """A ball that is fine where it will be touched.

    The size is ``h_contact`` within 1.5 contact radii of the pole and grows
    from there by ``growth`` per unit distance. The pole itself is a node. The facets
    enclose the volume of the ball, so the nodes lie a little outside of it.

    Args:
        radius: Radius of the ball, its centre at the origin [m].
        h_contact: Length of edges at the contact [m].
        growth: Increase of the size with the distance [-].
        direction: From the centre to the pole.
        contact_radius: Largest radius of the contact [m]; ``4 h_contact`` if None.
        both_poles: Fine at the opposite pole too.
        h_max: Largest size [m]; a third of the radius if None.
    """
    require_positive("radius of sphere", radius)
    h_max = radius / 3 if h_max is None else h_max
    contact_radius = checked_contact(h_contact, growth, contact_radius, h_max)
    axis = np.asarray(direction, dtype=float)
    require_positive("length of direction", np.linalg.norm(axis))

    h, fine = h_contact / radius, 1.5 * contact_radius / radius
    # gmsh's sphere has its seam at +x and degenerate points at ±z, so the
    # fine regions are put at ±y and turned afterwards.
    with gmsh_model(even_edges(h_max / radius, smallest=h)) as gmsh:
        ball = gmsh.model.occ.addSphere(0, 0, 0, 1)
        poles = [(1, gmsh.model.occ.addPoint(0, 1, 0))]
        if both_poles:
            poles.append((-1, gmsh.model.occ.addPoint(0, -1, 0)))
        gmsh.model.occ.synchronize()
        (surface,) = [tag for _, tag in gmsh.model.getBoundary([(3, ball)], oriented=False)]
        gmsh.model.mesh.embed(0, [tag for _, tag in poles], 2, surface)

        refine_at(gmsh, [y for y, _ in poles], h, growth, fine)
        points, cells = tets(gmsh)
    points = bulged_ball(points, cells)
    return radius * points @ rotation_from_y(axis / np.linalg.norm(axis)).T, cells
