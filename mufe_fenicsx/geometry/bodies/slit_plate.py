"""A plate of one layer of tetrahedra, unstructured in its plane, with a straight slit."""

import numpy as np

from ..measure import compact, positively_oriented
from ..tets.gmsh_model import gmsh_model
from .contact_mesh import check_tets, even_edges, require_positive


def slit_plate(length, height, h, slit):
    """A plate from the origin along x and y, as thick as an edge is long.

    Three tetrahedra stand over each triangle, whose sides follow the slit. Its faces are not parted
    yet. Sides have all directions alike; a length that differs by a hundredth gives another mesh.

    Args:
        length, height: Along x and y [m].
        h: Length of edges, and thickness [m].
        slit: Its length from x = 0 on, and its y [m].

    Returns:
        points (N, 3) [m] and positively oriented cells (M, 4).

    Raises:
        InputError: A size is not > 0, or far too small.
    """
    require_positive("length and height of plate", length, height)
    require_positive("element size", h)
    check_tets(length * height * h, h)
    with gmsh_model(even_edges(h / length) | {"Mesh.Algorithm": 5}) as gmsh:
        occ = gmsh.model.occ
        ends = [occ.addPoint(x / length, slit[1] / length, 0) for x in (0, slit[0])]
        face = occ.addRectangle(0, 0, 0, 1, height / length)
        occ.fragment([(2, face)], [(1, occ.addLine(*ends))])
        occ.synchronize()
        gmsh.model.mesh.generate(2)
        tags, points, _ = gmsh.model.mesh.getNodes()
        _, corners = gmsh.model.mesh.getElementsByType(2)
    order = np.argsort(tags)
    points = length * points.reshape(-1, 3)[order]
    corners = np.searchsorted(tags[order], corners).reshape(-1, 3)
    points, corners = compact(points, corners)
    a, b, c = np.sort(corners, axis=1).T  # diagonals rise to the later node: neighbours agree
    over_a, over_b, over_c = a + len(points), b + len(points), c + len(points)
    tets = (a, b, c, over_c), (a, b, over_b, over_c), (a, over_a, over_b, over_c)
    points = np.concatenate([points, points + h * np.array([0.0, 0.0, 1.0])])
    return points, positively_oriented(points, np.concatenate([np.stack(t, axis=1) for t in tets]))
