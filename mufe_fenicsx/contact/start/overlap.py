"""Grains that are too deep in each other: at the start, and as a test goes on."""

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from ...errors import InputError
from ...state import Stateful
from ..laws import LARGEST_DEPTH, edge_of_area

#: Depth of a point in another grain at the start, over the edge of the finer of both facets, up to
#: which it is taken for an overlap of the image and becomes an offset.
DEEPEST_START = 1.0
#: Up to this depth they are looked for, in the largest edge of the other grain.
SEARCHED = 1.1
#: Depth beyond the offset, over the same, up to which contact is one: five times the depth at
#: which its force grows no more. Deeper, nothing keeps grains from passing through each other.
DEEPEST = 0.5
#: Depth over edge, depth [m], grain and the one that it is in, where no pair is beyond the depth at
#: which forces grow no more.
NOT_SUNK = (0.0, 0.0, -1, -1)


class Overlaps(Stateful):
    """How deep grains are in each other: accepted at the start, and since. Local."""

    STATE = {"sum": ("num_accepted",), "largest": ("deepest",)}

    def __init__(self):
        self.num_accepted = 0  #: pairs that overlapped at the start
        self.deepest = 0.0  #: largest depth of them [m]
        #: Deepest of all pairs since :func:`too_deep` asked: depth over the edge of the finer side,
        #: depth [m], grain and the one that it is in. Steps set it, searches for an equilibrium do
        #: not.
        self.deepest_pair = NOT_SUNK

    def accept(self, number, depth):
        """Count pairs that overlapped at the start, and their largest depth [m]."""
        self.num_accepted += number
        self.deepest = max(self.deepest, depth)

    def look_at(self, part, pair, pairs, grain_of_point):
        """Keep number ``pair`` of the ``pairs``, of depth over edge ``part``, if it is deeper."""
        if part > self.deepest_pair[0]:
            depth = pairs.offset[pair] - pairs.gap[pair]
            grains = grain_of_point[pairs.node[pair]], pairs.grain[pair]
            self.deepest_pair = (part, float(depth), *map(int, grains))


def depths_to_search(comm, own, num_grains, first_tool, edge):
    """How deep in each grain points are looked for at the start [m], (num_grains,). Collective.

    All facets of a grain have to be found that far: the closest one tells the side.

    Args:
        comm: MPI communicator.
        own: :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        num_grains: On all ranks.
        first_tool: The first of them that is a tool; None: none is.
        edge: Mean facet edge of all ranks [m].
    """
    largest = np.zeros(num_grains)
    np.maximum.at(largest, own.grain_of_facet, own.facet_area)
    comm.Allreduce(MPI.IN_PLACE, largest, op=MPI.MAX)
    edges = edge_of_area(largest, 1)
    if first_tool is not None:  # whose facets may be as large as it
        edges[first_tool:] = np.minimum(edges[first_tool:], edge)
    return SEARCHED * edges


def check_start(mesh, contact):
    """No grain starts deep in another, or inside it. Collective.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        contact: :class:`~mufe_fenicsx.contact.contact.Contact` after its first evaluation.

    Raises:
        InputError: One does; on all ranks.
    """
    found = deepest(contact, -contact.pairs.offset, DEEPEST_START)
    if found is not None:
        depth, part, grain, other = found
        raise InputError(
            f"{mesh.name_of(grain)} starts {depth:.3g} m deep in {mesh.name_of(other)}, "
            f"{part:.2g} edges of facets there, expected at most {DEEPEST_START:g}: "
            + _remedy(mesh, grain, other, "let sample.separation part them, mesh finer, or ")
        )
    inside = _inside_another(mesh, contact.own, contact.searched)
    if inside is not None:
        grain, other = inside
        raise InputError(
            f"{mesh.name_of(grain)} has its middle inside {mesh.name_of(other)}, "
            f"expected grains side by side: {_remedy(mesh, grain, other)}"
        )


def _remedy(mesh, grain, other, first=""):
    """What to do about two bodies that overlap at the start."""
    if max(grain, other) >= mesh.first_tool:
        return "move the tool away (position)"
    return f"{first}segment the image anew"


def too_deep(mesh, contact):
    """What to say where a grain sank too deep into another since the last call. Collective.

    Also where it has come out since: fast bodies pass through each other between two calls.
    None where none did.

    Args:
        mesh, contact: As above.
    """
    pairs = contact.pairs
    depth = np.where(pairs.closed, pairs.offset - pairs.gap, 0.0)
    since = contact.overlaps.deepest_pair
    found = deepest(contact, depth, DEEPEST) or _all_ranks(contact.comm, since, DEEPEST)
    contact.overlaps.deepest_pair = NOT_SUNK
    if found is None:
        return None
    depth, part, grain, other = found
    one, two = mesh.name_of(grain), mesh.name_of(other)
    remedy = "load more slowly, mesh the larger grain finer, or lower contact.compliance"
    if grain == other:
        one, two = f"a piece of {one}", "another one of it"
        remedy = "load more slowly or mesh it finer: pieces of single elements are crushed"
    return (
        f"{one} is {depth:.3g} m deep in {two}, {part:.2g} edges of facets there, expected at most "
        f"{DEEPEST:g}: contact no longer keeps them apart; {remedy}"
    )


def deepest(contact, depth, limit):
    """The pair that is deepest over the edge of its finer facet, if beyond a limit. Collective.

    Where one of the grains is rigid, with a layer thicker than its facets', the mean edge of both
    counts: those that deformable grains with these largest depths would have.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        depth: Of its pairs [m], shape (num_pairs,).
        limit: Depth over edge.

    Returns:
        None, or depth [m], depth over edge, grain and the one that it is in, the same on all ranks.
    """
    pairs = contact.pairs
    on = np.flatnonzero((depth > 0.0) & (pairs.closest >= 0))
    worst = (0.0, 0.0, -1, -1)
    if on.size:
        facet, node = pairs.candidate[pairs.closest[on]], pairs.node[on]
        own, other = contact.points.depth[node], contact.surface.depth_of_facet[facet]
        areas = contact.surface.area_of_facet[facet] / contact.points.facet_area[node]
        alike = np.abs(own / other * np.sqrt(areas) - 1.0) < 0.01  # else one of them is rigid
        finer = np.where(alike, np.minimum(own, other), 0.5 * (own + other))
        part = 0.5 * LARGEST_DEPTH * depth[on] / finer
        k = int(part.argmax())
        grain = contact.points.grain_of_point[node[k]]
        worst = (float(part[k]), float(depth[on][k]), int(grain), int(pairs.grain[on][k]))
    return _all_ranks(contact.comm, worst, limit)


def _all_ranks(comm, worst, limit):
    """The worst of all ranks, if beyond the limit: depth, depth over edge, grains. Collective."""
    if not comm.allreduce(int(worst[0] > limit)):
        return None
    part, depth, grain, other = max(comm.allgather(worst))
    return depth, part, grain, other


def _inside_another(mesh, own, x):
    """Two grains the first of which has its innermost node in the second, or None.

    By the winding number of the surface (A. Van Oosterom, J. Strackee, IEEE Trans. Biomed. Eng. 30,
    1983, 125-126).

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        own: Its :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        x: Positions of its nodes [m], shape (num_own_surface_nodes, 3).
    """
    if mesh.labels.size == 1:
        return None
    core = np.zeros((mesh.labels.size, 3))
    core[mesh.grains] = _innermost(mesh, own)
    mesh.comm.Allreduce(MPI.IN_PLACE, core, op=MPI.SUM)
    num = mesh.labels.size
    found = (num, num)
    order = np.argsort(own.grain_of_facet, kind="stable")
    first = np.searchsorted(own.grain_of_facet[order], np.arange(num + 1))
    for other in mesh.grains:
        corner = x[own.facets[order[first[other] : first[other + 1]]]]
        low, high = corner.min(axis=(0, 1)), corner.max(axis=(0, 1))
        within = ((core > low) & (core < high)).all(axis=1)
        within[other] = False
        if other >= mesh.first_tool:  # tools meet grains alone
            within[mesh.first_tool :] = False
        for grain in np.flatnonzero(within):
            a, b, c = np.moveaxis(corner - core[grain], 1, 0)
            la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
            top = np.einsum("ij,ij->i", a, np.cross(b, c))
            bottom = la * lb * lc
            for p, q, length in ((a, b, lc), (b, c, la), (c, a, lb)):
                bottom = bottom + np.einsum("ij,ij->i", p, q) * length
            if np.arctan2(top, bottom).sum() > np.pi:  # of 2 π inside, 0 outside
                found = min(found, (int(grain), int(other)))
    found = min(mesh.comm.allgather(found))
    return None if found[0] == num else found


def _innermost(mesh, own):
    """Place in each grain of this rank that is far from its surface [m], shape (num_grains, 3).

    Of the nodes inside, or of the middles of elements where there are none.
    """
    on_surface = np.zeros(mesh.num_nodes, dtype=bool)
    on_surface[own.nodes] = True
    core = np.empty((mesh.num_grains, 3))
    for grain in range(mesh.num_grains):
        nodes = mesh.nodes[mesh.node_offset[grain] : mesh.node_offset[grain + 1]]
        inner = mesh.x[nodes[~on_surface[nodes]]]
        if not inner.size:
            begin, end = mesh.cell_offset[grain], mesh.cell_offset[grain + 1]
            inner = mesh.x[mesh.cells[begin:end]].mean(axis=1)
        distance = cKDTree(mesh.x[nodes[on_surface[nodes]]]).query(inner)[0]
        core[grain] = inner[distance.argmax()]
    return core
