"""Bodies held at their bases and moved by them: by time steps, or by static increments.

Both end in the state that `equilibrium` finds directly, and stand in for it.
"""

import math

import numpy as np
from mpi4py import MPI

from ..explicit.simulation import Simulation
from ..implicit.simulation import ImplicitSimulation
from .half_balls import slow_mass_factor

#: Durations of a move and of the rest after it, over the period of a body on its base.
MOVE, REST = 6.0, 6.0
#: Damping over the frequency of that.
DAMPING = 1.0
#: Way of an increment over the mean facet edge, at most.
LONGEST = 0.25
#: Residual that is none, over E* times the square of an edge: contacts are a hundredth as large.
NO_FORCE = 1e-11


class TimeSteps:
    """Damped time steps, with masses that make all elements about equally fast. Collective.

    Args:
        mesh, materials, walls, options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`.
        held: Pairs (nodes of this rank, unit vector (3,)): displacements along the vector are zero,
            or prescribed.
        height: Of the tallest body [m].
    """

    def __init__(self, mesh, materials, walls, held, height, **options):
        self.held = held
        slowest = min(math.sqrt(m.shear_modulus / m.rho) for m in materials)
        omega = 0.5 * math.pi * mesh.comm.allreduce(slowest, op=MPI.MIN) / height
        self.period = 2 * math.pi / omega
        options = {"damping": DAMPING * omega, "mass_factor": slow_mass_factor(mesh)} | options
        self.simulation = Simulation(mesh, materials, walls, **options)

    def move(self, nodes, way):
        """Move the ``nodes`` by ``way`` [m], (3,) or (num, 3), then wait for rest. Collective."""
        s, duration = self.simulation, MOVE * self.period
        start, gone = s.state.t, 0.0
        while (t := s.state.t) < start + duration:
            phase = min((t + 0.5 * s.dt - start) / duration, 1.0)
            rate = (1 - math.cos(2 * math.pi * phase)) / duration
            self._step(nodes, rate * way)
            gone += rate * s.state.dt
        self._step(nodes, (1 - gone) / s.dt * way)
        while s.state.t < start + duration + REST * self.period:
            self._step(nodes, 0.0 * way)

    def _step(self, nodes, velocity):
        s = self.simulation
        for held, d in self.held:
            for values in (s.state.v, s.state.a):
                values[held] -= np.outer(values[held] @ d, d)
        # The drift begins with half a step of damping.
        s.state.v[nodes] += velocity / (1.0 - 0.5 * s.dt * s.damping)
        s.step()

    def reaction(self, nodes, direction):
        """Force of the bodies on what holds ``nodes`` of this rank along ``direction`` [N]."""
        return _reaction(self.simulation, nodes, direction)


class Increments:
    """Static increments by products, one for each move unless it is long. Collective.

    Args:
        mesh, materials, walls, options: Of :class:`~.ImplicitSimulation`.
        held: As of :class:`TimeSteps`.
        height: Not needed.
    """

    def __init__(self, mesh, materials, walls, held, height, **options):
        options = {"linear_solver": "products", "stabilisation": 0.0} | options
        self.simulation = ImplicitSimulation(
            mesh, materials, walls, first_step=1.0, smallest_step=1.0, largest_step=1.0, held=held,
            no_force=NO_FORCE, **options,
        )  # fmt: skip

    def move(self, nodes, way):
        """Move the ``nodes`` by ``way`` [m], shape (3,) or (num, 3). Collective."""
        s = self.simulation
        longest = np.linalg.norm(np.atleast_2d(way), axis=1).max(initial=0.0)
        longest = s.comm.allreduce(float(longest), op=MPI.MAX)
        number = math.ceil(longest / (LONGEST * s.contact.edge)) or 1
        s.prescribed[:] = 0.0
        s.prescribed[nodes] = way / number
        for _ in range(number):
            s.step()

    def reaction(self, nodes, direction):
        """Force of the bodies on what holds ``nodes`` of this rank along ``direction`` [N]."""
        return _reaction(self.simulation, nodes, direction)


def _reaction(simulation, nodes, direction):
    forces = simulation.specimen.f[nodes]
    return simulation.comm.allreduce(float((forces @ direction).sum()))
