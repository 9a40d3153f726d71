"""A ball cut by a plane: a body with one contact and a flat base to hold it by."""

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import checked
from ...errors import InputError, finite_array
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
def half_ball(
    radius: float,
    h_contact: float,
    growth: float = 0.1,
    direction: ArrayLike = (0.0, 0.0, -1.0),
    contact_radius: float | None = None,
    h_max: float | None = None,
    height: float | None = None,
    quarter: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """A cap of a ball, or half of one, that is fine at its pole.

    The size is ``h_contact`` within 1.5 contact radii of the pole and grows
    from there by ``growth`` per unit distance. The pole itself is a node, the
    base is flat and normal to ``direction``. The curved facets enclose the volume of the
    cap, so their nodes lie a little outside of it.

    Args:
        radius: Radius of the ball, its centre at the origin [m].
        h_contact: Length of edges at the contact [m].
        growth: Increase of the size with the distance [-].
        direction: From the centre to the pole.
        contact_radius: Largest radius of the contact [m]; ``4 h_contact`` if None.
        h_max: Largest size [m]; a third of the height if None.
        height: From the base to the pole [m], at most the radius, which is the default.
        quarter: Only a quarter of it, cut along its axis by two planes at right angles: for the
            direction z that of x >= 0 and y <= 0, for others that one turned to them.

    Returns:
        points (N, 3) [m] and positively oriented cells (M, 4).

    Raises:
        InputError: A size is not > 0, or the height exceeds the radius.
    """
    direction = finite_array("direction", direction, (3,))
    height = radius if height is None else height
    h_max = height / 3 if h_max is None else h_max
    require_positive("radius of half ball", radius)
    require_positive("height of half ball", height)
    contact_radius = checked_contact(h_contact, growth, contact_radius, h_max)
    if height > radius:
        raise InputError(f"height of half ball = {height}, expected at most its radius, {radius}")
    axis = np.asarray(direction, dtype=float)
    require_positive("length of direction", np.linalg.norm(axis))

    h, fine, base = h_contact / radius, 1.5 * contact_radius / radius, 1 - height / radius
    # The pole is at +y, away from the seam of gmsh's sphere, and turned afterwards.
    with gmsh_model(even_edges(h_max / radius, smallest=h)) as gmsh:
        occ = gmsh.model.occ
        start = 0 if quarter else -2
        ball, upper = occ.addSphere(0, 0, 0, 1), occ.addBox(start, base, start, 4, 2, 4)
        ((_, cap),), _ = occ.intersect([(3, ball)], [(3, upper)])
        pole = None if quarter else occ.addPoint(0, 1, 0)
        occ.synchronize()
        if pole is not None:  # of a quarter it is a corner
            (curved,) = [
                tag
                for _, tag in gmsh.model.getBoundary([(3, cap)], oriented=False)
                if gmsh.model.getType(2, tag) == "Sphere"
            ]
            gmsh.model.mesh.embed(0, [pole], 2, curved)
        refine_at(gmsh, [1], h, growth, fine)
        points, cells = tets(gmsh)
    on_base = np.abs(points[:, 1] - base) < 1e-9
    points[on_base, 1] = base
    if quarter:
        cut = points[:, [0, 2]]
        points[:, [0, 2]] = np.where(np.abs(cut) < 1e-9, 0.0, cut)
    points = bulged_ball(points, cells, base)
    return radius * points @ rotation_from_y(axis / np.linalg.norm(axis)).T, cells
