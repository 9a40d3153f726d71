"""The state at the start of an increment, to come back to, and walls that are held at a force."""

import numpy as np

from ..solvers.broyden import Broyden

#: What an increment changes in the state and of the walls.
OF_STATE = ("x", "u", "v", "a", "deviator", "plastic_strain", "plastic_work")
OF_WALLS = ("point", "normal", "rotation", "force", "torque")
#: Force of a wall that is held at one, less its target, over it.
SERVO_TOLERANCE = 1e-3


class IncrementStart:
    """A copy of all that an increment changes but contacts (contact.rewind). Local.

    Args:
        simulation: :class:`~.implicit.ImplicitSimulation`.

    Attributes:
        state: Arrays by their names in ``OF_STATE``.
        force: Sum of all forces on the nodes [N], shape (num_nodes, 3).
    """

    def __init__(self, simulation):
        s, walls = simulation.state, simulation.walls
        self.state = {name: getattr(s, name).copy() for name in OF_STATE}
        self.force = simulation._f.copy()
        self._walls = {name: getattr(walls, name).copy() for name in OF_WALLS}
        self._work, self._bonded = walls.work, simulation.bonded.before.copy()

    def restore(self, simulation):
        """Make the simulation what it was; its walls have been turned back."""
        for name, values in self.state.items():
            getattr(simulation.state, name)[:] = values
        for name, values in self._walls.items():
            getattr(simulation.walls, name)[:] = values
        simulation.walls.work, simulation._f[:] = self._work, self.force
        simulation.bonded.before[:] = self._bonded


class HeldWalls:
    """Increments at whose end walls carry their forces, or move at their full speed. Collective.

    Args:
        simulation: :class:`~.implicit.ImplicitSimulation`, with a servo on at least one wall.
    """

    def __init__(self, simulation):
        self._simulation = simulation
        walls = simulation.walls.walls
        self._which = np.array([wall.target is not None for wall in walls], dtype=bool)
        held = [wall for wall in walls if wall.target is not None]
        self._held = held
        self._fastest = np.array([wall.speed for wall in held])
        # As the servo of time steps: at full speed while nothing presses on it.
        slope = self._target / (self._fastest * simulation.first_step)
        self._search = Broyden(slope, SERVO_TOLERANCE * self._target)

    @property
    def _target(self):
        """Forces to hold now [N]."""
        return np.array([wall.target for wall in self._held])

    @property
    def num_trials(self):
        """Increments that the last call tried."""
        return self._search.num_evaluations

    def _excess(self):
        return self._simulation.wall_forces()[self._which] - self._target

    def __call__(self, increment, take_back, dt):
        """One increment of length ``dt`` [s]; whether there is one.

        Args:
            increment: ``increment(dt)`` makes one with the walls' present velocities and says
                whether it converged.
            take_back: Undoes the one that was made last.
        """
        walls, made = self._simulation.walls, False
        normal = walls.normal[self._which]

        def excess(way):
            nonlocal made
            if made:
                take_back()
            walls.velocity[self._which] = (way / dt)[:, None] * normal
            made = increment(dt)
            return self._excess() if made else None

        found = self._search(excess, self._excess(), self._fastest * dt) is not None
        if made and not found:
            take_back()
        return found
