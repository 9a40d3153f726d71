"""Facets of other ranks near this one, and PETSc vectors that keep them up to date."""

from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ...kernels.geometry.boxes import box_around, boxes_of_facets, touch_box, with_marked_vertex
from ...kernels.geometry.rings import neighbours, rings
from .occupancy import Cells, occupied_cells

#: Tag of the messages between neighbour ranks.
TAG = 71
#: Numbers that tell a facet to another rank.
NUMBERS = 20


@dataclass(frozen=True)
class Surface:
    """Own facets first, then those of other ranks. Nodes likewise."""

    facets: np.ndarray  #: local surface nodes, int32, shape (num_facets, 3)
    global_facet: np.ndarray  #: number over all ranks, shape (num_facets,)
    grain_of_facet: np.ndarray  #: global index of the grain, shape (num_facets,)
    body_of_facet: np.ndarray  #: as of :class:`~.surface.OwnSurface`, shape (num_facets,)
    layer_of_facet: np.ndarray  #: compliance [m/Pa], shape (num_facets,)
    area_of_facet: np.ndarray  #: in the reference configuration [m²], shape (num_facets,)
    depth_of_facet: np.ndarray  #: part in the largest depth of pairs [m], shape (num_facets,)
    sharp_edge: np.ndarray  #: whether the edges 0-1, 1-2, 2-0 are sharp, shape (num_facets, 3)
    compliance_of_edge: np.ndarray  #: of sharp ones, relative, of both ends [m/N], (num_facets, 3)
    bulge_of_facet: np.ndarray  #: as of surface.bulges [m], shape (num_facets, 6)
    curvature_of_facet: np.ndarray  #: as of surface.bulges, shape (num_facets, 3)
    #: False for facets that only complete a ring, or lie in a closed crack,
    use: np.ndarray  #: shape (num_facets,)
    neighbour: np.ndarray  #: as in kernels.geometry.closest, shape (num_facets, 3)
    ring_offset: np.ndarray  #: compressed rows of the facets around each node
    ring: np.ndarray
    #: Ranks that know facets of each other: rank, grains of this rank that it knows, and its
    #: grains that are known here; global indices, increasing.
    neighbours: list

    def part_of(self, own):
        """The own surface with arrays that are the first part of these: memory for one. Local.

        Args:
            own: :class:`~.OwnSurface` that this one was made from.
        """
        facets, neighbour = self.facets[: len(own.facets)], self.neighbour[: len(own.facets)]
        return replace(own, facets=facets, neighbour=neighbour, ring=self.ring[: own.ring.size])


class SurfaceArray:
    """Vectors at surface nodes, own ones first, then those of other ranks. Local.

    Args:
        num_own: Surface nodes of this rank.
        ghosts: Global numbers of the surface nodes of other ranks that are wanted, increasing.
        num_points: Rows of ``array`` before those of the nodes.
    """

    def __init__(self, num_own, ghosts, num_points=0):
        self.array = np.zeros((num_points + num_own + ghosts.size, 3))
        self.own = self.array[num_points : num_points + num_own]
        self.ghosts = self.array[num_points + num_own :]
        self.numbers = ghosts  #: of the ghosts


class SurfaceVector(SurfaceArray):
    """The same as a PETSc vector with ghosts. Collective.

    Args:
        comm: MPI communicator.
        num_own, ghosts: As of :class:`SurfaceArray`.
        num_points: Rows of ``array`` that the vector leaves alone.
    """

    def __init__(self, comm, num_own, ghosts, num_points=0):
        super().__init__(num_own, ghosts, num_points)
        self.vector = None
        if comm.size > 1:
            self.vector = PETSc.Vec().createGhostWithArray(
                ghosts.astype(PETSc.IntType),
                self.array[num_points:].ravel(),
                size=(3 * num_own, PETSc.DECIDE),
                bsize=3,
                comm=comm,
            )

    def forward(self):
        """Ghosts take the values of their owners."""
        if self.vector is not None:
            self.vector.ghostUpdate(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)

    def add_back(self):
        """Add the values of ghosts to those of their owners."""
        if self.vector is not None:
            self.vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)

    def largest_back(self):
        """Owners take the largest of their values and those of ghosts."""
        if self.vector is not None:
            self.vector.ghostUpdate(PETSc.InsertMode.MAX, PETSc.ScatterMode.REVERSE)

    def destroy(self):
        """Free the PETSc vector. Collective."""
        if self.vector is not None:
            self.vector.destroy()


def exchange_surface(comm, own, layers, x, reach, num_grains, hidden):
    """Fetch the facets of other ranks that lie within ``reach`` of this rank's surface. Collective.

    Ranks whose boxes overlap, grown by ``reach``, tell each other which cells of a grid their
    surface touches there. A facet is sent to a rank where its box, grown by ``reach``, touches
    such a cell: all that are within reach, and some that are a cell or a facet farther away. The
    facets around its vertices go along, since normals of edges and vertices need them. No rank
    ever sees the whole surface: of ranks elsewhere it knows the box.

    Args:
        comm: MPI communicator.
        own: :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        layers: :class:`~mufe_fenicsx.contact.stiffness.layers.SurfaceLayers` of own facets.
        x: Positions of own surface nodes [m], shape (num_nodes, 3).
        reach: Distance [m].
        num_grains: Of all ranks.
        hidden: Rows of own facets that nothing can touch.

    Returns:
        :class:`Surface` and the global numbers of ghost nodes, shape (num_ghosts,).
    """
    num_own, num_facets = own.nodes.size, len(own.facets)
    first_node = comm.exscan(num_own) or 0
    first_facet = comm.exscan(num_facets) or 0
    use = np.ones(num_facets, dtype=bool)
    use[hidden] = False
    surface = Surface(
        facets=own.facets,
        global_facet=first_facet + np.arange(num_facets),
        grain_of_facet=own.grain_of_facet,
        body_of_facet=own.body_of_facet,
        layer_of_facet=np.array(layers.of_facet),
        area_of_facet=own.facet_area,
        depth_of_facet=layers.depth_of_facet,
        sharp_edge=own.sharp_edge,
        compliance_of_edge=layers.compliance_of_edge,
        bulge_of_facet=layers.smooth.bulge,
        curvature_of_facet=layers.smooth.curvature,
        use=use,
        neighbour=own.neighbour,
        ring_offset=own.ring_offset,
        ring=own.ring,
        neighbours=[],
    )
    far = np.empty((0, NUMBERS), dtype=np.int64)
    if comm.size > 1:
        ranks, selected = near_other_ranks(comm, own.facets, x, reach)
        outgoing = [_packed(surface, near, num_own, first_node) for near in selected]
        incoming = swap(comm, ranks, [part.reshape(-1).view(np.uint8) for part in outgoing])
        incoming = [part.view(np.int64).reshape(-1, NUMBERS) for part in incoming]
        far = np.concatenate([far, *incoming])
        for rank, *parts in zip(ranks, outgoing, incoming, strict=True):
            known = (np.unique((part[:, 4] >> 4) % num_grains) for part in parts)
            surface.neighbours.append((int(rank), *known))
    if not len(far):
        return surface, np.empty(0, np.int64)
    return _with_far(surface, far, num_own, num_grains)


def _with_far(surface, far, num_own, num_grains):
    """A surface with facets of other ranks after its own, and the numbers of their nodes. Local.

    Args:
        surface: :class:`Surface` of this rank alone.
        far: Facets of other ranks, as of :func:`_packed`.
        num_own: Nodes of this rank.
        num_grains: Of all ranks.
    """
    s, num_near = surface, len(surface.facets)
    ghosts, facets = np.unique(far[:, :3], return_inverse=True)
    facets = facets.reshape(-1, 3)
    # Grains are whole on their ranks, so far facets neighbour far facets only.
    offset, ring = rings(facets, ghosts.size)
    neighbour = neighbours(facets, offset, ring)
    neighbour[neighbour >= 0] += num_near
    body, flags = far[:, 4] >> 4, far[:, 4, None] >> np.arange(4) & 1
    layer, area, depth = (far[:, 5 + k].copy().view(np.float64) for k in range(3))
    whole = Surface(
        facets=np.vstack([s.facets, facets + num_own]).astype(np.int32),
        global_facet=np.concatenate([s.global_facet, far[:, 3]]),
        grain_of_facet=np.concatenate([s.grain_of_facet, body % num_grains]).astype(np.int32),
        body_of_facet=np.concatenate([s.body_of_facet, body]).astype(np.int32),
        layer_of_facet=np.concatenate([s.layer_of_facet, layer]),
        area_of_facet=np.concatenate([s.area_of_facet, area]),
        depth_of_facet=np.concatenate([s.depth_of_facet, depth]),
        sharp_edge=np.concatenate([s.sharp_edge, flags[:, 1:].astype(bool)]),
        compliance_of_edge=np.concatenate(
            [s.compliance_of_edge, far[:, 8:11].copy().view(np.float64)]
        ),
        bulge_of_facet=np.concatenate([s.bulge_of_facet, far[:, 11:17].copy().view(np.float64)]),
        curvature_of_facet=np.concatenate(
            [s.curvature_of_facet, far[:, 17:].copy().view(np.float64)]
        ),
        use=np.concatenate([s.use, flags[:, 0].astype(bool)]),
        neighbour=np.vstack([s.neighbour, neighbour]),
        ring_offset=np.concatenate([s.ring_offset, s.ring_offset[-1] + offset[1:]]),
        ring=np.concatenate([s.ring, ring + np.int32(num_near)]),
        neighbours=s.neighbours,
    )
    return whole, ghosts


def near_other_ranks(comm, facets, x, reach):
    """Own facets that may come within ``reach`` of the surfaces of other ranks. Collective.

    Args:
        comm: MPI communicator.
        facets: Own facets, shape (num_facets, 3).
        x: Positions of own surface nodes [m], shape (num_nodes, 3).
        reach: Distance [m].

    Returns:
        Ranks whose boxes overlap this one's, grown by ``reach``, increasing; such a rank finds
        this one too. For each of them True for the facets, shape (num_ranks, num_facets).
    """
    reach = reach * (1 + 1e-9)  # what is just within reach is not lost by rounding
    boxes = np.empty((comm.size, 2, 3))
    own_box = np.array(box_around(x))
    comm.Allgather(own_box, boxes)
    apart = np.maximum(boxes[:, 0] - own_box[1], own_box[0] - boxes[:, 1]).max(axis=1)
    apart[comm.rank] = np.inf
    ranks = np.flatnonzero(apart <= reach)
    if not ranks.size:
        return ranks, []
    low, high = boxes_of_facets(x, facets)
    # Most of a rank's surface is in no other one's box.
    others = boxes[ranks] + reach * np.array([[-1.0], [1.0]])
    selected = np.array([touch_box(low, high, *other) for other in others])
    some = selected.any(axis=0)
    cells = occupied_cells(low[some], high[some])
    outgoing = [cells.within(*other).packed() for other in others]
    incoming = swap(comm, ranks, outgoing)
    for near, part in zip(selected, incoming, strict=True):
        near[near] = Cells.unpacked(part).near(low[near], high[near], reach)
    return ranks, selected


def with_rings(facets, near, num_nodes):
    """Facets that are ``near`` and all around their vertices, increasing, shape (num,). Local."""
    touched = np.zeros(num_nodes, dtype=bool)
    touched[facets[near]] = True
    return np.flatnonzero(with_marked_vertex(facets, touched))


def swap(comm, ranks, messages):
    """Send a message to each of the ``ranks`` and receive one from each. Collective among them.

    Args:
        comm: MPI communicator.
        ranks: Neighbours, each of which has this rank among its own.
        messages: For each of them an array of bytes, uint8.

    Returns:
        The messages from them, uint8.
    """
    requests = [comm.Isend(m, dest=r, tag=TAG) for r, m in zip(ranks, messages, strict=True)]
    status, received = MPI.Status(), []
    for rank in ranks:
        comm.Probe(source=rank, tag=TAG, status=status)
        received.append(np.empty(status.Get_count(MPI.BYTE), dtype=np.uint8))
        comm.Recv(received[-1], source=rank, tag=TAG)
    MPI.Request.Waitall(requests)
    return received


def _packed(surface, near, num_nodes, first_node):
    """Facets that are ``near``, and those around their vertices: ``NUMBERS`` each, int64."""
    s, send = surface, with_rings(surface.facets, near, num_nodes)
    rows = np.empty((send.size, NUMBERS), dtype=np.int64)
    rows[:, :3] = s.facets[send] + np.int64(first_node)
    rows[:, 3] = s.global_facet[send]
    rows[:, 4] = 16 * s.body_of_facet[send].astype(np.int64) + (near & s.use)[send]
    rows[:, 4] += s.sharp_edge[send] @ np.array([2, 4, 8])
    numbers = (
        s.layer_of_facet, s.area_of_facet, s.depth_of_facet, *s.compliance_of_edge.T,
        *s.bulge_of_facet.T, *s.curvature_of_facet.T,
    )  # fmt: skip
    for k, values in enumerate(numbers):
        rows[:, 5 + k] = values[send].astype(np.float64).view(np.int64)
    return rows
