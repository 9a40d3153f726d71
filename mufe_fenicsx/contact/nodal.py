"""Contact at the surface nodes: pressure, shear traction, gap and slip."""

import numpy as np

from ..kernels.gaps import find_gaps
from .crossings import crossings_at_nodes


def nodal_contact(contact, num_nodes):
    """Fields at all nodes of this rank, those inside the grains included. Collective.

    Traction at a point of contact is its force over the area that it carries. A node takes
    what the points around it have on its own area, and its share of the forces on
    crossing edges that it ends, on either side. Slip of a node is the mean of the points
    around it, by area, with its share of that of its edges. What a point has from several
    neighbours is added, but the gap, which is that to the nearest.

    Args:
        contact: :class:`~mufe_fenicsx.contact.assemble.Contact`.
        num_nodes: Nodes of this rank.

    Returns:
        dict of arrays: ``contact_pressure`` [Pa], positive in compression, and
        ``contact_slip``, the way slipped so far [m], of shape (num_nodes,);
        ``contact_shear``, the friction on the grain [Pa], shape (num_nodes, 3); and
        ``contact_gap`` [m], shape (num_nodes,): positive where open, less the offset of
        what overlapped at the start, nan where nothing is near.
    """
    own, walls, points = contact.own, contact.walls, contact.points
    p, w = contact.pairs, walls.pairs
    at_points = np.zeros((points.num_points, 5))
    pressure, shear, slip = at_points[:, 0], at_points[:, 1:4], at_points[:, 4]
    slip[:] = contact.ledger.slip(p, w)
    gap = np.full(own.nodes.size, np.inf)
    for pairs, areas, distance in (
        (p, contact.areas, current_gaps(contact)[0]),
        (w, lambda on: points.area[w.node[on]], _to_walls(contact)),
    ):
        on = np.flatnonzero(pairs.closed)
        area = areas(on)
        np.add.at(pressure, pairs.node[on], pairs.push[on] / area)
        np.add.at(shear, pairs.node[on], pairs.shear[on] / area[:, None])
        for nodes in points.nodes_around(pairs.node):
            np.minimum.at(gap, nodes, distance - pairs.offset)
    at_points *= points.area[:, None]
    sums = points.to_nodes(at_points, own.nodes.size)
    force, friction, edge_slip, edge_depth = crossings_at_nodes(contact)
    around = points.to_nodes(points.area[:, None], own.nodes.size)[:, 0]
    at_nodes = np.zeros((num_nodes, 5))
    at_nodes[own.nodes, 0] = (sums[:, 0] + force) / own.area
    at_nodes[own.nodes, 1:4] = (sums[:, 1:4] + friction) / own.area[:, None]
    at_nodes[own.nodes, 4] = sums[:, 4] / around + edge_slip
    gap = np.where(edge_depth > 0, np.minimum(gap, -edge_depth), gap)
    gap[np.isinf(gap)] = np.nan
    all_gaps = np.full(num_nodes, np.nan)
    all_gaps[own.nodes] = gap
    return {
        "contact_pressure": at_nodes[:, 0],
        "contact_shear": at_nodes[:, 1:4],
        "contact_gap": all_gaps,
        "contact_slip": at_nodes[:, 4],
    }


def current_gaps(contact):
    """Gaps of all pairs of points and grains now [m], and their normals. Local.

    In the course of a test a pair that cannot close yet is not looked at. Positions are
    those of the last forces.
    """
    contact.place_points()
    p, s = contact.pairs, contact.surface
    gap, normal = np.empty(p.node.size), np.empty((p.node.size, 3))
    find_gaps(
        gap, normal, contact.positions.array, p.node, p.first, p.candidate, contact.facets,
        s.neighbor, contact.ring_offset, contact.ring,
    )  # fmt: skip
    return gap, normal


def _to_walls(contact):
    """Gaps of all pairs of points and walls now [m]. Local."""
    contact.place_points()
    w, walls = contact.walls.pairs, contact.walls
    apart = contact.positions.array[w.node] - walls.point[w.wall]
    return np.einsum("ij,ij->i", apart, walls.normal[w.wall])
