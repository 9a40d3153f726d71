"""[membrane]: the sleeve of a sample in a triaxial cell."""

import math
from dataclasses import dataclass

from ..materials.elastic import USUAL_E, USUAL_RHO
from ..materials.neo_hookean import NeoHookean
from ..units import check_keys, setting

#: Fewest edges around, if the scene states no length of edges; and their length over thickness.
AROUND, OVER_THICKNESS = 30, 2.0


@dataclass(frozen=True)
class MembraneSettings:
    """[membrane]: a sleeve of rubber in place of the side of a cylinder, in a cell of fluid.

    Its friction with grains is that of [walls.side].
    """

    thickness: float = setting(0.3e-3, "m", "of its wall", gt=0)
    E: float = setting(1.4e6, "Pa", "Young's modulus of the rubber", gt=0, usual=USUAL_E)
    nu: float = setting(
        0.49, "-", "Poisson's ratio of the rubber", gt=0, lt=0.5, plausible=(0.01, 0.4999)
    )
    rho: float = setting(
        950.0,
        "kg/m^3",
        "its density; a light one follows the cell's pressure sooner",
        gt=0,
        usual=USUAL_RHO,
    )
    size: float | None = setting(
        None, "m", "length of its edges; None: twice the thickness, or less where it is narrow",
        gt=0,
    )  # fmt: skip
    layers: int = setting(1, "", "elements through its wall", gt=0, plausible=(1, 8))
    gap: float | None = setting(
        None, "m", "between it and the grains at the start; None: a twentieth of the thickness",
        gt=0,
    )  # fmt: skip
    damping: float | None = setting(
        None, "s^-1", "rate at which the fluid stills it; None: twice its frequency of breathing",
        ge=0,
    )  # fmt: skip
    correction: bool = setting(True, "", "its share of the axial force is left out of stresses")

    def __post_init__(self):
        check_keys(self)

    @property
    def material(self) -> NeoHookean:
        """Its rubber."""
        return NeoHookean(E=self.E, nu=self.nu, rho=self.rho)

    def edge(self, radius: float) -> float:
        """Length of its edges [m] around a sample of that ``radius`` [m]."""
        if self.size is not None:
            return self.size
        return min(OVER_THICKNESS * self.thickness, 2.0 * math.pi * radius / AROUND)

    def rate(self, radius: float) -> float:
        """Rate of its damping [1/s] around a sample of that ``radius`` [m]."""
        if self.damping is not None:
            return self.damping
        return 2.0 * math.sqrt(self.E / self.rho) / radius

    @property
    def room(self) -> float:
        """Between it and the grains at the start [m]."""
        return 0.05 * self.thickness if self.gap is None else self.gap
