"""Pairs of sharp edges of two grains: their search and what they remember."""

import numpy as np

from ...kernels.build.pair_rows import EDGE_PAIR
from ...kernels.contact.edge_search import (
    edge_areas,
    find_edge_pairs,
    list_sharp_edges,
    sort_edges_into_cells,
)
from ...kernels.contact.edges import EdgeForces, edge_energy
from ...kernels.geometry.boxes import with_marked_vertex
from ...kernels.geometry.topology import rows_of
from ..laws import edge_of_area
from .table import RowTable


class EdgeContact:
    """Contact of crossing sharp edges, of which no vertex need be inside the other grain.

    A pair is an own edge and an edge of a grain of higher number: the rank of the lower
    grain evaluates it. Of two pieces of a grain the first edge is that listed first. Edges at less
    than ``PARALLEL`` (kernels/contact/crossing.h) to each other are left to nodes and facets, as
    are edges that are not sharp (``OwnSurface.sharp_edge``).

    The stiffness of a crossing is that of a node at its place on a facet, of the finer edge:
    k = A/2 / (c h/E* + c h/E*), A the mean area of the nodes at the edge's ends. Near a
    corner of k sharp edges it falls to a k-th, for several of them can cross there at once.

    Args:
        ratio: Tangential over normal stiffness of own surface nodes, shape (num_nodes,).
        recess: Depth at which the contact of edges begins, over their length.
        friction: :class:`~mufe_fenicsx.contact.friction.FrictionTable`.
        first_tool: Grains from this one on are tools, which do not meet each other; None: none is.
        origin: Nodes of the start that own surface nodes are parts of, of a mesh that has grown.
            Edges of two pieces that end at parts of a node do not meet: they lie on each other
            from the start, and points hold what is beside them. None: none has parted.
    """

    def __init__(self, ratio, recess, friction, first_tool=None, origin=None):
        self.ratio_of_node, self.recess, self.friction = ratio, recess, friction
        self.first_tool, self.origin = first_tool, origin
        self.slip = np.zeros(ratio.size)  #: of own nodes in crossings, up to the last search [m]
        self.edges = None
        self.pairs = None
        #: While pairs are searched, those of before and their :meth:`keys`.
        self.past = None

    def deepest(self):
        """Depth of the deepest closed pair [m]; local."""
        if self.pairs is None or not self.pairs.closed.any():
            return 0.0
        return -self.pairs.gap[self.pairs.closed].min()

    def search(self, x, num_own, surface, reach, bound):
        """Find all pairs within ``reach``, keep closed ones, transfer what all remember. Local.

        Args:
            x: Positions [m], ghosts included, shape (num_nodes_with_ghosts, 3).
            num_own: Number of own nodes.
            surface: :class:`~mufe_fenicsx.contact.surface.exchange.Surface`.
            reach: Distance [m].
            bound: Of all relative motion so far [m].
        """
        self.list_edges(num_own, surface)
        first, second = _search(x, self.edges, reach)
        if self.past is not None:
            first, second = self._with_closed(first, second)
        if self.first_tool is not None:  # the second is that of the higher number
            meet = self.edges.grain[first] < self.first_tool
            first, second = first[meet], second[meet]
        if self.origin is not None:
            apart = ~self._part_of_one_node(first, second)
            first, second = first[apart], second[apart]
        self.set_pairs(first, second, bound)
        if self.past is not None:
            self._transfer(*self.past)
            self.past = None

    def _with_closed(self, first, second):
        """The same pairs, and closed ones of before that are deeper, increasing."""
        old, keys = self.past
        keys, order = keys[old.closed], np.argsort(self.edges.key)
        at = [rows_of(self.edges.key[order], of) for of in (keys >> 31, keys & (1 << 31) - 1)]
        there = (at[0] >= 0) & (at[1] >= 0)
        num = self.edges.key.size
        found = first * np.int64(num) + second
        kept = order[at[0][there]] * num + order[at[1][there]]
        deeper = kept[rows_of(found, kept) < 0]
        return np.divmod(np.sort(np.concatenate([found, deeper])), max(num, 1))

    def _part_of_one_node(self, first, second):
        """Whether edges of two pieces of a grain end at parts of a node, shape (num_pairs,)."""
        e, found = self.edges, np.zeros(first.size, dtype=bool)
        pieces = np.flatnonzero(e.grain[first] == e.grain[second])
        one, other = (self.origin[e.ends[of[pieces]]] for of in (first, second))
        found[pieces] = (one[:, :, None] == other[:, None, :]).any(axis=(1, 2))
        return found

    def put_away(self):
        """Keep the pairs by their names, for the next search. Local."""
        self.past = self.pairs, self.keys(self.edges.key)

    def list_edges(self, num_own, surface):
        """Find the sharp edges, arguments as of :meth:`search`. Local."""
        self.edges = _Edges(num_own, surface, self.ratio_of_node)
        sharp = np.zeros(surface.ring_offset.size - 1, dtype=bool)
        sharp[self.edges.ends] = True
        self.beside = with_marked_vertex(surface.facets, sharp)

    def set_pairs(self, first, second, bound):
        """Make the pairs those of the edges ``first`` and ``second``, without any past. Local."""
        self.pairs = EdgePairs(first, second, self.edges, self.recess, bound, self.friction)

    def keys(self, key):
        """Numbers that name the pairs, shape (num_pairs,), by those of the edges. Local."""
        return (key[self.pairs.first] << 31) | key[self.pairs.second]

    def _transfer(self, old, old_keys):
        new = self.pairs
        _, at_old, at_new = np.intersect1d(
            old_keys, self.keys(self.edges.key), True, return_indices=True
        )
        for name in new.row.kept:
            getattr(new, name)[at_new] = getattr(old, name)[at_old]
        new.slip[:] = new.work[:] = 0.0  # they are booked
        # What waited, but is looked at again, may not have moved further since.
        new.next_check[at_new] = np.minimum(new.next_check[at_new], old.next_check[at_old])

    def bind(self, ghosts):
        """Let the kernel know the arrays of new pairs; afterwards they stay where they are. Local.

        Args:
            ghosts: :class:`~mufe_fenicsx.contact.surface.ghosts.Ghosts`.
        """
        coefficients = self.friction.coefficients
        x, f = (of.array[ghosts.num_before :] for of in (ghosts.positions, ghosts.forces))
        self.pairs.forces = EdgeForces(self.pairs, self.edges, coefficients, x, f)

    def springs(self, margin, bound):
        """Springs of closed pairs and of those that a motion of ``margin`` [m] can close. Local.

        Returns:
            Nodes, shares and normals as of kernels.contact.springs.add_springs, with four nodes
            each; stiffness along and across [N/m].
        """
        p, e = self.pairs, self.edges
        on, kn = p.forces.springs(margin, bound)
        s, t = np.clip(p.place[on], 0.0, 1.0).T
        nodes = np.concatenate([e.ends[p.first[on]], e.ends[p.second[on]]], axis=1)
        return nodes, np.stack([1 - s, s, t - 1, -t], axis=1), p.normal[on], kn, kn * p.ratio[on]

    def energy(self, left_out=None):
        """Energy in the springs [J] and number of closed pairs, as of Contact.energy. Local."""
        p, closed = self.pairs, self.pairs.closed
        if left_out is not None:
            closed = closed & ~(left_out[p.grain] | left_out[p.partner])
        return edge_energy(p.state, closed)

    def closed_grains(self):
        """Both grains of each closed pair, shape (num_closed, 2). Local."""
        p = self.pairs
        return np.column_stack([p.grain[p.closed], p.partner[p.closed]])


class _Edges:
    """Sharp edges of a surface, own edges first. Arrays as in kernels.contact.edges."""

    def __init__(self, num_own, surface, ratio_of_node):
        s = surface
        # Those of facets that only complete a ring too: they count at the corners of others.
        self.ends, self.beyond, sides, self.key = list_sharp_edges(
            s.facets, s.neighbour, s.global_facet, s.sharp_edge
        )
        self.num_own = int(np.count_nonzero(self.ends[:, 0] < num_own))
        self.grain, self.body = s.grain_of_facet[sides[:, 0]], s.body_of_facet[sides[:, 0]]
        self.area = np.empty(self.grain.size)
        edge_areas(self.area, self.ends, s.area_of_facet, s.ring_offset, s.ring)
        self.length = edge_of_area(self.area, 2)  #: of an even mesh [m]
        self.can_meet = s.use[sides].any(axis=1)
        self.layer = s.layer_of_facet[sides].mean(axis=1)
        self.compliance = s.compliance_of_edge[sides[:, 0], self.key % 3]
        self.depth = s.depth_of_facet[sides].mean(axis=1)
        # An edge that goes on beyond its end counts in full, one of k at a corner for 1/k.
        count = np.bincount(self.ends.ravel(), minlength=1)[self.ends]
        self.share = np.where(count > 2, 1.0 / count, 1.0)
        self.ratio = ratio_of_node[self.ends[: self.num_own, 0]]


class EdgePairs(RowTable):
    """Pairs of edges of one rank. Arrays as in kernels.contact.edges."""

    def __init__(self, first, second, edges, recess, bound, friction):
        super().__init__(EDGE_PAIR, first.size, bound)
        self.first[:], self.second[:] = first, second
        self.grain, self.partner = edges.grain[first], edges.grain[second]
        rows = friction.rows(self.grain, self.partner)
        if rows.size:  # else all have the first ones
            self.friction[:] = rows
        self.size[:] = 0.5 * (edges.length[first] + edges.length[second])
        self.largest_depth[:] = edges.depth[first] + edges.depth[second]
        self.recess[:] = recess * self.size
        self.ratio[:] = edges.ratio[first]
        self.outside[:], self.place[:] = np.inf, 0.5


def edge_compliances(own, x, of_mesh, known=None):
    """Relative compliance of the ends of sharp edges [m/N], shape (num_facets, 3). Local.

    It is along the bisector of both facets' normals, and stands in the facet of the lower number.

    Args:
        own: :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        x: Reference positions of the mesh's nodes [m], shape (num_nodes, 3).
        of_mesh: Called as :meth:`~mufe_fenicsx.bulk.solid.Solid.edge_compliance`; None: zeros.
        known: What is known of it, nan elsewhere, shape (num_facets, 3); None: nothing is.
    """
    if of_mesh is None or not own.sharp_edge.any():
        return np.broadcast_to(0.0, own.sharp_edge.shape)
    numbers = np.arange(len(own.facets))
    ends, _, sides, key = list_sharp_edges(own.facets, own.neighbour, numbers, own.sharp_edge)
    found = np.zeros(own.sharp_edge.shape)
    if known is not None:
        found.ravel()[key] = known.ravel()[key]
        unknown = np.isnan(known.ravel()[key])
        ends, sides, key = ends[unknown], sides[unknown], key[unknown]
    a, b, c = np.moveaxis(x[own.nodes[own.facets[sides]]], 2, 0)
    normal = np.cross(b - a, c - a)
    bisector = (normal / np.linalg.norm(normal, axis=2, keepdims=True)).sum(axis=1)
    bisector /= np.linalg.norm(bisector, axis=1, keepdims=True)
    found.ravel()[key] = of_mesh(own.nodes[ends], bisector)
    return found


def _search(x, edges, reach):
    """All pairs of edges within ``reach``; the cost grows linearly with their number. Local.

    Returns:
        First and second edge of each pair, in increasing order.
    """
    some = np.flatnonzero(edges.can_meet).astype(np.int32)
    num_own = int(np.searchsorted(some, edges.num_own))
    if not num_own:
        return np.empty((2, 0), np.int32)
    ends = edges.ends[some]
    a, b = np.moveaxis(x[ends[:num_own]], 1, 0)
    low, high = np.minimum(a, b).min(axis=0), np.maximum(a, b).max(axis=0)
    extent = np.abs(b - a).max(axis=1).mean()
    # Cells no smaller than an edge with its reach, no more of them than edges.
    size = max(extent + reach, np.cbrt(np.prod(high - low + extent) / num_own))
    shape = tuple(((high - low) / size).astype(np.int64) + 1)
    cells = sort_edges_into_cells(x, ends, num_own, low, size, shape)
    first, second = find_edge_pairs(
        x, ends, edges.grain[some], edges.body[some], num_own, reach, low, size, shape, *cells
    )
    # As cells have them, the order of sums would hang on where other grains are.
    order = np.lexsort((second, first))
    return some[first[order]], some[second[order]]
