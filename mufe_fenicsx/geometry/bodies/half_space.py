"""Half of a ball with its flat side up, fine at its middle: a half-space that is cut far off."""

import numpy as np

from ..tets.gmsh_model import gmsh_model
from .contact_mesh import even_edges, refine_at, require_positive, tets


def half_space(
    radius: float, h_contact: float, growth: float, contact_radius: float
) -> tuple[np.ndarray, np.ndarray]:
    """A half ball below z = 0 around the origin.

    The size is ``h_contact`` within 1.5 contact radii of the origin, which is a node, and grows
    from there by ``growth`` per unit distance. Nodes of the curved side lie on the sphere.

    Args:
        radius: Of the ball [m].
        h_contact: Length of edges at the contact [m].
        growth: Increase of the size with the distance [-].
        contact_radius: Of the contact [m].

    Returns:
        points (N, 3) [m] and positively oriented cells (M, 4).

    Raises:
        InputError: A size is not > 0.
    """
    require_positive("radius of half-space", radius)
    require_positive("element size at the contact", h_contact)
    h = h_contact / contact_radius
    far = radius / contact_radius
    with gmsh_model(even_edges(far / 3, smallest=h)) as gmsh:
        occ = gmsh.model.occ
        ball, wide = occ.addSphere(0, 0, 0, far), 2 * far
        below = occ.addBox(-wide, -wide, -wide, 2 * wide, wide, 2 * wide)
        ((_, body),), _ = occ.intersect([(3, ball)], [(3, below)])
        middle = occ.addPoint(0, 0, 0)
        occ.synchronize()
        (flat,) = [
            tag
            for _, tag in gmsh.model.getBoundary([(3, body)], oriented=False)
            if gmsh.model.getType(2, tag) == "Plane"
        ]
        gmsh.model.mesh.embed(0, [middle], 2, flat)
        refine_at(gmsh, [0], h, growth, 1.5)
        points, cells = tets(gmsh)
    points[np.abs(points[:, 1]) < 1e-9 * far, 1] = 0.0
    # From y to z.
    return contact_radius * points[:, [2, 0, 1]], cells
