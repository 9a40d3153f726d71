"""Isotropic linear elasticity: parameters and the moduli that follow from them.

A material of one's own is a frozen dataclass derived from :class:`IsotropicSolid` with

- ``plastic_increment``: a law compiled by numba, with the arguments and the answer of
  :func:`~mufe_fenicsx.kernels.bulk.hardening.plastic_increment`, and
- ``parameters()``: the row of numbers that it receives, the first of which is the least
  von Mises stress at which the material can yield [Pa].

Registered with :func:`mufe_fenicsx.scene.register_material`, scene files can name it;
``demos/drucker_prager.py`` does all of that.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..units import REQUIRED, check_keys, setting

#: Stiffness [Pa] and density [kg/m³] of solids, from gels to diamond and from foam to gold.
USUAL_E, USUAL_RHO = (1e4, 1.5e12), (10.0, 3e4)


@dataclass(frozen=True)
class IsotropicSolid:
    """What every isotropic solid has: two elastic constants and a density.

    Raises:
        InputError: E or rho is not a finite number > 0, or nu outside ]-1, 0.5[.
    """

    #: Compiled law of plastic flow; None: kernels.bulk.hardening. A scene is read without it.
    plastic_increment: ClassVar = None
    #: Whether the deviator follows from the deformation, not from its rate: kernels.bulk.neo_hooke.
    hyperelastic: ClassVar[bool] = False

    E: float = setting(
        REQUIRED, "Pa", "Young's modulus", gt=0, expected="a stiffness > 0 Pa", usual=USUAL_E
    )
    nu: float = setting(REQUIRED, "-", "Poisson's ratio", gt=-1, lt=0.5, plausible=(-0.99, 0.4999))
    rho: float = setting(
        REQUIRED, "kg/m^3", "density", gt=0, expected="a density > 0 kg/m³", usual=USUAL_RHO
    )

    def __post_init__(self):
        check_keys(self)

    @property
    def largest_plastic_strain(self) -> float:
        """Plastic strain at which the computation has to stop [-]."""
        return math.inf

    @property
    def bulk_modulus(self) -> float:
        """K = E / (3 (1 - 2ν)) [Pa]."""
        return self.E / (3 * (1 - 2 * self.nu))

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + ν)) [Pa]."""
        return self.E / (2 * (1 + self.nu))

    @property
    def constrained_modulus(self) -> float:
        """M = K + 4/3 G, the stiffness without lateral strain [Pa]."""
        return self.bulk_modulus + 4 / 3 * self.shear_modulus

    @property
    def contact_modulus(self) -> float:
        """E / (1 - ν²), one body's share in Hertz contact [Pa]."""
        return self.E / (1 - self.nu**2)

    @property
    def wave_speed(self) -> float:
        """Speed of compression waves √(M/ρ) [m/s]."""
        return math.sqrt(self.constrained_modulus / self.rho)

    def yield_table(self) -> np.ndarray | None:
        """Plastic strains and yield stresses [Pa] of von Mises, shape (2, num_points), or None.

        They limit the pressure of contacts smaller than an element.
        """
        return None


@dataclass(frozen=True)
class Elastic(IsotropicSolid):
    """Linear elasticity without a yield stress."""

    def parameters(self) -> np.ndarray:
        """Those of kernels.bulk.hardening: one point, the yield stress is infinite."""
        return np.array([np.inf, 1.0, 0.0, np.inf])
