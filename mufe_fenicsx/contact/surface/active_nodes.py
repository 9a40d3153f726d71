"""Surface nodes whose positions contact reads until its next search, and those that it acts on."""

import numpy as np

from ...kernels.geometry.boxes import with_marked_vertex


def nodes_of_pairs(contact):
    """Surface nodes that pairs of this rank with facets and edges depend on, and act on. Local.

    They act on the vertices of candidates and the ends of crossing edges; they read the facets
    around those too, whose normals give the sign of the gap, and what lies beyond the edges.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.

    Returns:
        read, acted on: True for those, here or on other ranks, shape (num_nodes_with_ghosts,);
        points in pairs and what carries them are left out.
    """
    facets, acted_on = contact.surface.facets, np.zeros(contact.ghosts.num_nodes, dtype=bool)
    candidate = np.zeros(len(facets), dtype=bool)
    candidate[contact.pairs.candidate] = True
    acted_on[facets[candidate]] = True
    edges, crossing = contact.edges.edges, contact.edges.pairs
    used = np.concatenate([crossing.first, crossing.second])
    acted_on[edges.ends[used]] = True
    read = acted_on.copy()
    read[edges.beyond[used]] = True
    read[facets[with_marked_vertex(facets, read)]] = True
    return read, acted_on


def near_nodes(contact):
    """Which own surface nodes the pairs of the last search depend on, on any rank. Collective.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`; what is on its way in its
            vector of forces is lost.

    Returns:
        True for those, shape (num_own_surface_nodes,).
    """
    corner, (flag, _) = contact.points.corner, nodes_of_pairs(contact)
    points = np.concatenate([contact.pairs.node, contact.walls.pairs.node])
    flag[corner[points]] = True
    flags = np.repeat(flag[:, None], 3, axis=1).astype(float)
    return contact.ghosts.reverse_scatter(flags)[:, 0] > 0
