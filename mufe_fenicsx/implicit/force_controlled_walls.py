"""Walls that are held at a force, in increments."""

import numpy as np

from ..solvers.broyden import Broyden

#: Force of a wall that is held at one, less its target, over it.
SERVO_TOLERANCE = 1e-3


class ForceControlledWalls:
    """Increments at whose end walls carry their forces, or move at their full speed. Collective.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`, with a servo on at least one wall.
        first_step: Length of the first increment [s].
    """

    def __init__(self, specimen, first_step):
        self._specimen = specimen
        walls = specimen.walls.walls
        self._which = np.array([wall.target is not None for wall in walls], dtype=bool)
        held = [wall for wall in walls if wall.target is not None]
        self._held = held
        self._fastest = np.array([wall.speed for wall in held])
        # As the servo of time steps: at full speed while nothing presses on it.
        slope = self._target / (self._fastest * first_step)
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
        return self._specimen.wall_forces()[self._which] - self._target

    def __call__(self, increment, take_back, dt):
        """One increment of length ``dt`` [s]; whether there is one.

        Args:
            increment: ``increment(dt)`` makes one with the walls' present velocities and says
                whether it converged.
            take_back: Undoes the one that was made last.
        """
        walls, made = self._specimen.walls, False
        numbers = np.flatnonzero(self._which)

        def excess(way):
            nonlocal made
            if made:
                take_back()
            for number, speed in zip(numbers, way / dt, strict=True):
                walls.set_speed(number, speed)
            made = increment(dt)
            return self._excess() if made else None

        found = self._search(excess, self._excess(), self._fastest * dt) is not None
        if made and not found:
            take_back()
        return found
