"""A cylinder cut along its axis: a body with one contact and a flat base to hold it by."""

import numpy as np

from ...errors import InputError
from ..tets.gmsh_model import gmsh_model
from .bulge import bulged
from .contact_mesh import checked_contact, even_edges, refine_at, require_positive, tets


def half_cylinder(
    radius, length, h_contact, growth=0.1, contact_radius=None, h_max=None, line=False
):
    """Upper half of a cylinder around the x axis that is fine at its pole (0, 0, radius).

    The size is ``h_contact`` within 1.5 contact radii of the pole, or of the whole line through
    it, and grows from there by ``growth`` per unit distance. The pole itself is a node, the base
    lies in z = 0.
    The curved facets enclose the volume of the body, so their nodes lie a little outside.

    Args:
        radius: Radius [m].
        length: Along the axis, from -length/2 to length/2 [m].
        h_contact: Length of edges at the contact [m].
        growth: Increase of the size with the distance [-].
        contact_radius: Largest radius of the contact [m]; ``4 h_contact`` if None.
        h_max: Largest size [m]; a third of the radius if None.
        line: Fine along the line y = 0 of the surface, for a contact with a plane.

    Returns:
        points (N, 3) [m] and positively oriented cells (M, 4).

    Raises:
        InputError: A size is not > 0.
    """
    h_max = radius / 3 if h_max is None else h_max
    require_positive("radius of half cylinder", radius)
    require_positive("length of half cylinder", length)
    contact_radius = checked_contact(h_contact, growth, contact_radius, h_max)

    h, fine, long = h_contact / radius, 1.5 * contact_radius / radius, length / radius
    # One arc of half a turn, so that the pole at +y lies on no edge; turned afterwards.
    with gmsh_model(even_edges(h_max / radius, smallest=h)) as gmsh:
        occ = gmsh.model.occ
        ends = [occ.addPoint(x, 0, -0.5 * long) for x in (1, -1)]
        middle = occ.addPoint(0, 0, -0.5 * long)
        top = occ.addPoint(0, 1, -0.5 * long)
        arc = occ.addCircleArc(ends[0], top, ends[1], center=False)
        face = occ.addPlaneSurface([occ.addCurveLoop([arc, occ.addLine(ends[1], ends[0])])])
        occ.extrude([(2, face)], 0, 0, long)
        occ.remove([(0, middle), (0, top)])
        pole = occ.addPoint(0, 1, 0)
        occ.synchronize()
        (curved,) = [
            tag for _, tag in gmsh.model.getEntities(2) if gmsh.model.getType(2, tag) == "Cylinder"
        ]
        gmsh.model.mesh.embed(0, [pole], 2, curved)
        refine_at(gmsh, [1], h, growth, fine, line)
        points, cells = tets(gmsh)
    if not points.size:
        raise InputError(f"element size at the contact = {h_contact}, expected a mesh")
    points[np.abs(points[:, 1]) < 1e-9, 1] = 0.0
    normal = points * [1.0, 1.0, 0.0]
    distance = np.linalg.norm(normal, axis=1)
    curved = (distance > 1 - 1e-9) & (points[:, 1] > 0)
    points = bulged(points, cells, curved, normal, 1.0)
    # (x, y, z) to (z, x, y): a rotation.
    return radius * points[:, [2, 0, 1]], cells
