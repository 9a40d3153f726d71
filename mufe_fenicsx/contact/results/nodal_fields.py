"""Contact at the surface nodes: pressure, shear traction, gap and slip."""

import numpy as np

from ...kernels.contact.gaps import find_gaps
from .edge_contacts import crossings_at_nodes

#: Pairs whose gaps are found at a time: those of all of them need as much room as the state.
BLOCK = 1 << 17


def nodal_contact(contact, num_nodes):
    """Fields at all nodes of this rank, those inside the grains included. Collective.

    Traction at a point of contact is its force over the area that it carries. A node takes
    what the points around it have on its own area, and its share of the forces on
    crossing edges that it ends, on either side. Slip of a node is the mean of the points
    around it, by area, with its share of that of its edges. What a point has from several
    neighbours is added, but the gap, which is that to the nearest.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        num_nodes: Nodes of this rank.

    Returns:
        dict of arrays: ``contact_pressure`` [Pa], positive in compression, and
        ``contact_slip``, the way slipped so far [m], of shape (num_nodes,);
        ``contact_shear``, the friction on the grain [Pa], shape (num_nodes, 3); and
        ``contact_gap`` [m], shape (num_nodes,): positive where open, less the offset of
        what overlapped at the start, nan where nothing is near.
    """
    own, points = contact.own, contact.points
    p, w = contact.pairs, contact.walls.pairs
    sides = []  # closed pairs with grains and with walls, and the areas that they carry
    for pairs, areas in ((p, contact.areas), (w, lambda on: points.area[w.node[on]])):
        on = np.flatnonzero(pairs.closed)
        sides.append((pairs, on, areas(on)))

    def of_points(values):
        """Sums at own surface nodes of values at points times their areas."""
        return points.to_nodes((values * points.area)[:, None], own.nodes.size)[:, 0]

    def of_pairs(part):
        values = np.zeros(points.num_points)
        for pairs, on, area in sides:
            np.add.at(values, pairs.node[on], part(pairs)[on] / area)
        return of_points(values)

    # One after another, for each needs room at all points.
    force, friction, edge_slip, edge_depth = crossings_at_nodes(contact)
    force += of_pairs(lambda pairs: pairs.normal_force)
    for k in range(3):
        friction[:, k] += of_pairs(lambda pairs, k=k: pairs.shear[:, k])
    edge_slip += of_points(contact.dissipation.slip(p, w)) / of_points(np.ones(points.num_points))
    gap = _nearest(contact)
    gap = np.where(edge_depth > 0, np.minimum(gap, -edge_depth), gap)
    gap[np.isinf(gap)] = np.nan

    def everywhere(values, elsewhere=0.0):
        found = np.full((num_nodes, *values.shape[1:]), elsewhere)
        found[own.nodes] = values
        return found

    return {
        "contact_pressure": everywhere(force / own.area),
        "contact_shear": everywhere(friction / own.area[:, None]),
        "contact_gap": everywhere(gap, np.nan),
        "contact_slip": everywhere(edge_slip),
    }


def _nearest(contact):
    """Gaps of own surface nodes to what is nearest to the points around them [m], inf for none."""
    points, p, walls = contact.points, contact.pairs, contact.walls
    w, gap = walls.pairs, np.full(contact.own.nodes.size, np.inf)
    contact.bind()
    contact.ghosts.place_points()

    def take(pairs, some, distance):
        for nodes in points.corner[pairs.node[some]].T:
            np.minimum.at(gap, nodes, distance - pairs.offset[some])

    for begin in range(0, p.node.size, BLOCK):
        some = slice(begin, begin + BLOCK)
        take(p, some, _gaps(contact, some)[0])
    take(w, slice(None), walls.gaps_of_pairs(contact.ghosts.positions.array))
    return gap


def current_gaps(contact):
    """Gaps of all pairs of points and grains now [m], and their normals. Local.

    In the course of a test a pair that cannot close yet is not looked at. Positions are
    those of the last forces.
    """
    contact.ghosts.place_points()
    return _gaps(contact, slice(0, contact.pairs.node.size))


def _gaps(contact, some):
    p, s, g = contact.pairs, contact.surface, contact.ghosts
    node, first = p.node[some], p.first[some.start : some.stop + 1]
    gap, normal = np.empty(node.size), np.empty((node.size, 3))
    points, stands = contact.points, p.stands[some]
    place = points.stand(g.positions.array[g.num_before :], node, stands)
    find_gaps(
        gap, normal, place, g.positions.array, first, p.candidate, g.facets, s.bulge_of_facet,
        s.neighbour, g.ring_offset, g.ring,
    )  # fmt: skip
    return gap + points.recess[node] - (points.stands[node] - stands), normal
