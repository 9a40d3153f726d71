"""What steps send to other ranks: positions of surface nodes, and forces on their way back.

An exchange between ghosted PETSc vectors ends when a rank has received what it wants and the others
have fetched what it sent, for large messages wait to be fetched: ranks meet in each one, and what
slows one for a moment slows all. Here a step waits for what it receives alone, and of the ghosts
it sends those that pairs read or act on.
"""

import numpy as np
from mpi4py import MPI

from ...kernels.rows import add_rows, gather_rows, put_rows, take_rows
from .active_nodes import nodes_of_pairs
from .exchange import swap

#: Tags of positions and of forces.
THERE, BACK = 73, 74


class Messages:
    """Positions to the ranks that have ghosts of them, forces on ghosts to their owners.

    Collective among neighbours. They are the same in all steps until the next search, so that
    requests are made once. Forces are added in the order of the ranks.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact` that has just found its pairs.
    """

    def __init__(self, contact):
        self._positions, self._forces = contact.positions, contact.forces
        self._there = self._back = None
        ranks = [rank for rank, *_ in contact.surface.neighbours]
        if ranks:
            num_own = contact.own.nodes.size
            read, acted_on = (flag[num_own:] for flag in nodes_of_pairs(contact))
            self._there = _Way(contact, ranks, read, THERE)
            self._back = _Way(contact, ranks, acted_on, BACK, back=True)

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

    def begin_there(self):
        """Own positions start on their way."""
        if way := self._there:
            way.let_go()
            gather_rows(way.own_values, self._positions.own, way.of_own)
            way.begin()

    def end_there(self):
        """Positions of ghosts are known afterwards."""
        if way := self._there:
            way.end()
            put_rows(self._positions.ghosts, way.of_ghosts, way.ghost_values)

    def begin_back(self):
        """Forces on ghosts start on their way, and are zero here."""
        if way := self._back:
            way.let_go()
            take_rows(way.ghost_values, self._forces.ghosts, way.of_ghosts)
            way.begin()

    def end_back(self):
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
        contact: As of `Messages`.
        ranks: Neighbours, increasing.
        wanted: Ghosts to be sent, bool, shape (num_ghosts,).
        tag: Of the messages.
        back: From the ghosts to their owners.
    """

    def __init__(self, contact, ranks, wanted, tag, back=False):
        comm, ghosts = contact.comm, contact.forces.numbers
        first = contact.forces.vector.getOwnershipRanges() // 3
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

    def begin(self):
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
