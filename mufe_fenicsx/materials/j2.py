"""Elasto-plasticity with the yield surface of von Mises and isotropic hardening."""

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .elastic import IsotropicSolid


@dataclass(frozen=True)
class J2(IsotropicSolid):
    """Isotropic elasticity up to a yield stress that grows with plastic strain.

    The yield stress is linear between the points of a table and constant after
    its last one: a single point is perfect plasticity.

    Raises:
        InputError: as `IsotropicSolid`; or the table is empty, does not start at
            plastic strain 0, does not increase in strain, or has a stress that
            is not > 0 or below the one before it (softening has no solution
            that is independent of the mesh).
    """

    yield_stress: tuple[tuple[float, float], ...]  #: (plastic strain [-], stress [Pa]) of points

    def __post_init__(self):
        super().__post_init__()
        points = self.yield_stress
        if not points:
            raise InputError("yield_stress = (), expected points (plastic strain, stress)")
        if points[0][0] != 0:
            raise InputError(
                f"yield_stress[0][0] = {points[0][0]}, expected plastic strain 0 at the first point"
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

    def parameters(self) -> np.ndarray:
        """Those of kernels.hardening: least yield stress, number of points, table."""
        strain, stress = np.array(self.yield_stress, dtype=np.float64).T
        return np.concatenate([[stress[0], strain.size], strain, stress])
