"""A block with a spherical hollow that is fine at its lowest point."""

import numpy as np

from ..tets.gmsh_model import gmsh_model
from .bulge import bulged
from .contact_mesh import even_edges, refine_at, require_positive, tets

#: Of the block, in radii of the hollow: half of its width, height of the hollow's lowest point
#: above the base, depth of the hollow.
HALF_WIDTH, HEIGHT, DEPTH = 2.0, 2.0, 0.9


def hollow(
    radius: float, h_contact: float, growth: float, fine: float
) -> tuple[np.ndarray, np.ndarray]:
    """A block on z = 0 with a hollow whose lowest point is (0, 0, HEIGHT radii).

    The size is ``h_contact`` within ``fine`` of that point, which is no node, and grows from there
    by ``growth`` per unit distance. The facets of the hollow enclose its volume.

    Args:
        radius: Of the hollow [m].
        h_contact: Length of edges at the contact [m].
        growth: Increase of the size with the distance [-].
        fine: Radius of the fine region [m].

    Returns:
        points (N, 3) [m] and positively oriented cells (M, 4).

    Raises:
        InputError: A size is not > 0.
    """
    require_positive("radius of hollow", radius)
    require_positive("element size at the contact", h_contact)
    h, wide = h_contact / radius, 2 * HALF_WIDTH
    with gmsh_model(even_edges(0.5, smallest=h)) as gmsh:
        occ = gmsh.model.occ
        box = occ.addBox(-HALF_WIDTH, -HEIGHT, -HALF_WIDTH, wide, HEIGHT + DEPTH, wide)
        occ.cut([(3, box)], [(3, occ.addSphere(0, 1, 0, 1))])
        occ.synchronize()
        refine_at(gmsh, [0], h, growth, fine / radius)
        points, cells = tets(gmsh)
    inward = np.array([0, 1, 0]) - points
    distance = np.linalg.norm(inward, axis=1)
    # Nodes of the rim stay on it.
    curved = (np.abs(distance - 1) < 1e-9) & (points[:, 1] < DEPTH - 1e-9)
    points[np.abs(points[:, 1] + HEIGHT) < 1e-9, 1] = -HEIGHT
    points = bulged(points, cells, curved, inward / distance[:, None], -2.0)
    # From y to z, the base to z = 0.
    return radius * (points[:, [2, 0, 1]] + np.array([0, 0, HEIGHT])), cells
