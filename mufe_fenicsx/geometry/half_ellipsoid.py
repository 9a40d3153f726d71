"""An ellipsoid cut by a plane: a body with one contact and a flat base to hold it by."""

import numpy as np

from .gmsh_model import gmsh_model
from .shapes import _even, _positive, _refine_at, _tets


def half_ellipsoid(semi_axes, h_contact, growth=0.1, contact_radius=None, h_max=None):
    """Upper half of an ellipsoid that is fine at its pole (0, 0, c).

    The size is ``h_contact`` within 1.5 contact radii of the pole and grows from there by
    ``growth`` per unit distance. The pole itself is a node, the base lies in z = 0; the
    surface's radii of curvature at the pole are a²/c and b²/c.

    Args:
        semi_axes: a, b, c along x, y, z [m].
        h_contact: Length of edges at the contact [m].
        growth: Increase of the size with the distance [-].
        contact_radius: Largest radius of the contact [m]; ``4 h_contact`` if None.
        h_max: Largest size [m]; a third of the smallest semi-axis if None.

    Returns:
        points (N, 3) [m] and positively oriented cells (M, 4).

    Raises:
        InputError: A size is not > 0.
    """
    contact_radius = 4 * h_contact if contact_radius is None else contact_radius
    h_max = min(semi_axes) / 3 if h_max is None else h_max
    _positive("semi-axis of half ellipsoid", *semi_axes)
    for name, value in {
        "element size at the contact": h_contact,
        "growth of the element size": growth,
        "contact radius": contact_radius,
        "largest element size": h_max,
    }.items():
        _positive(name, value)

    unit = max(semi_axes)
    a, b, c = (axis / unit for axis in semi_axes)
    h, fine = h_contact / unit, 1.5 * contact_radius / unit
    # The pole is at +y, away from the seam of gmsh's sphere; turned afterwards.
    with gmsh_model(_even(h_max / unit, smallest=h)) as gmsh:
        occ = gmsh.model.occ
        ball, upper = occ.addSphere(0, 0, 0, 1), occ.addBox(-2, 0, -2, 4, 2, 4)
        ((_, half),), _ = occ.intersect([(3, ball)], [(3, upper)])
        occ.dilate([(3, half)], 0, 0, 0, b, c, a)
        pole = occ.addPoint(0, c, 0)
        occ.synchronize()
        sides = [tag for _, tag in gmsh.model.getBoundary([(3, half)], oriented=False)]
        curved = max(sides, key=lambda tag: gmsh.model.getBoundingBox(2, tag)[4])
        gmsh.model.mesh.embed(0, [pole], 2, curved)
        _refine_at(gmsh, [c], h, growth, fine)
        points, cells = _tets(gmsh)
    points[np.abs(points[:, 1]) < 1e-9, 1] = 0.0
    # (x, y, z) to (z, x, y): a rotation.
    return unit * points[:, [2, 0, 1]], cells
