"""What contact remembers, on the surface of a mesh that has grown.

Growth numbers surface nodes anew and adds facets; sides of cells that were facets before still are.
So points and facets of before get their new numbers, by which the next search finds the pairs again
as it does after any other search. Facets that opened remember nothing. A vertex at the front of a
crack is sharp until this goes on: what it remembers is lost where it carries no contact any more.
"""

import numpy as np

from ..kernels.build.pair_rows import PAIR
from ..kernels.geometry.topology import rows_of
from .search import put_away
from .stiffness.layers import DENTS


def carry_contact(old, new, source):
    """Make the contact of a grown mesh remember what that of the mesh before does. Collective.

    Its pairs are those for its next search to find again.

    Args:
        old: :class:`~mufe_fenicsx.contact.contact.Contact` before; of no use afterwards.
        new: That of after, which has what steps change beside pairs and points already.
        source: :class:`~mufe_fenicsx.mesh.Source` of the mesh after.
    """
    put_away(old)
    numbers, done, edges = _Numbers(old, new, source), old.dissipation, old.edges
    done.close(old.pairs, old.walls.pairs, edges.pairs)
    for name in ("grain", "partner", "work"):
        setattr(new.dissipation, name, getattr(done, name))
    here = np.flatnonzero(numbers.point >= 0)
    there = numbers.point[here]
    new.dissipation.slip_of_dropped[there] = done.slip_of_dropped[here]
    for name in DENTS:
        getattr(new.layers, name)[there] = getattr(old.layers, name)[here]
    new.edges.slip[:] = np.where(numbers.old_node < 0, 0.0, edges.slip[numbers.old_node])
    _renumber_pairs(old.pairs, numbers, done.num_grains)
    _renumber_wall_pairs(old.walls.pairs, numbers)
    new.pairs, new.walls.pairs = old.pairs, old.walls.pairs
    facet, place = np.divmod(edges.edges.key, 3)
    new.edges.pairs = edges.pairs
    new.edges.past = edges.pairs, edges.keys(3 * numbers.of_facets(facet) + place)


class _Numbers:
    """New numbers of what was on a surface before it grew. Collective.

    Args:
        old, new, source: As of :func:`carry_contact`.

    Attributes:
        point: Of old points of contact, -1 where they are none any more, shape (num_old_points,).
        old_node: Own surface node that each is a part of, -1 of one from inside, (num_nodes,).
        bodies: Facets of all ranks whose bodies have new numbers, by their new numbers, increasing,
            and these bodies, each of shape (num_changed,).
    """

    def __init__(self, old, new, source):
        before, now, first = old.own, new.own, int(old.surface.global_facet[0])
        facet = np.searchsorted(now.side, before.side)
        inside = now.side[rows_of(before.side, now.side) < 0]
        places = old.comm.allgather(first + np.searchsorted(before.side, inside))
        self._places = np.concatenate(places)  # old facets of all ranks that new ones come before
        changed = np.flatnonzero(now.body_of_facet[facet] != before.body_of_facet)
        bodies = self.of_facets(first + changed), now.body_of_facet[facet[changed]]
        bodies = zip(*old.comm.allgather(bodies), strict=True)
        self.bodies = tuple(np.concatenate(part) for part in bodies)
        row = np.full(source.nodes.max() + 1, -1)
        row[before.nodes] = np.arange(before.nodes.size)
        self.old_node = row[source.nodes[now.nodes]]
        keeps_name = np.empty(row.size, dtype=np.int64)
        keeps_name[source.nodes[::-1]] = np.arange(source.nodes.size)[::-1]
        vertices, num = new.points.corner[new.points.num_in_facets :, 0], len(old.points.rule)
        place = np.full(source.nodes.size, -1)
        place[now.nodes[vertices]] = new.points.num_in_facets + np.arange(vertices.size)
        at_node = before.nodes[old.points.corner[old.points.num_in_facets :, 0]]
        in_facets = (num * facet[:, None] + np.arange(num)).ravel()
        self.point = np.concatenate([in_facets, place[keeps_name[at_node]]])

    def of_facets(self, facets):
        """New numbers over all ranks of facets from their old ones. Local."""
        return facets + np.searchsorted(self._places, facets, side="right")


def _renumber_pairs(pairs, numbers, num_grains):
    """Give pairs of points and bodies the numbers of now. Local."""
    facet, (changed, bodies) = numbers.of_facets(pairs.some_facet), numbers.bodies
    # That of the closest facet: where a body has parted since others may be of another one.
    row = rows_of(changed, facet)
    pairs.body[row >= 0] = bodies[row[row >= 0]]
    node = numbers.point[pairs.node]
    rows = np.flatnonzero(node >= 0)
    rows = rows[np.lexsort((pairs.body[rows], node[rows]))]
    pairs.go_on(rows, node[rows])
    PAIR.view(pairs.state, "node")[:] = pairs.node
    pairs.body = pairs.body[rows]
    pairs.grain = pairs.body % num_grains
    pairs.closest_facet = np.where(pairs.closest_facet >= 0, facet, -1)[rows]


def _renumber_wall_pairs(pairs, numbers):
    """Give pairs of points and walls the numbers of now. Local."""
    node = numbers.point[pairs.node]
    rows = np.flatnonzero(node >= 0)
    pairs.go_on(rows, node[rows])
    pairs.wall = pairs.wall[rows]


def beside(contact, nodes):
    """Which pairs of this rank, closed or near, have to do with some nodes. Collective.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        nodes: Whether each node of this rank is one of them, shape (num_nodes,).

    Returns:
        Flags of pairs of points with bodies, with walls, and of edges, each of shape (num_pairs,).
    """
    p, points, edges = contact.pairs, contact.points, contact.edges
    flags = contact.ghosts.scratch_vector()
    flags.own[:, 0] = nodes[contact.own.nodes]
    flags.forward()
    flagged = flags.array[contact.ghosts.num_before :, 0] > 0.0
    flags.array[:] = 0.0
    near = flagged[contact.surface.facets].any(axis=1)[p.candidate]
    at_point = flagged[points.corner].any(axis=1)
    at_edge = flagged[edges.edges.ends].any(axis=1)
    of_pairs = at_point[p.node]
    if of_pairs.size:
        of_pairs |= np.logical_or.reduceat(near, p.first[:-1])
    ends = at_edge[edges.pairs.first] | at_edge[edges.pairs.second]
    return of_pairs, at_point[contact.walls.pairs.node], ends
