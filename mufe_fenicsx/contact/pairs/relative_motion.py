"""How far anything moved relative to anything else, and how long the last search is good for."""

import numpy as np
from mpi4py import MPI

from ...kernels.bulk.motion import largest_move
from ...state import Stateful
from .motion_bounds import RANGE, GrainMoves

#: Candidates reach this far beyond the closed gap, in mean facet edges.
SKIN = 0.4
#: The same where the mesh has just grown, as it does again soon.
SKIN_BESIDE_CRACKS = 0.1


class RelativeMotion(Stateful):
    """A bound of all relative motion, and those of pairs of grains that go on with it. Collective.

    Args:
        comm: MPI communicator.
        grains: Global indices of this rank's grains, increasing, shape (num_own_grains,).
        edge: Mean facet edge [m].
        x: Positions of this rank's nodes [m], shape (num_nodes, 3).
    """

    STATE = {
        "common": ("bound", "searched_at", "reach", "overlap", "skin"),
        "largest": ("overrun", "overrun_of_all"),
    }

    def __init__(self, comm, grains, edge, x):
        self.comm, self.grains = comm, grains
        self.bound = 0.0  #: of all relative motion so far, the same on all ranks [m]
        self.searched_at = 0.0  #: the bound at the last search [m]
        self.reach = self.overlap = 0.0  #: of the last search, and for overlaps beyond it [m]
        self.skin = SKIN * edge  #: of the last search [m]
        self.longest = RANGE * edge  #: longest wait of a pair [m]
        self._width = comm.allreduce(float(np.ptp(x, axis=0).max()), op=MPI.SUM)
        #: By how much bounds of two grains go beyond what was expected soon, on this rank, and two
        #: steps ago on all [m].
        self.overrun = self.overrun_of_all = -np.inf
        self._moves, self._of_pairs = None, ()
        self._step, self._agreement = np.zeros(2), None

    def renew(self, reach, overlap, neighbours, num_walls, positions):
        """Go on with the grains near this rank's at a new search. Collective.

        Args:
            reach, overlap: Of the search [m].
            neighbours: As of :class:`~mufe_fenicsx.contact.surface.exchange.Surface`.
            num_walls: Number of walls.
            positions: Of own surface nodes [m], shape (num_surface_nodes, 3).
        """
        self.reach, self.overlap = reach, overlap
        if self._moves is not None:
            self._moves.destroy()
        self._moves = GrainMoves(self.comm, self.grains, neighbours, num_walls, self.longest)
        self.measure_from(positions)

    def follow(self, *of_pairs):
        """Let the bounds of new pairs, each :class:`~.MotionBounds`, go on from here. Local."""
        self._of_pairs = of_pairs
        for bounds in of_pairs:
            bounds.follow(self._moves)

    def destroy(self):
        """Free what sends messages. Local."""
        self._moves.destroy()

    def measure_from(self, positions):
        """The next motion that :meth:`begin_agreement` measures is that from there. Local.

        Args:
            positions: Of own surface nodes [m], shape (num_surface_nodes, 3).
        """
        self._previous = positions.copy()

    def begin_agreement(self, positions, moved, known):
        """What moves in this step is on its way to other ranks afterwards. Collective.

        Args:
            positions: Of own surface nodes [m], shape (num_surface_nodes, 3).
            moved: Largest distance that a wall moved [m]; where ``known``, that anything moved.
            known: How far each grain moved beside a field, and that field from or to walls [m], the
                field's slope [1/s] and the length of the step [s]; empty: measure all motion.
        """
        self._moves.send(*known)
        if not known:
            moved = max(largest_move(self._previous, positions), moved)
        self._step[:] = moved, self.overrun
        if self.comm.size > 1:
            self._agreement = self.comm.Iallreduce(MPI.IN_PLACE, self._step, op=MPI.MAX)

    def end_agreement(self):
        """The largest distance that anything of any rank moved in this step [m]. Collective.

        Raises:
            FloatingPointError: A position is not finite, or left the others by more than all
                grains are wide; on all ranks together.
        """
        if self.comm.size > 1:
            self._agreement.Wait()
        move, self.overrun_of_all = self._step.tolist()
        self._moves.receive()
        if not move < self._width:
            raise FloatingPointError("positions are not finite")
        self.advance(2.0 * move, self._moves)
        return move

    def advance(self, step, moves=None):
        """All bounds go on by ``step`` [m], by less where ``moves`` tell it. Local.

        The same on all ranks.
        """
        self.bound += step
        of_grains, of_walls = self._of_pairs
        self.overrun = max(of_grains.advance(step, moves), of_walls.advance(step, moves))

    def expect(self, margin, least, factor):
        """Expect motion until the time step is found again, arguments as of the bounds. Local."""
        for bounds in self._of_pairs:
            bounds.expect(margin, least, factor)
        self.overrun = self.overrun_of_all = -np.inf

    def mark(self):
        """Look at motion from here on where it is expected next. Local."""
        for bounds in self._of_pairs:
            bounds.mark()

    def is_beyond(self, ahead):
        """Whether ``ahead`` [m] of further motion leaves the skin of the last search. Local."""
        return self.bound + ahead - self.searched_at > self.skin

    @property
    def left(self):
        """Motion from now on before which nothing beyond the last search can be met [m]."""
        return self.searched_at + self.reach - self.bound

    @property
    def known_ahead(self):
        """Motion from now on in which no pairs close but those that are known [m]."""
        return min(self.left, self.skin)
