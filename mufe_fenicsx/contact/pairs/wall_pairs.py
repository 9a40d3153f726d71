"""Pairs of points of contact and walls."""

import numpy as np

from ...kernels.pairs import column, rows
from ...kernels.walls import COLUMNS, ROW
from ...state import Stateful
from .motion_bounds import WALLS, MotionBounds

#: What a pair keeps when the pairs are searched anew.
REMEMBERED = (
    *("gap", "offset", "closed", "stick_point", "shear", "slip", "normal_force", "sliding"),
    *("dent", "yield_depth", "slope_left"),
)


class WallPairs(Stateful):
    """Node-wall pairs of one rank. Arrays as in kernels.walls."""

    STATE = {"here": ("next_check", "state", "bounds")}
    #: What a checkpoint keeps of each pair.
    KEPT = ("next_check", *REMEMBERED, "work")

    def __init__(self, node, wall, grain_of_point, bound):
        n = node.size
        self.node, self.wall = node, wall
        walls = WALLS + wall.astype(np.int64)
        self.motion_bounds = MotionBounds(grain_of_point[node], walls, bound)
        self.next_check = np.full(n, bound)
        self.state = rows(n, ROW)
        for name in (*REMEMBERED, "work", "stiffness", "softer", "bend", "edge", "recess"):
            setattr(self, name, column(self.state, name, COLUMNS))
        self.gap[:] = np.inf
        self.forces = None  #: kernels.walls.WallForces, once they are wanted

    @property
    def bounds(self):
        """Of motion relative to walls, of each grain and wall [m]."""
        return self.motion_bounds.bounds
