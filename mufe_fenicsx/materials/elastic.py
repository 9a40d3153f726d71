"""Isotropic linear elasticity: parameters and the moduli that follow from them."""

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError


@dataclass(frozen=True)
class IsotropicSolid:
    """What every isotropic solid has: two elastic constants and a density.

    Raises:
        InputError: E or rho is not a finite number > 0, or nu outside ]-1, 0.5[.
    """

    E: float  #: Young's modulus [Pa]
    nu: float  #: Poisson's ratio [-]
    rho: float  #: density [kg/m³]

    def __post_init__(self):
        if not 0 < self.E < math.inf:
            raise InputError(f"E = {self.E}, expected a stiffness > 0 Pa")
        if not -1.0 < self.nu < 0.5:
            raise InputError(f"nu = {self.nu}, expected -1 < nu < 0.5")
        if not 0 < self.rho < math.inf:
            raise InputError(f"rho = {self.rho}, expected a density > 0 kg/m³")

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


@dataclass(frozen=True)
class Elastic(IsotropicSolid):
    """Linear elasticity without a yield stress."""

    def table(self) -> tuple[np.ndarray, np.ndarray]:
        """A hardening table of one point: the yield stress is infinite."""
        return np.zeros(1), np.full(1, np.inf)
