"""A ball on an elastic platen: a half-space that recedes under the pressure (Boussinesq)."""

import math

import numpy as np
from scipy.special import ellipe, ellipk

from .solver import Ball

#: The platen's surface is found when it changes by less than this part of the approach, within so
#: many rounds.
CHANGE, ROUNDS = 1e-4, 40


class BallOnPlaten(Ball):
    """As :class:`~.solver.Ball`, with a platen that is elastic.

    The approach is that of the ball's plane of symmetry and of what is far within the platen.

    Args:
        modulus: E/(1 - ν²) of the platen over Young's modulus of the ball.
        others: Of :class:`~.solver.Ball`.
    """

    def __init__(self, *others, modulus):
        super().__init__(*others)
        self.modulus = modulus
        self.sunk = np.zeros(self.along.size)

    def _gap(self, x):
        return super()._gap(x) + self.sunk

    def press(self, delta):
        """Bring ball and platen to rest at the approach ``delta``.

        Returns:
            :class:`~.solver.State`.

        Raises:
            RuntimeError: As of :class:`~.solver.Ball`, or the platen does not come to rest.
        """
        start = self.delta, self.forms.w_before.x.array.copy(), self.forms.state.x.array.copy()
        rate = getattr(self, "rate", None)
        if self.delta:
            self.sunk = self.sunk * (delta / self.delta)
        for _ in range(ROUNDS):
            self.delta, self.rate = start[0], rate
            self.forms.w_before.x.array[:], self.forms.state.x.array[:] = start[1:]
            state = super().press(delta)
            change = self._deflection(state.push) - self.sunk
            # Ball and platen share the approach as 1 to 1/modulus.
            self.sunk = self.sunk + change / (1 + 1 / self.modulus)
            if np.abs(change).max() < CHANGE * delta:
                return state
        raise RuntimeError(f"approach = {delta:g} R: the platen moves by {np.abs(change).max():g}")

    def _deflection(self, push):
        """Of the platen at the nodes, under even pressures on rings between vertices.

        Source: K. L. Johnson, Contact Mechanics, 1985, eqs (3.29).
        """
        r = self.first[:, 0]
        ends = r[::2]  # every other node is in the middle of an edge
        force = push[1::2][: ends.size - 1] + 0.5 * (push[::2][:-1] + push[::2][1:])
        force[0] += 0.5 * push[0]
        pressure = force / (math.pi * np.diff(ends**2))
        discs = np.array([_under_disc(r, a) for a in ends])
        return 4 / (math.pi * self.modulus) * (pressure @ np.diff(discs, axis=0))


def _under_disc(r, a):
    """Deflection of a half-space under an even pressure on a disc, in units of 4 p/πE*."""
    if a == 0.0:
        return np.zeros_like(r)
    inside, m = r <= a, np.minimum((r / a) ** 2, 1.0)
    far = np.minimum((a / np.maximum(r, a)) ** 2, 1.0 - 1e-15)
    return np.where(inside, a * ellipe(m), r * (ellipe(far) - (1 - far) * ellipk(far)))
