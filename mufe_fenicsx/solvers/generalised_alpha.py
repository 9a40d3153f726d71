"""Implicit time integration of the second order with controlled damping of high frequencies."""

from dataclasses import dataclass

from ..errors import InputError


@dataclass(frozen=True)
class GeneralisedAlpha:
    """Generalised-α method (J. Chung, G. M. Hulbert, J. Appl. Mech. 60, 1993, 371-375).

        M ((1 - αm) a1 + αm a0) = (1 - αf) f(u1, v1) + αf f(u0, v0)

    with Newmark's u1 = u0 + Δt v0 + Δt² ((1/2 - β) a0 + β a1), v1 = v0 + Δt ((1 - γ) a0 + γ a1).
    In a linear system it is of the second order and stable at any Δt; oscillations that the step
    cannot resolve are multiplied by ``radius`` in each one. At 1 it is the trapezoidal rule for
    αm = αf = 1/2, which keeps the energy of a linear system; at 0 such oscillations end at once.

    Raises:
        InputError: The radius is not in [0, 1].
    """

    radius: float = 0.8  #: spectral radius at infinite frequency [-]

    def __post_init__(self):
        if not 0 <= self.radius <= 1:
            raise InputError(f"spectral_radius = {self.radius}, expected 0 <= spectral_radius <= 1")

    @property
    def inertia_of_start(self):
        """αm, the weight of the first acceleration."""
        return (2 * self.radius - 1) / (self.radius + 1)

    @property
    def force_of_start(self):
        """αf, the weight of the first forces."""
        return self.radius / (self.radius + 1)

    @property
    def gamma(self):
        """γ of Newmark's method."""
        return 0.5 - self.inertia_of_start + self.force_of_start

    @property
    def beta(self):
        """β of Newmark's method."""
        return 0.25 * (1 - self.inertia_of_start + self.force_of_start) ** 2

    def acceleration(self, du, v, a, dt):
        """a1 that leads to the displacement ``du`` within ``dt`` from ``v`` and ``a``."""
        return (du - dt * v) / (self.beta * dt**2) - (0.5 / self.beta - 1) * a

    def velocity(self, a1, v, a, dt):
        """v1 of the acceleration ``a1``."""
        return v + dt * ((1 - self.gamma) * a + self.gamma * a1)

    def inertia_slope(self, dt):
        """Derivative of the weighted acceleration by the displacement [1/s²]."""
        return (1 - self.inertia_of_start) / (self.beta * dt**2)

    def velocity_slope(self, dt):
        """Derivative of the last velocity by the displacement [1/s]."""
        return self.gamma / (self.beta * dt)
