"""Bounds of relative motion: of each pair of grains, or of a grain and a wall, that may meet.

Each bounds how far points of one grain moved relative to points of the other so far. That of all
grains together (``RelativeMotion.bound``) advances by twice the largest motion of any node, so that
the fastest grain sets it for all. In a sample that is compressed, neighbours move alike, and a
velocity v0 + G x that fits all of them tells most of it: with w what a node has beside it,

    |v_a - v_b| <= |w_a| + |w_b| + |G| |x_a - x_b|,

for points of facets too, in which w and the field are interpolated. So the bound of two grains
advances by the largest w of each, and by |G| times a distance that no wait exceeds: what is
farther away than that is looked at again after so much motion. That of a grain and a plane
advances by w and by what the field brings points to the plane, wherever these are near it.
"""

import numpy as np
from mpi4py import MPI

from ...kernels.bulk.motion import moments
from ...kernels.bulk.motion_bounds import advance_bounds

#: Tag of the messages between neighbour ranks.
TAG = 72
#: Longest wait of a pair, in mean facet edges.
RANGE = 2.0
#: Of two grains this part at least is expected of the motion that is expected of all.
LEAST = 0.25
#: Number of the first wall, among those of grains.
WALLS = 1 << 31


class MotionBounds:
    """Bounds for the pairs of grains (``own``, ``other``) of this rank's pairs. Local.

    Walls are grains from number ``WALLS`` on.

    Args:
        own: Global grain of the point of each pair, shape (num_pairs,).
        other: Grain of its facets, shape (num_pairs,).
        bound: Of relative motion before [m].
    """

    #: What is kept of each.
    KEPT = ("bounds", "since", "until")

    def __init__(self, own, other, bound):
        key = own.astype(np.int64) << 32 | other
        #: of each bound, increasing: grain of points in the upper, of facets in the lower half
        self.key, of = np.unique(key, return_inverse=True)
        self.of = of.astype(np.int32)  #: bound of each pair
        self.bounds = np.full(self.key.size, float(bound))
        #: the bounds when the time step was found last
        self.since = self.bounds.copy()
        #: those that were expected at most then, infinity where no less than of all grains
        self.until = np.full(self.key.size, np.inf)
        self._rows = None

    @property
    def now(self):
        """The bound of each pair [m], shape (num_pairs,)."""
        return self.bounds[self.of]

    def transfer(self, old):
        """Bounds of grains that had one before go on from there."""
        _, new, before = np.intersect1d(self.key, old.key, True, return_indices=True)
        for name in self.KEPT:
            getattr(self, name)[new] = getattr(old, name)[before]

    def of_pairs(self):
        """{name: values of each pair} of what is kept, for :meth:`take`. Local."""
        return {name: getattr(self, name)[self.of] for name in self.KEPT}

    def take(self, values):
        """Be what :meth:`of_pairs` told, as pairs of name and values. Local."""
        for name, of_pairs in values:
            getattr(self, name)[self.of] = of_pairs

    def follow(self, moves):
        """Take the moves of both grains from the :class:`GrainMoves`."""
        self._rows = moves.rows(self.key >> 32), moves.rows(self.key & 0xFFFFFFFF)

    def advance(self, step, moves=None):
        """Advance by ``step`` [m], a bound for all grains, or by less where that is known.

        Returns:
            By how much a bound goes beyond what was expected in the next two steps [m].
        """
        if moves is None:
            self.bounds += step
            return float((self.bounds - self.until).max(initial=-np.inf)) + 2.0 * step
        return advance_bounds(self.bounds, self.until, *self._rows, moves.moves, moves.more, step)

    def expect(self, margin, least, factor):
        """Expect motion until the time step is found again; changes nothing else.

        Args:
            margin: Of all grains [m].
            least: Of any two grains, as of what happens in the next step [m].
            factor: Of two grains, motion until then over that since :meth:`mark`.
        """
        moved = factor * (self.bounds - self.since)
        moved = np.maximum(moved, max(LEAST * margin, least))
        self.until[:] = np.where(moved < margin, self.bounds + moved, np.inf)

    def mark(self):
        """Look at motion from here on where it is expected next."""
        self.since[:] = self.bounds

    def can_reach(self, next_check):
        """Whether bounds are expected to reach the next checks of pairs, shape (num_pairs,)."""
        return next_check < self.until[self.of]


def linear_field(comm, x, v):
    """The velocity linear in the place that fits those of all nodes best. Collective.

    Args:
        comm: MPI communicator.
        x, v: Positions [m] and velocities [m/s], shape (num_nodes, 3).

    Returns:
        Velocity at the origin [m/s] and its slopes [1/s], shape (4, 3), as in kernels.bulk.motion.
    """
    sums = np.zeros((4, 7))
    moments(sums, x, v)
    comm.Allreduce(MPI.IN_PLACE, sums, op=MPI.SUM)
    scale = np.sqrt(np.maximum(sums[:, :4].diagonal(), np.finfo(float).tiny))[:, None]
    # Any field will do: nodes in a plane, which leave a slope open, may have a small one.
    normal = sums[:, :4] / scale / scale.T + 1e-9 * np.eye(4)
    return np.linalg.solve(normal, sums[:, 4:] / scale) / scale


class GrainMoves:
    """How far each grain moved in a step, of this rank's and of those near it. Collective.

    Every rank that knows facets of a grain learns how far it moved from the rank that has it.

    Args:
        comm: MPI communicator.
        grains: Global indices of this rank's grains, increasing, shape (num_own_grains,).
        neighbours: As of :class:`~mufe_fenicsx.contact.surface.exchange.Surface`.
        num_walls: Walls, which every rank knows.
        longest: Longest wait [m].
    """

    def __init__(self, comm, grains, neighbours, num_walls, longest):
        self._longest, self.more = longest, 0.0
        of_others = (told for _, _, told in neighbours)
        self._grains = np.concatenate([grains, *of_others, WALLS + np.arange(num_walls)])
        self._order = np.argsort(self._grains, kind="stable")
        #: largest distance of a node beside the field in this step [m], own grains first; of a
        #: wall, of the field along its normal
        self.moves = np.zeros(self._grains.size)
        self._own = self.moves[: grains.size]
        self._walls = self.moves[self.moves.size - num_walls :]
        self._outgoing, self._requests, first = [], [], grains.size
        for rank, tell, told in neighbours:
            if tell.size:
                message = np.empty(tell.size)
                self._outgoing.append((message, self.rows(tell)))
                self._requests.append(comm.Send_init(message, dest=rank, tag=TAG))
            if told.size:
                part = self.moves[first : first + told.size]
                self._requests.append(comm.Recv_init(part, source=rank, tag=TAG))
            first += told.size

    def destroy(self):
        """Free the requests. Local."""
        for request in self._requests:
            request.Free()

    def rows(self, grains):
        """Rows of ``moves`` of the global ``grains``, int32."""
        place = np.searchsorted(self._grains[self._order], grains)
        return self._order[place].astype(np.int32)

    def send(self, moves=np.inf, walls=np.inf, slope=0.0, dt=0.0):
        """A step in which this rank's grains move by ``moves`` beside a field.

        Args:
            moves: Distances [m], shape (num_own_grains,); infinity where unknown.
            walls: Of the field from or to the walls [m], shape (num_walls,).
            slope: Of the field in any direction, at most [1/s].
            dt: Length of the step [s].
        """
        self._own[:], self._walls[:] = moves, walls
        self.more = self._longest * dt * slope
        if self._requests:
            for message, tell in self._outgoing:
                message[:] = self._own[tell]
            MPI.Prequest.Startall(self._requests)

    def receive(self):
        """The moves of grains of other ranks are known too afterwards."""
        if self._requests:
            MPI.Prequest.Waitall(self._requests)
