"""Facets of other ranks near this one, and PETSc vectors that keep them up to date."""

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from .surface import neighbors, rings


@dataclass(frozen=True)
class Surface:
    """Own facets first, then those of other ranks. Nodes likewise."""

    facets: np.ndarray  #: local surface nodes, int32, shape (num_facets, 3)
    global_facet: np.ndarray  #: number over all ranks, shape (num_facets,)
    grain_of_facet: np.ndarray  #: global index of the grain, shape (num_facets,)
    layer_of_facet: np.ndarray  #: compliance [m/Pa], shape (num_facets,)
    use: np.ndarray  #: False for facets that only complete a ring, shape (num_facets,)
    neighbor: np.ndarray  #: as in kernels.closest, shape (num_facets, 3)
    ring_offset: np.ndarray  #: compressed rows of the facets around each node
    ring: np.ndarray


class SurfaceVector:
    """Vectors at surface nodes, a PETSc vector with ghosts. Collective.

    Args:
        comm: MPI communicator.
        num_own: Surface nodes of this rank.
        ghosts: Global numbers of the surface nodes of other ranks that are wanted.
        num_points: Rows of ``array`` before those of the nodes, which the vector leaves alone.
    """

    def __init__(self, comm, num_own, ghosts, num_points=0):
        self.array = np.zeros((num_points + num_own + ghosts.size, 3))
        self.own = self.array[num_points : num_points + num_own]
        self.vector = None
        if comm.size > 1:
            self.vector = PETSc.Vec().createGhostWithArray(
                ghosts.astype(PETSc.IntType),
                self.array[num_points:].ravel(),
                size=(3 * num_own, PETSc.DECIDE),
                bsize=3,
                comm=comm,
            )

    def begin_forward(self):
        """Start sending own values to the ranks that have them as ghosts."""
        if self.vector is not None:
            self.vector.ghostUpdateBegin(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)

    def end_forward(self):
        """Ghost values are up to date afterwards."""
        if self.vector is not None:
            self.vector.ghostUpdateEnd(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)

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


def exchange_surface(comm, own, layer_of_facet, x, reach):
    """Fetch the facets of other ranks that lie within ``reach`` of this rank's nodes. Collective.

    A facet is sent to a rank where the boxes of both, grown by ``reach``, overlap;
    the facets around its vertices go along, since normals of edges and vertices
    need them. No rank ever sees the whole surface.

    Args:
        comm: MPI communicator.
        own: :class:`~mufe_fenicsx.contact.surface.OwnSurface`.
        layer_of_facet: Compliance of own facets [m/Pa], shape (num_facets,).
        x: Positions of own surface nodes [m], shape (num_nodes, 3).
        reach: Distance [m].

    Returns:
        :class:`Surface` and the global numbers of ghost nodes, shape (num_ghosts,).
    """
    num_own = own.nodes.size
    first_node = comm.exscan(num_own) or 0
    first_facet = comm.exscan(own.facets.shape[0]) or 0
    facets = own.facets
    global_facet = first_facet + np.arange(facets.shape[0])
    grain, layer = own.grain_of_facet, layer_of_facet
    use = np.ones(facets.shape[0], dtype=bool)
    ghosts = np.empty(0, dtype=np.int64)
    neighbor, ring_offset, ring = own.neighbor, own.ring_offset, own.ring

    if comm.size > 1:
        outgoing = _select(comm, own, layer_of_facet, x, reach, first_node, first_facet)
        incoming = [part for part in comm.alltoall(outgoing) if part is not None]
        if incoming:
            far_nodes = np.concatenate([part["nodes"] for part in incoming])
            ghosts, far_facets = np.unique(far_nodes, return_inverse=True)
            far_facets = far_facets.reshape(-1, 3)
            # Grains are whole on their ranks, so far facets neighbour far facets only.
            num_near = facets.shape[0]
            far_neighbor = neighbors(far_facets)
            far_neighbor[far_neighbor >= 0] += num_near
            neighbor = np.vstack([neighbor, far_neighbor])
            far_offset, far_ring = rings(far_facets, ghosts.size)
            ring_offset = np.concatenate([ring_offset, ring_offset[-1] + far_offset[1:]])
            ring = np.concatenate([ring, far_ring + np.int32(num_near)])
            facets = np.vstack([facets, far_facets + num_own]).astype(np.int32)
            global_facet = np.concatenate([global_facet, *[part["facet"] for part in incoming]])
            grain = np.concatenate([grain, *[part["grain"] for part in incoming]])
            layer = np.concatenate([layer, *[part["layer"] for part in incoming]])
            use = np.concatenate([use, *[part["use"] for part in incoming]])

    surface = Surface(
        facets=facets,
        global_facet=global_facet,
        grain_of_facet=grain.astype(np.int32),
        layer_of_facet=np.array(layer),
        use=use,
        neighbor=neighbor,
        ring_offset=ring_offset,
        ring=ring,
    )
    return surface, ghosts


def _select(comm, own, layer, x, reach, first_node, first_facet):
    """For each rank the facets it may touch, or None."""
    corners = x[own.facets]
    low, high = corners.min(axis=1) - reach, corners.max(axis=1) + reach
    box = np.array([x.min(axis=0), x.max(axis=0)])
    outgoing = []
    for rank, (other_low, other_high) in enumerate(comm.allgather(box)):
        near = np.all((low <= other_high) & (high >= other_low), axis=1)
        if rank == comm.rank or not near.any():
            outgoing.append(None)
            continue
        touched = np.zeros(x.shape[0], dtype=bool)
        touched[own.facets[near]] = True
        send = touched[own.facets].any(axis=1)
        outgoing.append(
            {
                "nodes": own.facets[send].astype(np.int64) + first_node,
                "facet": first_facet + np.flatnonzero(send),
                "grain": own.grain_of_facet[send],
                "layer": layer[send],
                "use": near[send],
            }
        )
    return outgoing
