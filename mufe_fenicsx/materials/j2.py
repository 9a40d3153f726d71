"""Elasto-plasticity with the yield surface of von Mises and isotropic hardening."""

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..units import REQUIRED, setting
from .elastic import IsotropicSolid

BEYOND = ("flat", "slope", "stop")
#: Plastic strain that no grain reaches.
FAR = 1e3


@dataclass(frozen=True)
class J2(IsotropicSolid):
    """Isotropic elasticity up to a yield stress that grows with plastic strain.

    The yield stress is linear between the points of a table. Beyond its last one it stays
    ("flat": a single point is perfect plasticity), goes on with the last slope ("slope"), or
    the computation stops ("stop"), for a table that must not be left.

    The table is of the Kirchhoff stress τ = J σ, which the flow rule limits. The von Mises stress
    of the Cauchy stress σ, which states show, is that of the table over J, the ratio of volumes:
    above it where a grain is compressed.

    Raises:
        InputError: as `IsotropicSolid`; or the table is empty, does not start at
            plastic strain 0, does not increase in strain, or has a stress that
            is not > 0 or below the one before it (softening has no solution
            that is independent of the mesh); or there is no such way beyond the table.
    """

    yield_stress: tuple[tuple[float, float], ...] = setting(
        REQUIRED,
        ("-", "Pa"),
        "plastic strain [-], yield stress of J σ [Pa]; beyond the last point as `beyond` says",
        shape=(-1, 2),
    )
    beyond: str = setting(
        "flat", "", 'the last point of the table: "flat", "slope" or "stop"', allowed=BEYOND
    )

    def __post_init__(self):
        super().__post_init__()
        points = self.yield_stress
        if not points:
            raise InputError("yield_stress = (), expected points (plastic strain, stress)")
        if points[0][0] != 0:
            raise InputError(
                f"yield_stress[0][0] = {points[0][0]}, expected plastic strain 0 at the first point"
            )
        if points[0][1] > self.E:
            raise InputError(
                f"yield_stress[0][1] = {points[0][1]:g} Pa, expected at most E = {self.E:g} Pa"
            )
        before, least = -math.inf, 0.0
        for i, (strain, stress) in enumerate(points):
            if not before < strain < math.inf:
                raise InputError(
                    f"yield_stress[{i}][0] = {strain}, expected a plastic strain > {before}, "
                    "the one before it"
                )
            if not (0 < stress < math.inf and stress >= least):
                raise InputError(
                    f"yield_stress[{i}][1] = {stress}, expected a stress "
                    + (f">= {least} Pa, the one before it" if i else "> 0 Pa")
                )
            before, least = strain, stress
        if self.beyond == "slope" and len(points) < 2:
            raise InputError('beyond = "slope", expected "flat" for a table of one point')

    @property
    def largest_plastic_strain(self) -> float:
        """Where the computation has to stop."""
        return self.yield_stress[-1][0] if self.beyond == "stop" else math.inf

    def yield_table(self) -> np.ndarray:
        """Plastic strains and yield stresses [Pa], shape (2, num_points)."""
        return self.parameters()[2:].reshape(2, -1)

    def parameters(self) -> np.ndarray:
        """Those of kernels.bulk.hardening: least yield stress, number of points, table."""
        points = list(self.yield_stress)
        if self.beyond == "slope":
            (strain, stress), (last_strain, last_stress) = points[-2:]
            slope = (last_stress - stress) / (last_strain - strain)
            points.append((FAR, last_stress + slope * (FAR - last_strain)))
        strain, stress = np.array(points, dtype=np.float64).T
        return np.concatenate([[stress[0], strain.size], strain, stress])
