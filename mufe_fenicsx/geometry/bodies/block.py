"""A block that is fine at a place of its top."""

import numpy as np

from ..tets.gmsh_model import gmsh_model
from .contact_mesh import even_edges, refine_at, require_positive, tets


def block(
    length: float, to_edge: float, h_contact: float, growth: float, fine: float
) -> tuple[np.ndarray, np.ndarray]:
    """A cube on z = 0 whose top is touched on the z axis, ``to_edge`` from one of its edges.

    The size is ``h_contact`` within ``fine`` of the place and grows from there by ``growth`` per
    unit distance. The place is no node.

    Args:
        length: Of the edges of the cube [m].
        to_edge: From the z axis to its side at x = ``to_edge`` [m].
        h_contact: Length of edges at the place [m].
        growth: Increase of the size with the distance [-].
        fine: Radius of the fine region [m].

    Returns:
        points (N, 3) [m] and positively oriented cells (M, 4).

    Raises:
        InputError: A size is not > 0.
    """
    require_positive("length of block", length)
    require_positive("element size at the contact", h_contact)
    h = h_contact / length
    with gmsh_model(even_edges(0.25, smallest=h)) as gmsh:
        gmsh.model.occ.addBox(to_edge / length - 1, 0, -0.5, 1, 1, 1)
        gmsh.model.occ.synchronize()
        refine_at(gmsh, [1], h, growth, fine / length)
        points, cells = tets(gmsh)
    # A quarter of a turn about x, from y to z.
    return length * points[:, [0, 2, 1]] * [1, -1, 1], cells
