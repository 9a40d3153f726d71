"""Two halves of balls, or caps of them, glued to platens, that touch at their poles."""

import math
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from ..contact.walls import Wall, rotation_of
from ..geometry.bodies.half_ball import half_ball
from ..run.from_bodies import distribute, simulate

#: Rows: along, across and up. Nothing is aligned with the axes.
FRAME = rotation_of(np.array([0.7, -0.4, 1.1]))
ALONG, ACROSS, UP = FRAME
#: Mass added to small elements, over that of the bodies, where only slow loading is of interest.
ADDED = 0.3


@dataclass(frozen=True)
class HalfBalls:
    """Two like caps that touch at the origin, with the common normal ``UP``."""

    radius: float  #: of both balls [m]
    height: float  #: of the caps [m]
    contact_radius: float  #: for which the mesh is made [m]
    h: float  #: length of edges there [m]
    growth: float  #: of the element size with the distance
    rolled: float = 0.0  #: turn of the top about ``ACROSS``, of the low one against it [rad]

    def make(self):
        """Bodies (points, cells) and walls "low" and "top".

        Both bodies are turned about the normal by odd angles, and about their centres so that
        their poles, which are nodes, miss each other: a contact in general position.
        The walls pass through their bases, with a point on the normal through the origin.
        """
        bodies, walls = [], []
        for name, side, spin, tilt in (
            ("low", 1, 0.3, (0.37, -0.21)),
            ("top", -1, 1.9, (-0.28, -0.43)),
        ):
            points, cells = half_ball(
                self.radius, self.h, self.growth, side * UP, self.contact_radius, height=self.height
            )
            roll = (tilt[0] * ALONG + tilt[1] * ACROSS) * self.h / self.radius
            rolled = rotation_of(-side * self.rolled * ACROSS)
            turn = rolled @ rotation_of(roll) @ rotation_of(spin * UP)
            centre, axis = -side * self.radius * UP, side * turn @ UP
            bodies.append((points @ turn.T + centre, cells))
            base = centre + (self.radius - self.height) * axis
            walls.append(Wall(name, (base @ axis) / (UP @ axis) * UP, axis, bonded=True))
        return bodies, walls

    def simulation(self, comm, material, friction, added_mass=ADDED, **options):
        """Both caps at rest, each on one rank where there are two. Collective.

        Args:
            comm, material: What they are made of, and where.
            friction: Coefficient of friction.
            added_mass: As of :func:`slow_mass_factor`; 0 for none.
            options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`, and ``increment``.
        """
        bodies, walls = self.make()
        mesh = distribute(comm, bodies)
        return simulate(
            mesh,
            [material] * mesh.num_grains,
            walls,
            friction=friction,
            mass_factor=slow_mass_factor(mesh, added_mass) if added_mass else None,
            **options,
        )

    def frequency(self, material):
        """About the lowest that shakes a cap on its base [rad/s]: a quarter of a shear wave."""
        return 0.5 * math.pi * math.sqrt(material.shear_modulus / material.rho) / self.height


def slow_mass_factor(mesh, added=ADDED):
    """Factors of nodal masses that make all elements about equally fast, as static loading allows.

    An element of the size h then has the frequency of one of the size H: the factor is
    max(1, H/h)², with H such that the mass grows by the part ``added`` altogether. Waves pass
    the fine region more slowly: loads have to change slowly beside that too. Collective.
    """
    edges = mesh.x[mesh.cells[:, 1:]] - mesh.x[mesh.cells[:, :1]]
    quarter = np.repeat(np.linalg.det(edges) / 24, 4)
    volume = np.bincount(mesh.cells.ravel(), quarter, mesh.num_nodes)
    h = np.cbrt(volume)
    low, high = 0.0, mesh.comm.allreduce(float(h.max()), op=MPI.MAX)
    for _ in range(40):
        H = 0.5 * (low + high)
        total = mesh.comm.allreduce(
            np.array([volume.sum(), (volume * np.maximum(1, H / h) ** 2).sum()])
        )
        low, high = (H, high) if total[1] < (1 + added) * total[0] else (low, H)
    return np.maximum(1, low / h) ** 2


def low_load(s):
    """Force of the sample on the lower platen along, across and up [N]. Collective."""
    force, _ = s.walls.loads(s.comm)
    return FRAME @ force[s.walls.names.index("low")]


def displacement(s, name):
    """Of a platen since the start, along, across and up [m]."""
    i = s.walls.names.index(name)
    return FRAME @ (s.walls.point[i] - s.walls.walls[i].point)
