"""Positions of surface nodes and forces on them, here and at the ghosts of other ranks' nodes."""

import numpy as np

from ...kernels.build.rows import gather_rows, gather_some, hand_rows, hand_some
from ...kernels.contact.points import place_points
from .exchange import SurfaceArray, SurfaceVector
from .halo_messages import Messages


class Ghosts:
    """Positions go forward to the ranks that have ghosts, forces come back and are added.

    Points of contact come before nodes in all arrays; nodes that are points come once.

    Args:
        comm: MPI communicator.
        nodes: Mesh nodes on this rank's surface, shape (num_nodes,).
        points: :class:`~mufe_fenicsx.contact.surface.points.Points` of it.
    """

    def __init__(self, comm, nodes, points):
        self.comm, self.nodes, self._points = comm, nodes, points
        self.num_before = 0 if points.are_nodes else points.num_points  #: rows of points
        self.around = points.around + np.int32(self.num_before)  #: ``points.around`` as rows
        self.positions = None  #: :class:`~.SurfaceArray` [m]
        self.forces = self._messages = None
        #: Own surface nodes whose positions are known until the next search; None: all.
        self.moving = None

    def renew(self, surface, ghosts, positions):
        """Take over a new exchange of surfaces. Collective.

        Args:
            surface: :class:`~mufe_fenicsx.contact.surface.exchange.Surface`.
            ghosts: Global numbers of its nodes of other ranks, increasing.
            positions: Of own surface nodes [m], shape (num_nodes, 3).
        """
        if self.forces is not None:
            self.destroy()
        num_own, before = self.nodes.size, self.num_before
        self.positions = SurfaceArray(num_own, ghosts, before)
        self.forces, self._lent = SurfaceVector(self.comm, num_own, ghosts, before), True
        #: Facets and rings of the surface as rows of the arrays.
        self.facets = surface.facets + np.int32(before)
        self.ring_offset, self.ring = surface.ring_offset, surface.ring
        if before:
            offset, ring = self._points.ring_offset, self._points.ring
            self.ring_offset = np.concatenate([offset[:-1], ring.size + self.ring_offset])
            self.ring = np.concatenate([ring, self.ring])
        self.forces.own[:] = positions
        self.forces.forward()
        self.positions.array[before:] = self.forces.array[before:]
        self._near = np.arange(before, dtype=np.int32)
        self.place_points()

    def destroy(self):
        """Free what sends messages. Collective."""
        if self._messages is not None:
            self._messages.destroy()
        self._messages = None
        self.forces.destroy()

    def connect(self, neighbours, flags):
        """Steps exchange what pairs ask for from here on. Collective.

        Args:
            neighbours: As of :class:`~mufe_fenicsx.contact.surface.exchange.Surface`.
            flags: As of :func:`~mufe_fenicsx.contact.surface.active_nodes.nodes_of_pairs`; not
                looked at without neighbours.
        """
        ranks = [rank for rank, *_ in neighbours]
        self._messages = Messages(self.comm, self.positions, self.forces, ranks, flags)

    def list_near(self, *rows):
        """Place in steps the points ``rows`` alone. Local."""
        if not self.num_before:
            return
        near = np.zeros(self.num_before, dtype=bool)
        for some in rows:
            near[some] = True
        self._near = np.flatnonzero(near).astype(np.int32)

    def place(self, x):
        """Start sending the positions ``x`` of this rank's surface to other ranks. Collective."""
        if self.moving is None:
            gather_rows(self.positions.own, x, self.nodes)
        else:
            gather_some(self.positions.own, x, self.nodes, self.moving)
        self.send()

    def send(self):
        """Own positions start on their way to the ranks that know them. Collective."""
        self._messages.begin_forward()

    def receive(self):
        """Positions from other ranks have arrived afterwards. Collective."""
        self._messages.end_forward()

    def clear_forces(self):
        """Make the forces on nodes zero, which they are once they are handed on. Local."""
        if self._lent:
            self.forces.array[self.num_before :] = 0.0

    def begin_reverse(self):
        """Forces on nodes of other ranks start on their way there. Collective."""
        self._messages.begin_reverse()

    def end_reverse(self):
        """They have been added afterwards. Collective."""
        self._messages.end_reverse()

    def hand_on(self, f):
        """Add the forces on own nodes to ``f`` [N], shape (num_mesh_nodes, 3). Local.

        They are zero afterwards.
        """
        if self.moving is None:
            hand_rows(f, self.nodes, self.forces.own)
        else:
            hand_some(f, self.nodes, self.forces.own, self.moving)
        self._lent = False

    def corners(self):
        """Nodes and weights of points in facets as kernels.contact.points has them. Local."""
        if not self.num_before:
            return np.empty((0, 3), np.int32), np.empty((0, 3))
        return self._points.corner + np.int32(self.num_before), self._points.weight

    def place_points(self):
        """Bring all points of pairs to where their nodes are; a step places those it needs."""
        if self.num_before:
            place_points(self.positions.array, self._near, *self.corners())

    @property
    def any_force(self):
        """Whether forces are sent or received in a step. Local."""
        return self._messages.any_force

    @property
    def num_exchanged(self):
        """Ghosts whose positions come in a step, and those on which forces go back. Local."""
        return self._messages.num_ghosts

    @property
    def num_nodes(self):
        """Surface nodes of this rank and those of others that it knows."""
        return self.positions.array.shape[0] - self.num_before

    def reverse_scatter(self, values, largest=False):
        """Sums, or the largest, of values at surface nodes over all ranks. Collective.

        Args:
            values: Of this rank's surface nodes and its ghosts, shape (num_nodes, 3).
            largest: The largest instead of the sum.

        Returns:
            Values at own surface nodes, shape (num_own_nodes, 3).
        """
        vector = self.scratch_vector()
        vector.array[self.num_before :] = values
        if largest:
            vector.largest_back()
        else:
            vector.add_back()
        return vector.own.copy()

    def scratch_vector(self):
        """The vector of forces, for other values: forces are not needed once they are added up."""
        self._lent = True
        return self.forces
