"""Force of a grain between platens over the displacement that a machine measures.

The platens approach by D. Each of n contacts takes δ, the machine's frame C F, and what is left is
the offset o at which the grain was first touched:

    D = o + n δ(F) + C F.

Platens are elastic. In the half-space of Hertz the elastic deflections of ball and platen add, as
1/E* = (1 - ν²)/E + (1 - ν_p²)/E_p; the table of the ball is entered with this E*. That is exact
before the grain yields, and once it flows it keeps the depth of elastic deflection and neglects
that the platen does not hold residual stresses back. Two like grains are to each other what a rigid
plane is.
"""

from dataclasses import dataclass

import numpy as np

from . import ball

#: Contacts that share the displacement, and whether a platen is part of each.
TESTS = {"platens": (2, True), "grains": (2, False), "platen": (1, True)}


@dataclass(frozen=True)
class Setup:
    """How grains were pressed."""

    nu: float  #: Poisson's ratio of the grains
    test: str = "platens"  #: between two platens; two like grains; on one platen, held elsewhere
    platen: tuple | None = None  #: Young's modulus [Pa] and Poisson's ratio; None: rigid
    shape: object = None  #: :class:`~.own_mesh.Shape`; None: a ball

    @property
    def contacts(self):
        """How many share the displacement."""
        return TESTS[self.test][0]

    def modulus(self, E):
        """E* of grain and platen [Pa]."""
        compliance = (1 - self.nu**2) / E
        if self.platen and TESTS[self.test][1]:
            compliance += (1 - self.platen[1] ** 2) / self.platen[0]
        return 1 / compliance

    def course(self, E, Y, H):
        """Approach over radius, force over radius² [Pa] and largest plastic strain of a ball.

        Args:
            E: Young's modulus of the grain [Pa].
            Y: Its yield stress [Pa].
            H: Slope of the yield stress over plastic strain [Pa].
        """
        modulus = self.modulus(E)
        delta, ratio, strain = ball.load().course(self.nu, Y / modulus, H / Y)
        if self.shape is not None:
            ratio = ratio * self.shape.ratio(delta, Y / modulus, H / Y)
        return delta, 4 / 3 * modulus * delta**1.5 * ratio, strain

    @property
    def longest(self):
        """Largest displacement over the radius that the table of the ball or runs know."""
        known = ball.load() if self.shape is None else self.shape
        return self.contacts * float(known.delta[-1])


def forces(curve, setup, course, offset, compliance):
    """Force at each displacement of a curve [N], and its slopes.

    Args:
        curve: :class:`~.data.Curve`.
        setup: :class:`Setup`.
        course: As by :meth:`Setup.course`.
        offset: [m].
        compliance: Of the machine [m/N].

    Returns:
        Forces [N], shape (num_rows,), and their derivatives by offset [N/m] and by compliance
        [N²/m], the same shape.
    """
    R = curve.size.radius
    delta, stress = course[:2]
    # Beyond the table a straight line: offsets and compliances that are tried may ask for it.
    far = 2.0 * delta[-1]
    beyond = stress[-1] + (stress[-1] - stress[-2]) / (delta[-1] - delta[-2]) * (far - delta[-1])
    F = np.concatenate([[0.0], stress, [beyond]]) * R**2
    D = np.concatenate([[0.0], delta, [far]]) * setup.contacts * R + compliance * F
    x = curve.displacement - offset
    force = np.interp(x, D, F)
    place = np.clip(np.searchsorted(D, x), 1, D.size - 1)
    slope = np.where(x > 0, (F[place] - F[place - 1]) / (D[place] - D[place - 1]), 0.0)
    return force, -slope, -slope * force
