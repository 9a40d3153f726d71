"""Surfaces that overlap in the image are parted, and small gaps closed, without strain.

Both come before the reference configuration is fixed, so no stress and no energy belong to
them. A voxel image shows grains that touch or interlock as overlaps and gaps of its own
resolution; where gaps are closed, neighbours meet in extended, flat contacts, as those of the
interlocked sand of Fonseca et al. (2012).
"""

from dataclasses import asdict, dataclass

import numpy as np
from mpi4py import MPI

from ..errors import InputError
from .contact import Contact
from .laws import edge_of_area
from .results.nodal_fields import current_gaps
from .settings import ContactGrains, ContactSettings
from .start.reference import extend, kept_in_cylinder, set_reference, volumes
from .walls import Walls

#: An overlap, or what remains of a gap, below this many edges at the node counts as none.
TOLERANCE = 1e-3
#: Nodes nearer than this many edges to a neighbour count for the contact area.
TOUCHING = 1e-2
#: Gaps up to this many times the distance that is closed are narrowed, the less the wider.
TAPER = 2.0
#: Cosine between the way to a neighbour and the outward normal of that facet around the node
#: that faces it best: below the first a gap stays, above the second it closes.
FACING = 0.5, 0.8


@dataclass(frozen=True)
class Separation:
    """What was moved, over all ranks."""

    overlap_nodes: int  #: nodes inside another grain before
    max_depth: float  #: deepest of them [m]
    remaining_nodes: int  #: nodes still deeper than the tolerance after
    remaining_depth: float  #: deepest of them [m]; it becomes the offset of that gap
    max_shift: float  #: largest shift of a node [m]
    volume_change: float  #: relative change of the volume of all grains [-]
    smallest_volume: float  #: of an element over that before [-]
    close_gaps: float  #: gaps up to this distance were to be closed [m]
    gap_nodes: int  #: nodes that faced another grain within that distance
    remaining_gap_nodes: int  #: of these, nodes still not touching after
    contact_area_before: float  #: of nodes that touch another grain, each side half [m²]
    contact_area: float  #: the same after
    num_sweeps: int  #: searches it took

    def as_dict(self):
        """The numbers by the names of the fields."""
        return asdict(self)


def separate(mesh, max_shift, close_gaps=0.0, close_gaps_over_h=0.0, max_sweeps=15):
    """Move the nodes of ``mesh`` until surfaces neither overlap nor miss each other. Collective.

    A surface node at depth d moves by d/2 along the normal of the surface that it is behind;
    the other surface does the same. Likewise a node that faces another grain across a gap g no
    wider than G = ``close_gaps`` moves by g/2 towards it; between G and 2 G the move falls
    smoothly to nothing. Interior nodes follow by a harmonic extension. The reference
    configuration, ``mesh.x`` and the geometry of the DOLFINx mesh, is changed in place.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        max_shift: Largest shift of a node, in edges of the facets around it.
        close_gaps: Gaps to close [m], none if 0.
        close_gaps_over_h: The same in mean facet edges; one of both is 0.
        max_sweeps: Searches at most; where gaps are closed, again as many, which only undo
            what went too far.

    Returns:
        :class:`Separation`.

    Raises:
        InputError: The gaps to close are wider than ``max_shift`` allows; on all ranks.
    """
    first = mesh.x.copy()
    x, shift = first, np.zeros_like(first)
    before = gaps = _Gaps(mesh, x)
    close_gaps = close_gaps or close_gaps_over_h * before.edge
    if close_gaps > 2 * max_shift * before.edge:
        raise InputError(
            f"sample.close_gaps = {close_gaps:.3g} m, expected at most {2 * max_shift:g} of the "
            f"mean edge of facets, {before.edge:.3g} m: each side moves by no more than half of it"
        )
    wanted = _Wanted(before, close_gaps)
    limit = max_shift * before.edge_at_node
    limit[mesh.is_tool[mesh.grain_of_node]] = 0.0
    last = max_sweeps if close_gaps == 0 else 2 * max_sweeps
    for sweep in range(last + 1):
        move = wanted.moves(gaps, narrow=sweep < max_sweeps)
        if not mesh.comm.allreduce(np.count_nonzero(move)) or sweep == last:
            break
        # A node inside two grains moves out of both.
        np.add.at(shift, gaps.nodes, move[:, None] * gaps.normal)
        length = np.linalg.norm(shift, axis=1)
        shift *= np.minimum(1.0, limit / np.maximum(length, 1e-300))[:, None]
        x = first + shift
        gaps = _Gaps(mesh, x)
    after = before
    if sweep:
        x = kept_in_cylinder(mesh, first, extend(mesh, first, shift))
        after = _Gaps(mesh, x)
        set_reference(mesh, x)
    comm = mesh.comm
    v0, v = volumes(mesh, first), volumes(mesh, x)
    moved = np.linalg.norm(x - first, axis=1).max(initial=0.0)
    overlap_nodes, max_depth = before.overlaps()
    remaining_nodes, remaining_depth = after.overlaps()
    return Separation(
        overlap_nodes=overlap_nodes,
        max_depth=max_depth,
        remaining_nodes=remaining_nodes,
        remaining_depth=remaining_depth,
        max_shift=float(comm.allreduce(moved, op=MPI.MAX)),
        volume_change=float(comm.allreduce(v.sum()) / comm.allreduce(v0.sum()) - 1),
        smallest_volume=float(comm.allreduce((v / v0).min(initial=1.0), op=MPI.MIN)),
        close_gaps=float(close_gaps),
        gap_nodes=wanted.count(before),
        remaining_gap_nodes=wanted.count(after),
        contact_area_before=wanted.contact_area(before),
        contact_area=wanted.contact_area(after),
        num_sweeps=sweep,
    )


class _Gaps:
    """Gaps between the surfaces of all grains at positions ``x``. Collective."""

    def __init__(self, mesh, x):
        one = np.ones(mesh.num_grains)
        settings = ContactSettings(compliance=1.0, points="nodes")
        contact = Contact(mesh, x, Walls([]), ContactGrains(one, one), settings)
        self.gap, self.normal = current_gaps(contact)
        contact.destroy()
        pairs, own = contact.pairs, contact.own
        self.comm, self.edge = mesh.comm, contact.edge
        edge = edge_of_area(own.whole_area, 2)
        self.nodes, self.h = own.nodes[pairs.node], edge[pairs.node]
        #: Of the facets around each node of the mesh that is on the surface [m], (num_nodes,).
        self.edge_at_node = np.zeros(mesh.num_nodes)
        self.edge_at_node[own.nodes] = edge
        #: A number for each pair of a node and another grain, increasing.
        self.key = pairs.node.astype(np.int64) * mesh.labels.size + pairs.grain
        self._look(contact, pairs)

    def _look(self, contact, pairs):
        """How the facets around each node face the other grain."""
        surface = contact.surface
        a, b, c = (contact.ghosts.positions.array[surface.facets[:, i]] for i in range(3))
        normal = 0.5 * np.cross(b - a, c - a)
        offset, node = surface.ring_offset, pairs.node
        count = np.diff(offset)[node]
        first = np.cumsum(count) - count
        place = np.repeat(offset[node] - first, count) + np.arange(count.sum())
        area = normal[surface.ring[place]]
        along = -np.einsum("ij,ij->i", area, np.repeat(self.normal, count, axis=0))
        #: Cosine between the way to the other grain and the best facet's outward normal.
        self.facing = _reduce(np.maximum, along / np.linalg.norm(area, axis=1), first)
        #: Nodal area as the other grain sees it [m²].
        self.area = _reduce(np.add, along / 3, first)

    def overlaps(self):
        """Nodes inside another grain beyond the tolerance, and the deepest [m]. Collective."""
        count = np.count_nonzero(self.gap < -TOLERANCE * self.h)
        deepest = self.comm.allreduce(abs(self.gap.min(initial=0.0)), op=MPI.MAX)
        return int(self.comm.allreduce(count)), float(deepest)


class _Wanted:
    """The gap that each pair of a node and another grain shall have, from those at first."""

    def __init__(self, gaps, distance):
        self.key, self.area, self.facing = gaps.key, gaps.area, gaps.facing
        g = np.maximum(gaps.gap, 0.0)
        weight = np.zeros(g.size)
        if distance > 0:
            weight = 1.0 - _smooth_step((g / distance - 1.0) / (TAPER - 1.0))
            weight *= _smooth_step((gaps.facing - FACING[0]) / (FACING[1] - FACING[0]))
        self.gap = np.where(weight > 0, g * (1.0 - weight), np.inf)
        #: Pairs whose gap shall vanish.
        self.closing = (weight == 1.0) & (g > TOLERANCE * gaps.h)

    def _of(self, gaps):
        """For each pair of ``gaps`` its place among those at first, and whether it has one."""
        place = np.minimum(np.searchsorted(self.key, gaps.key), max(self.key.size - 1, 0))
        return place, (self.key[place] == gaps.key if self.key.size else gaps.key < 0)

    def moves(self, gaps, narrow):
        """How far each pair's node has to move along the normal [m], shape (num_pairs,).

        Out of overlaps, and, where ``narrow``, into gaps.
        """
        place, known = self._of(gaps)
        wanted = np.full(gaps.gap.size, np.inf)
        wanted[known] = self.gap[place[known]]
        move = np.zeros(gaps.gap.size)
        tolerance = TOLERANCE * gaps.h
        inside = gaps.gap < -tolerance
        move[inside] = 0.5 * (tolerance - gaps.gap)[inside]
        # What is narrow enough is not widened again: only what overlaps moves back.
        wide = narrow & (gaps.gap > wanted + tolerance)
        move[wide] = -0.5 * (gaps.gap[wide] - wanted[wide])
        return move

    def count(self, gaps):
        """Nodes whose gap to another grain shall vanish and has not. Collective."""
        place, known = self._of(gaps)
        closing = np.flatnonzero(known)[self.closing[place[known]]]
        open_still = gaps.gap[closing] > TOUCHING * gaps.h[closing]
        return int(gaps.comm.allreduce(np.unique(gaps.nodes[closing[open_still]]).size))

    def contact_area(self, gaps):
        """Area of the nodes that touch another grain, each side half [m²]. Collective.

        As seen along the way to the other grain at first, which has no direction where
        surfaces touch.
        """
        place, known = self._of(gaps)
        place, near = place[known], (gaps.gap < TOUCHING * gaps.h)[known]
        touching = near & (self.facing[place] > FACING[0])
        return float(gaps.comm.allreduce(0.5 * self.area[place[touching]].sum()))


def _reduce(operation, values, first):
    return operation.reduceat(values, first) if first.size else np.empty(0)


def _smooth_step(s):
    """0 below 0, 1 above 1, between them the cubic with flat ends."""
    s = np.clip(s, 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)
