"""Contact at the surface nodes: pressure, shear traction, gap and slip."""

import numpy as np

from ..kernels.gaps import find_gaps


def nodal_contact(contact, num_nodes):
    """Fields at all nodes of this rank, those inside the grains included. Local.

    Where two grains touch, each carries half of the force on its own nodes: traction is
    force over half of the nodal area (all of it on a wall). What a node has from
    several neighbours is added, but the gap, which is that to the nearest.

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
    own, walls = contact.own, contact.walls
    p, w = contact.pairs, walls.pairs
    pressure, shear = np.zeros(num_nodes), np.zeros((num_nodes, 3))
    gap, slip = np.full(num_nodes, np.inf), np.zeros(num_nodes)
    slip[own.nodes] = contact.ledger.slip(p, w)
    for pairs, share, distance in (
        (p, 0.5, current_gaps(contact)[0]),
        (w, 1.0, _to_walls(contact)),
    ):
        on = np.flatnonzero(pairs.closed)
        node, area = own.nodes[pairs.node[on]], share * own.area[pairs.node[on]]
        np.add.at(pressure, node, pairs.push[on] / area)
        np.add.at(shear, node, pairs.shear[on] / area[:, None])
        np.minimum.at(gap, own.nodes[pairs.node], distance - pairs.offset)
    gap[np.isinf(gap)] = np.nan
    return {
        "contact_pressure": pressure,
        "contact_shear": shear,
        "contact_gap": gap,
        "contact_slip": slip,
    }


def current_gaps(contact):
    """Gaps of all pairs of nodes and grains now [m], and their normals. Local.

    In the course of a test a pair that cannot close yet is not looked at. Positions are
    those of the last forces.
    """
    p, s = contact.pairs, contact.surface
    gap, normal = np.empty(p.node.size), np.empty((p.node.size, 3))
    find_gaps(
        gap, normal, contact.positions.array, p.node, p.first, p.candidate, s.facets, s.neighbor,
        s.ring_offset, s.ring,
    )  # fmt: skip
    return gap, normal


def _to_walls(contact):
    """Gaps of all pairs of nodes and walls now [m]. Local."""
    w, walls = contact.walls.pairs, contact.walls
    apart = contact.positions.array[w.node] - walls.point[w.wall]
    return np.einsum("ij,ij->i", apart, walls.normal[w.wall])
