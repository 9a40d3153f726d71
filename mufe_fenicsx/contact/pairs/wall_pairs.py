"""Pairs of points of contact and walls."""

import numpy as np

from ...kernels.build.pair_rows import WALL_PAIR
from ...kernels.contact.walls import normal_forces, wall_energy
from .motion_bounds import WALLS, MotionBounds
from .table import PairTable


class WallPairs(PairTable):
    """Node-wall pairs of one rank. Arrays as in kernels.contact.walls."""

    def __init__(self, node, wall, points, bound, yields):
        walls = WALLS + wall.astype(np.int64)
        bounds = MotionBounds(points.grain_of_point[node], walls, bound)
        super().__init__(WALL_PAIR, node, bounds, bound, yields)
        self.wall = wall
        self.recess[:] = points.recess[node] - points.stands[node]

    @property
    def normal_force(self):
        """Normal forces on the nodes [N], made anew, shape (num_pairs,)."""
        return normal_forces(self.state)

    def energy(self):
        """Energy in the springs [J] and number of closed pairs."""
        return wall_energy(self.state, self.closed)
