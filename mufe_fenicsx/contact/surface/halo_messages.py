"""What steps send to other ranks: positions of surface nodes, and forces on their way back.

An exchange between ghosted PETSc vectors ends when a rank has received what it wants and the others
have fetched what it sent, for large messages wait to be fetched: ranks meet in each one, and what
slows one for a moment slows all. Here a step waits for what it receives alone, and of the ghosts
it sends those that pairs read or act on.
"""

import numpy as np
from mpi4py import MPI

from ...kernels.build.rows import add_rows, gather_rows, put_rows, take_rows
from .exchange import swap

#: Tags of positions and of forces.
THERE, BACK = 73, 74


class Messages:
    """Positions to the ranks that have ghosts of them, forces on ghosts to their owners.

    Collective among neighbours. They are the same in all steps until the next search, so that
    requests are made once. Forces are added in the order of the ranks.

    Args:
        comm: MPI communicator.
        positions: :class:`~.SurfaceArray` [m].
        forces: :class:`~.SurfaceVector` [N] with the same ghosts.
        ranks: Neighbours, increasing.
        flags: Surface nodes that pairs read, and act on, as of
            :func:`~mufe_fenicsx.contact.surface.active_nodes.nodes_of_pairs`.
    """

    def __init__(self, comm, positions, forces, ranks, flags):
        self._positions, self._forces = positions, forces
        self._there = self._back = None
        if ranks:
            read, acted_on = (flag[len(positions.own) :] for flag in flags)
            self._there = _Way(comm, forces, ranks, read, THERE)
            self._back = _Way(comm, forces, ranks, acted_on, BACK, back=True)

    @property
    def num_ghosts(self):
        """Ghosts whose positions come in a step, and those on which forces go back."""
        ways = self._there, self._back
        return tuple(0 if way is None else way.of_ghosts.size for way in ways)

    @property
    def any_force(self):
        """Whether forces are sent or received in a step."""
        way = self._back
        return way is not None and way.of_ghosts.size + way.of_own.size > 0

    def begin_forward(self):
        """Own positions start on their way."""
        if way := self._there:
            way.let_go()
            gather_rows(way.own_values, self._positions.own, way.of_own)
            way.start()

    def end_forward(self):
        """Positions of ghosts are known afterwards."""
        if way := self._there:
            way.end()
            put_rows(self._positions.ghosts, way.of_ghosts, way.ghost_values)

    def begin_reverse(self):
        """Forces on ghosts start on their way, and are zero here."""
        if way := self._back:
            way.let_go()
            take_rows(way.ghost_values, self._forces.ghosts, way.of_ghosts)
            way.start()

    def end_reverse(self):
        """Forces on own nodes contain those from other ranks afterwards."""
        if way := self._back:
            way.end()
            add_rows(self._forces.own, way.of_own, way.own_values)

    def destroy(self):
        """Free the requests. Collective among neighbours."""
        for way in (self._there, self._back):
            if way:
                way.destroy()


class _Way:
    """Messages that start together, and are waited for where they arrive.

    Args:
        comm, forces, ranks: As of `Messages`.
        wanted: Ghosts to be sent, bool, shape (num_ghosts,).
        tag: Of the messages.
        back: From the ghosts to their owners.
    """

    def __init__(self, comm, forces, ranks, wanted, tag, back=False):
        ghosts = forces.numbers
        first = forces.vector.getOwnershipRanges() // 3
        place = np.searchsorted(ghosts, first)
        here = [place[r] + np.flatnonzero(wanted[place[r] : place[r + 1]]) for r in ranks]
        asked = [ghosts[rows].astype(np.int64).view(np.uint8) for rows in here]
        asked = [rows.view(np.int64) for rows in swap(comm, ranks, asked)]
        #: Rows among the ghosts, and among own surface nodes, of each rank one after another.
        self.of_ghosts = np.concatenate(here).astype(np.int32)
        self.of_own = (np.concatenate(asked) - first[comm.rank]).astype(np.int32)
        self.ghost_values, self.own_values = (
            np.empty((rows.size, 3)) for rows in (self.of_ghosts, self.of_own)
        )
        incoming, outgoing = _split(self.ghost_values, here), _split(self.own_values, asked)
        if back:
            incoming, outgoing = outgoing, incoming
        self._receives, self._sends = [], []
        for rank, received, sent in zip(ranks, incoming, outgoing, strict=True):
            if received.size:
                self._receives.append(comm.Recv_init(received, source=rank, tag=tag))
            if sent.size:
                self._sends.append(comm.Send_init(sent, dest=rank, tag=tag))
        self._all = self._receives + self._sends

    def start(self):
        """They are on their way."""
        MPI.Prequest.Startall(self._all)

    def end(self):
        """What is received is there afterwards."""
        MPI.Prequest.Waitall(self._receives)

    def let_go(self):
        """What was sent may change afterwards."""
        MPI.Prequest.Waitall(self._sends)

    def destroy(self):
        """Free the requests. Collective among neighbours."""
        self.let_go()
        for request in self._all:
            request.Free()


def _split(values, lists):
    """Parts of ``values``, as many rows as each of the lists has."""
    return np.split(values, np.cumsum([len(rows) for rows in lists])[:-1])
