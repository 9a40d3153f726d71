"""Surface nodes whose positions contact reads until its next search."""

import numpy as np


def near_nodes(contact):
    """Which own surface nodes the pairs of the last search depend on. Collective.

    Those of points with candidates, of the candidates with the facets around them, whose
    normals give the sign of the gap, and of crossing edges; here and on other ranks.

    Args:
        contact: :class:`~mufe_fenicsx.contact.assemble.Contact`; what is on its way in its
            vector of forces is lost.

    Returns:
        True for those, shape (num_own_surface_nodes,).
    """
    facets, corner = contact.surface.facets, contact.points.corner
    flag = np.zeros(contact.num_nodes_with_ghosts, dtype=bool)
    flag[facets[contact.pairs.candidate]] = True
    edges, crossing = contact.edges.edges, contact.edges.pairs
    used = np.concatenate([crossing.first, crossing.second])
    flag[edges.ends[used]] = True
    flag[edges.beyond[used]] = True
    flag[facets[flag[facets].any(axis=1)]] = True
    points = np.concatenate([contact.pairs.node, contact.walls.pairs.node])
    flag[points if corner is None else corner[points]] = True
    return contact.back_to_owners(np.repeat(flag[:, None], 3, axis=1).astype(float))[:, 0] > 0
