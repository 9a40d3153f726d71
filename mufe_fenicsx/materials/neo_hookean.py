"""Rubber: a solid whose deviator follows the stretch, at any stretch."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..units import setting
from .elastic import USUAL_E, USUAL_RHO, IsotropicSolid


@dataclass(frozen=True)
class NeoHookean(IsotropicSolid):
    """Neo-Hookean solid, W = G/2 (J^(-2/3) tr b - 3) + K (J ln J - J + 1) over its first volume.

    At small strain it is :class:`~.elastic.Elastic`. E, nu and rho are by default those of latex.
    Its time step is that of small strain: at a nu of 0.49 a stretch of 3 makes waves 4 % faster.

    What its contact layer takes for its stiffness is M, without lateral strain: a sheet that is
    thinner than its contacts are wide cannot give way sideways.
    """

    hyperelastic: ClassVar[bool] = True

    E: float = setting(
        1.4e6, "Pa", "Young's modulus", gt=0, expected="a stiffness > 0 Pa", usual=USUAL_E
    )
    nu: float = setting(0.49, "-", "Poisson's ratio", gt=-1, lt=0.5, plausible=(-0.99, 0.4999))
    rho: float = setting(
        950.0, "kg/m^3", "density", gt=0, expected="a density > 0 kg/m³", usual=USUAL_RHO
    )

    @property
    def contact_modulus(self) -> float:
        """M, its share in contact [Pa]."""
        return self.constrained_modulus

    def parameters(self) -> np.ndarray:
        """As of an elastic grain: it never yields."""
        return np.array([np.inf, 1.0, 0.0, np.inf])
