"""Where points are that can come near walls, and how far they move towards these."""

import numpy as np
from mpi4py import MPI

from ..kernels.contact.walls import farthest, motion_to_walls
from ..kernels.geometry.boxes import boxes_of_groups
from ..state import Stateful


class NearWalls(Stateful):
    """Where points are that can come near the walls until the next search.

    Args:
        num_walls: Number of walls.
    """

    STATE = {"largest": ("farthest", "box")}

    def __init__(self, num_walls):
        self.farthest = np.zeros(num_walls)  #: of this rank's surface nodes from ``point`` [m]
        self.box = np.zeros((num_walls, 2, 3))  #: around the points near each, of all ranks [m]
        self._moves = np.zeros(num_walls)

    def enclose(self, comm, walls, x, reach):
        """Find that place anew. Collective.

        Args:
            comm: MPI communicator.
            walls: :class:`~.walls.Walls` with their pairs.
            x: Positions of this rank's points of contact at the last search [m], (num_points, 3).
            reach: More than points move until the next one [m].
        """
        if x.size:
            self.farthest[:] = farthest(x, walls.point) + reach
        low, high = boxes_of_groups(x, walls.pairs.node, walls.pairs.wall, self._moves.size)
        both = np.stack([low, -high], axis=1)
        comm.Allreduce(MPI.IN_PLACE, both, op=MPI.MIN)
        both[:, 1] *= -1.0
        both += reach * np.array([[-1.0], [1.0]])
        self.box[:] = np.where(np.isfinite(both), both, 0.0)

    def motion_in(self, walls, field, dt):
        """How far a field brought points to the walls when these moved last, at most. Local.

        Args:
            walls: :class:`~.walls.Walls`.
            field: Velocity linear in the place, as in kernels.bulk.motion.
            dt: Length of that step [s].

        Returns:
            Distances [m], infinity for walls that turn, shape (num_walls,).
        """
        curved = walls.curved
        motion_to_walls(
            self._moves, field, walls.normal, walls.displacement, curved.growth, walls.turn,
            self.box, curved.radius, dt,
        )  # fmt: skip
        return self._moves
