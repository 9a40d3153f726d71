"""Radii of cylinders and spheres that are walls, and facets that are part of them."""

import numpy as np

from ..errors import SolverError
from ..kernels.contact.walls import grow, work_of_growth
from ..state import Stateful

#: Facets whose corners are so near to a curved wall at the start, over their edge, are part of it.
ON_WALL = 1e-6


class CurvedWalls(Stateful):
    """Radii of the walls of all shapes, and what makes them change.

    Args:
        walls: List of :class:`~.walls.Wall`.
    """

    STATE = {"common": ("radius", "growth_rate", "growth"), "sum": ("pressing",)}

    def __init__(self, walls):
        self.radius = np.array([w.radius for w in walls], dtype=float)  #: 0 of a plane [m]
        self.growth_rate = np.array([w.growth_rate for w in walls], dtype=float)  #: [m/s]
        self.growth = np.zeros(len(walls))  #: of the distance to the axis in the last move [m]
        self.pressing = np.zeros(len(walls))  #: sum of this rank's normal forces on each [N]
        self.side = np.sign(self.radius)  #: 1 with the grains inside, -1 outside, 0 of a plane
        self.any = bool(self.side.any())
        #: Curvature of each at the start, positive with the grains inside [1/m].
        self.bend = np.divide(
            self.side, np.abs(self.radius), where=self.side != 0.0, out=0.0 * self.side
        )
        self._sag = None  # of points in facets that lie on a curved wall at the start [m]

    def measure_sag(self, walls, x, nodes, corner):
        """Take facets that lie on a curved wall at the start for parts of its surface. Local.

        A grain that the wall's surface cuts has facets there whose corners lie on the wall. Points
        in these are away from it by what a chord leaves of an arc, which is no gap.

        Args:
            walls: List of :class:`~.walls.Wall`.
            x: Of points of contact [m], shape (num_points, 3).
            nodes: Of surface nodes [m], shape (num_nodes, 3).
            corner: Own surface nodes around each point, shape (num_points, 3).
        """
        self._sag = np.full((len(x), len(walls)), np.nan)
        edge = np.linalg.norm(nodes[corner[:, 1]] - nodes[corner[:, 0]], axis=1)
        for w in np.flatnonzero(self.side):
            apart = np.abs(walls[w].gap(nodes))[corner].max(axis=1)
            on = apart < ON_WALL * edge  # no point at a node has an edge
            self._sag[on, w] = walls[w].gap(x[on])

    def sag_of(self, point, wall):
        """That of pairs [m], NaN of others, shape (num,); None without curved walls. Local."""
        return None if self._sag is None else self._sag[point, wall]

    def move(self, dt):
        """Grow for ``dt`` [s]; largest growth [m].

        Raises:
            SolverError: A radius is not positive any more; the same on all ranks.
        """
        if not self.any:
            return 0.0
        largest, vanished = grow(self.radius, self.growth, self.side, self.growth_rate, dt)
        if vanished:
            raise SolverError(
                "the radius of a wall has shrunk to nothing: raise growth_rate, or end before"
            )
        return largest

    def half_work(self):
        """Half of the work of the forces that act now along the last growth [J]."""
        return -0.5 * work_of_growth(self.pressing, self.side, self.growth)
