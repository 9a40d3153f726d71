"""How stiff the springs of contact hold the nodes of a surface."""

import numpy as np


def spring_bounds(contact, margin):
    """Bounds of the contact springs at own surface nodes [N/m], shape (num_nodes,). Collective.

    The sum over all springs of stiffness times the absolute values of their row (Gershgorin), for
    pairs that are closed or within ``margin`` [m]: the highest frequency of springs alone is at
    most the root of the largest bound over mass. What is on its way in contact's forces is lost.
    """
    points, pairs, walls = contact.points, contact.pairs, contact.walls.pairs
    at_points = np.zeros(points.num_points)
    at_nodes = np.zeros((contact.num_nodes_with_ghosts, 3))
    on = pairs.closed | (pairs.due - contact.clock < margin)
    on &= pairs.closest >= 0
    facet = pairs.candidate[pairs.closest[on]]
    node = pairs.node[on]
    # An open pair closes with at most its whole area.
    layer = contact.layer[node] + contact.surface.layer_of_facet[facet]
    stiffness = np.where(pairs.closed[on], pairs.stiffness[on], points.area[node] / layer)
    # Both ends of a pair move: each row sums up to twice the stiffness times the node's share.
    np.add.at(at_points, node, 2.0 * stiffness)
    corners = contact.surface.facets[facet]
    for i in range(3):
        np.add.at(at_nodes[:, 0], corners[:, i], 2.0 * stiffness * pairs.weights[on, i])
    on = walls.closed | (walls.due - contact.clock < margin)
    node = walls.node[on]
    np.add.at(at_points, node, points.area[node] / contact.layer[node])
    contact.edges.add_bounds(at_nodes, margin, contact.clock)
    own = points.to_nodes(at_points[:, None], contact.own.nodes.size)[:, 0]
    return own + contact.back_to_owners(at_nodes)[:, 0]
