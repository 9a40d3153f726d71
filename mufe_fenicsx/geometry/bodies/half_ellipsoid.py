"""An ellipsoid cut by a plane: a body with one contact and a flat base to hold it by."""

import numpy as np

from ..tets.gmsh_model import gmsh_model
from .bulge import bulged
from .contact_mesh import checked_contact, even_edges, refine_at, require_positive, tets


def half_ellipsoid(semi_axes, h_contact, growth=0.1, contact_radius=None, h_max=None):
    """Upper half of an ellipsoid that is fine at its pole (0, 0, c).

    The size is ``h_contact`` within 1.5 contact radii of the pole and grows from there by
    ``growth`` per unit distance. The pole itself is a node, the base lies in z = 0; the
    surface's radii of curvature at the pole are a²/c and b²/c. The curved facets enclose the
    volume of the body, so their nodes lie a little outside.

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
    h_max = min(semi_axes) / 3 if h_max is None else h_max
    require_positive("semi-axis of half ellipsoid", *semi_axes)
    contact_radius = checked_contact(h_contact, growth, contact_radius, h_max)

    unit = max(semi_axes)
    a, b, c = (axis / unit for axis in semi_axes)
    h, fine = h_contact / unit, 1.5 * contact_radius / unit
    # The pole is at +y, away from the seam of gmsh's sphere; turned afterwards.
    with gmsh_model(even_edges(h_max / unit, smallest=h)) as gmsh:
        occ = gmsh.model.occ
        ball, upper = occ.addSphere(0, 0, 0, 1), occ.addBox(-2, 0, -2, 4, 2, 4)
        ((_, half),), _ = occ.intersect([(3, ball)], [(3, upper)])
        occ.dilate([(3, half)], 0, 0, 0, b, c, a)
        pole = occ.addPoint(0, c, 0)
        occ.synchronize()
        sides = [tag for _, tag in gmsh.model.getBoundary([(3, half)], oriented=False)]
        curved = max(sides, key=lambda tag: gmsh.model.getBoundingBox(2, tag)[4])
        gmsh.model.mesh.embed(0, [pole], 2, curved)
        refine_at(gmsh, [c], h, growth, fine)
        points, cells = tets(gmsh)
    points[np.abs(points[:, 1]) < 1e-9, 1] = 0.0
    inverse = np.array([b, c, a]) ** -2.0
    slope = points * inverse
    size = np.linalg.norm(slope, axis=1)
    curved = ((points * slope).sum(axis=1) > 1 - 1e-6) & (points[:, 1] > 0)
    with np.errstate(invalid="ignore", divide="ignore"):  # at the centre
        normal = slope / size[:, None]
        # Divergence of the unit normals of the ellipsoids through the points.
        curvature = (inverse.sum() - (normal**2 * inverse).sum(axis=1)) / size
    points = bulged(points, cells, curved, normal, curvature)
    # (x, y, z) to (z, x, y): a rotation.
    return unit * points[:, [2, 0, 1]], cells
