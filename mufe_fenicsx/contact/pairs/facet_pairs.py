"""Pairs of a point and another body: their search and what they remember."""

import numpy as np

from ...kernels.build.pair_rows import PAIR
from ...kernels.contact.pairs import PairForces, pair_energy
from ...kernels.contact.search import find_candidates, group_by_grain, sort_into_cells
from ...kernels.contact.self_contact import find_self_candidates
from ...kernels.contact.transfer import find_again, transfer_pairs
from ...kernels.geometry.boxes import box_around, mean_extent
from .motion_bounds import MotionBounds
from .table import PairTable


class Pairs(PairTable):
    """Pairs of points and bodies of one rank, found by :func:`search_pairs`.

    ``body`` is as of :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`. Points that meet a
    tool stand out along its normals, as at a wall: else their facets would pass its sharp edges
    before its sides feel them.
    """

    STATE = {"here": (*PairTable.STATE["here"], "candidate_next_check", "closest")}

    def __init__(
        self, node, body, first, candidate, points, num_grains, bound, yields, first_tool=None
    ):
        grain = body % num_grains
        bounds = MotionBounds(points.grain_of_point[node], grain, bound)
        super().__init__(PAIR, node, bounds, bound, yields)
        self.body, self.grain, self.first, self.candidate = body, grain, first, candidate
        # Single precision is enough for bounds, and these are most of what a search keeps.
        self.candidate_next_check = np.full(candidate.size, -np.inf, dtype=np.float32)
        self.closest = np.full(node.size, -1, dtype=np.int64)
        at_tool = grain >= (num_grains if first_tool is None else first_tool)
        stands = points.stands[node]
        self.stands[:] = np.where(at_tool, 0.0, stands)
        self.recess[:] = points.recess[node] - np.where(at_tool, stands, 0.0)
        PAIR.view(self.state, "node")[:] = node
        #: Numbers of the closest facets, -1 where not known, and of a facet of each body, once
        #: candidates are dropped.
        self.closest_facet = self.some_facet = None

    def bind(self, points, surface, ghosts, layers, friction, beside, grains, work):
        """Let the kernel know the arrays of new pairs; afterwards they stay where they are. Local.

        Args:
            points, surface, ghosts, layers, beside, work: As of kernels.contact.pairs.PairForces.
            friction: :class:`~mufe_fenicsx.contact.friction.FrictionTable`.
            grains: Global indices of this rank's grains.
        """
        own = points.grain_of_point[self.node], points.body_of_point[self.node]
        self.within[:] = (own[0] == self.grain) & (own[1] != self.body)
        self.friction_row = friction.rows(own[0], self.grain)
        self.name_dents(layers.strengths, points, self.grain)
        # With grains of other ranks: their forces travel while the others are found.
        early = ~np.isin(self.grain, grains)
        self.forces = PairForces(
            self, points, surface, ghosts, layers, beside, early, friction.coefficients, work
        )

    def deepest(self):
        """Depth of the deepest pair without its dent, 0 where all are apart [m]."""
        gap = self.gap - self.dent
        return -gap[np.isfinite(gap)].min(initial=0.0)

    def energy(self, points, left_out=None):
        """Energy in the springs [J] and number of closed pairs, as of Contact.energy."""
        closed = self.closed
        if left_out is not None:
            own = points.grain_of_point[self.node]
            closed = closed & ~(left_out[own] | left_out[self.grain])
        return pair_energy(self.state, closed)

    def areas(self, which, points, surface):
        """Parts of the contact area [m²] that the closed pairs ``which`` carry.

        Both sides of a contact carry points; their shares of it add up to one.
        """
        facet = self.candidate[self.closest[which]]
        layers = points.layer[self.node[which]] + surface.layer_of_facet[facet]
        return self.stiffness[which] * layers

    def drop_candidates(self, global_facet):
        """Keep of the candidates the closest ones alone, for :meth:`transfer` of the next search.

        They have most of the memory of a search, and their successors need it. Local.

        Args:
            global_facet: Numbers over all ranks of the facets of this search.
        """
        known = self.closest >= 0
        some = np.where(known, self.closest, self.first[:-1])
        self.some_facet = global_facet[self.candidate[some]]
        self.closest_facet = np.where(known, self.some_facet, -1)
        self.forces = self.candidate = self.candidate_next_check = self.first = self.closest = None

    def transfer(self, old, global_facet, wait):
        """Take over what ``old`` pairs remember. Local.

        Args:
            old: Pairs of the last search, without candidates by :meth:`drop_candidates`.
            global_facet: Numbers over all ranks of the facets now.
            wait: Motion from now on before which no facet beyond the reach of that search can be
                met [m].
        """
        self.motion_bounds.transfer(old.motion_bounds)
        bound = self.motion_bounds.now
        self.next_check[:] = bound
        source = transfer_pairs(old.node, old.body, self.node, self.body)
        new = np.flatnonzero(source >= 0)
        source = source[new]
        self.take_rows(new, old, source)
        self.known[new] = False
        for of_closest in (self.vertices, self.sharp, self.bulge):
            of_closest[new] = 0
        # A pair whose check was due may have closed by the motion since, and no other.
        self.next_check[new] = np.minimum(old.next_check[source], bound[new] + wait)
        known = old.closest_facet[source] >= 0
        new, source = new[known], source[known]
        facet = _find(global_facet, old.closest_facet[source])
        find_again(self.closest, new, facet, self.first, self.candidate)
        # What pairs may close in some time is asked for too: each needs a facet where it will.
        lost = self.closest < 0
        self.next_check[lost] = np.minimum(self.next_check[lost], bound[lost])


def _find(global_facet, wanted):
    """Local numbers of facets from their numbers over all ranks, -1 where absent."""
    order = np.argsort(global_facet, kind="stable")
    ordered = global_facet[order]
    place = np.minimum(np.searchsorted(ordered, wanted), max(ordered.size - 1, 0))
    return np.where(ordered[place] == wanted, order[place], -1)


def search_pairs(
    x, points, facets, surface, reach, bound, yields, self_contact, first_tool, num_grains
):
    """All pairs of own points with facets of other bodies within ``reach``. Local.

    The cost grows linearly with nodes and facets: a regular grid of cells about
    as large as a facet's box holds the points, and each facet looks into those
    that its own box, grown by ``reach``, covers.

    Args:
        x: Positions [m], points first, ghosts included.
        points: :class:`~mufe_fenicsx.contact.surface.points.Points`.
        facets: Vertices as rows of ``x``, shape (num_facets, 3).
        surface: :class:`~mufe_fenicsx.contact.surface.exchange.Surface`.
        reach: Distance of each facet [m], shape (num_facets,).
        bound: Of all relative motion so far [m].
        yields: Whether some body of all ranks can yield.
        self_contact: Whether grains meet themselves too.
        first_tool: Grains from this one on are tools, which do not meet each other; None: none is.
        num_grains: Of all ranks.
    """
    num_points, body_of_point = points.num_points, points.body_of_point
    stands = np.abs(points.stands)  # what points add to the reach
    extent = mean_extent(x, facets) if facets.size else 1.0
    low, high = box_around(x[:num_points])
    span = high - low
    # Cells no smaller than a facet with its reach, no more of them than points.
    farthest = reach + stands.max(initial=0.0)
    size = max(extent + farthest.mean(), np.cbrt(np.prod(span + extent) / max(num_points, 1)))
    shape = tuple((span / size).astype(np.int64) + 1)
    offset, nodes = sort_into_cells(x, num_points, low, size, shape)
    bodies = surface.body_of_facet
    alone = bodies.size and (bodies == bodies[0]).all() and (body_of_point == bodies[0]).all()
    first, candidate = find_candidates(
        x,
        body_of_point,
        facets[:0] if alone else facets,
        bodies,
        surface.use,
        reach,
        stands,
        low,
        size,
        shape,
        offset,
        nodes,
    )
    if self_contact:
        node, facet = find_self_candidates(
            x, body_of_point, surface.facets, bodies, surface.ring_offset,
            surface.ring, farthest, points.depth, surface.depth_of_facet, low, size, shape,
            offset, nodes,
        )  # fmt: skip
        node = np.concatenate([np.repeat(np.arange(num_points), np.diff(first)), node])
        candidate = np.concatenate([candidate, facet])
        order = np.lexsort((candidate, bodies[candidate], node))
        candidate = candidate[order]
        first = np.searchsorted(node[order], np.arange(num_points + 1))
    if first_tool is not None:
        node = np.repeat(np.arange(num_points), np.diff(first))
        own, other = points.grain_of_point[node], surface.grain_of_facet[candidate]
        meet = np.minimum(own, other) < first_tool
        candidate = candidate[meet]
        first = np.searchsorted(node[meet], np.arange(num_points + 1))
    grouped = group_by_grain(first, candidate, bodies)
    return Pairs(*grouped, candidate, points, num_grains, bound, yields, first_tool)
