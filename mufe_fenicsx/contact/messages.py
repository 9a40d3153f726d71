"""What steps send to other ranks: positions of surface nodes, and forces on their way back.

An exchange between ghosted PETSc vectors ends when a rank has received what it wants, and the
others have fetched what it sent: large messages wait to be fetched. So ranks would meet in each
exchange, and what slows one for a moment slows all. Here a step waits for what it receives alone.
"""

import numpy as np
from mpi4py import MPI

from ..kernels.walls import add_rows, gather_rows
from .exchange import swap

#: Tags of positions and of forces.
THERE, BACK = 73, 74


class Messages:
    """Positions to the ranks that have them as ghosts, forces on ghosts to their owners.

    Collective among neighbours. Messages are the same from one step to the next, so that requests
    are made once. Forces are added in the order of the ranks.

    Args:
        comm: MPI communicator.
        ranks: Neighbours, each of which has this rank among its own, increasing.
        positions: Of own surface nodes, then of ghosts, :class:`~.exchange.SurfaceArray`.
        forces: On them, :class:`~.exchange.SurfaceVector`.
    """

    def __init__(self, comm, ranks, positions, forces):
        self._positions, self._forces = positions.own, forces.own
        self._there, self._back = _Way(), _Way()
        self._rows = np.empty(0, dtype=np.int32)
        if not len(ranks):
            return
        first = forces.vector.getOwnershipRanges() // 3
        place = np.searchsorted(forces.ghosts, first)
        parts = [slice(place[rank], place[rank + 1]) for rank in ranks]
        wanted = [forces.ghosts[part].astype(np.int64).view(np.uint8) for part in parts]
        wanted = [message.view(np.int64) for message in swap(comm, ranks, wanted)]
        self._rows = (np.concatenate(wanted) - first[comm.rank]).astype(np.int32)
        self._sent, self._received = np.empty((2, self._rows.size, 3))
        end = 0
        for rank, part, rows in zip(ranks, parts, wanted, strict=True):
            here, end = slice(end, end + rows.size), end + rows.size
            if rows.size:
                self._there.send(comm, self._sent[here], rank, THERE)
                self._back.receive(comm, self._received[here], rank, BACK)
            if part.start < part.stop:
                self._there.receive(comm, positions.of_ghosts[part], rank, THERE)
                self._back.send(comm, forces.of_ghosts[part], rank, BACK)

    def begin_there(self):
        """Own positions start on their way."""
        if self._there.exists:
            self._there.let_go()
            gather_rows(self._sent, self._positions, self._rows)
            self._there.begin()

    def end_there(self):
        """Positions of ghosts are known afterwards."""
        self._there.end()

    def begin_back(self):
        """Forces on ghosts start on their way; :meth:`let_go` comes before they may change."""
        if self._back.exists:
            self._back.let_go()
            self._back.begin()

    def end_back(self):
        """Forces on own nodes contain those from other ranks afterwards."""
        if self._back.exists:
            self._back.end()
            add_rows(self._forces, self._rows, self._received)

    def let_go(self):
        """Forces on ghosts may change afterwards: their owners have fetched the last ones."""
        self._back.let_go()

    def destroy(self):
        """Free the requests. Collective among neighbours."""
        self._there.destroy()
        self._back.destroy()


class _Way:
    """Messages that start together, and are waited for where they arrive."""

    def __init__(self):
        self._sends, self._receives = [], []

    @property
    def exists(self):
        """Whether there are any."""
        return bool(self._sends or self._receives)

    def send(self, comm, values, rank, tag):
        """Those values go to that rank at each :meth:`begin`."""
        self._sends.append(comm.Send_init(values, dest=rank, tag=tag))

    def receive(self, comm, values, rank, tag):
        """Those values come from there."""
        self._receives.append(comm.Recv_init(values, source=rank, tag=tag))

    def begin(self):
        MPI.Prequest.Startall(self._receives + self._sends)

    def end(self):
        """What is received is there afterwards."""
        MPI.Prequest.Waitall(self._receives)

    def let_go(self):
        """What was sent may change afterwards."""
        MPI.Prequest.Waitall(self._sends)

    def destroy(self):
        self.let_go()
        for request in self._sends + self._receives:
            request.Free()
