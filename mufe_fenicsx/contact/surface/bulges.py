"""How far a smooth surface stands above its facets.

Between the nodes of a facet the surface is a parabola. With the normals m of the surface at the
nodes a, b, c at ``x``, and the barycentric coordinates w of a point, its height over the facet is

    z(w) = q_ab w_a w_b + q_bc w_b w_c + q_ca w_c w_a - Σ o_v w_v ,  q_ab = ½ (m_b - m_a)·(x_b - x_a) .

2 q_ab is the curvature along the edge times the square of its length. The offset o of a node is the
mean of (q_ab + q_bc + q_ca)/12 over its facets, by area: the surface then encloses the volume that
the facets enclose. The normal of a node is the sum of those of its facets, each times its angle
there, over the facets that no sharp edge parts from each other. Where all are flat, q and o vanish.
"""

import numpy as np

#: As in contact_law.h.
XI = 0.104


def facet_bulges(own, x):
    """Numbers q_ab, q_bc, q_ca and o_a, o_b, o_c of own facets [m], shape (num_facets, 6). Local.

    Args:
        own: :class:`~.surface.OwnSurface`.
        x: Reference positions of its nodes [m], shape (num_nodes, 3).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    facets, num = own.facets, len(own.facets)
    if not num:
        return np.zeros((0, 6))
    corner = x[facets]
    area_vector = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = area_vector / np.linalg.norm(area_vector, axis=1, keepdims=True)
    to_next = np.roll(corner, -1, axis=1) - corner
    to_last = np.roll(corner, 1, axis=1) - corner
    cosine = np.einsum("fki,fki->fk", to_next, to_last)
    cosine /= np.linalg.norm(to_next, axis=2) * np.linalg.norm(to_last, axis=2)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    # Corners of facets at a node belong together where the edge between these is not sharp.
    facet, edge = np.nonzero((own.neighbour >= 0) & ~own.sharp_edge)
    other = own.neighbour[facet, edge]
    pairs = []
    for end in (edge, (edge + 1) % 3):
        node = facets[facet, end]
        across = (facets[other] == node[:, None]).argmax(axis=1)
        pairs.append((3 * facet + end, 3 * other + across))
    row, column = (np.concatenate(part) for part in zip(*pairs, strict=True))
    graph = coo_array((np.ones(row.size, bool), (row, column)), (3 * num, 3 * num))
    count, group = connected_components(graph, directed=False)
    group = group.reshape(num, 3)
    total = np.zeros((count, 3))
    np.add.at(total, group, angle[:, :, None] * normal[:, None, :])
    _mirror(own, group, total)
    total /= np.linalg.norm(total, axis=1, keepdims=True)
    at_corner = total[group]
    q = 0.5 * np.einsum("fki,fki->fk", np.roll(at_corner, -1, axis=1) - at_corner, to_next)
    weight = np.bincount(group.ravel(), np.repeat(own.facet_area, 3), count)
    mean = np.bincount(group.ravel(), np.repeat(own.facet_area * q.sum(axis=1) / 12, 3), count)
    return np.hstack([q, (mean / weight)[group]])


def _mirror(own, group, total):
    """Take what is across a mirror from the normals of the corners on it, in place."""
    for wall, m in enumerate(own.mirror_normal):
        facet, edge = np.nonzero(own.mirror == wall)
        at = np.unique(np.concatenate([group[facet, edge], group[facet, (edge + 1) % 3]]))
        total[at] -= np.outer(total[at] @ m, m)


def height(bulge, w):
    """Height of the surface over facets [m], shape (n,).

    Args:
        bulge: Of :func:`facet_bulges`, shape (n, 6).
        w: Barycentric coordinates, shape (n, 3) or (3,).
    """
    w = np.broadcast_to(w, (len(bulge), 3))
    return (bulge[:, :3] * w * np.roll(w, -1, axis=1)).sum(axis=1) - (bulge[:, 3:] * w).sum(axis=1)


def against_plane(bulge, area):
    """Length m of the contact law of facets against a plane [m], shape (num_facets,).

    XI h² √(κ₁κ₂) with the curvatures κ of the surface, 0 where it is not convex; see contact_law.h.

    Args:
        bulge: Of :func:`facet_bulges`.
        area: Of the facets [m²], shape (num_facets,).
    """
    ab, bc, ca = 2.0 * bulge[:, :3].T
    det = (ab * ca - 0.25 * (ab + ca - bc) ** 2) / (4.0 * area**2)
    convex = (det > 0.0) & (ab + ca > 0.0)
    return XI * 4.0 / np.sqrt(3.0) * area * np.sqrt(np.where(convex, det, 0.0))
