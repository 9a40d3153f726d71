"""Parameters of a material that differ from grain to grain."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from ..units import check_keys, setting
from .elastic import IsotropicSolid

#: What may scatter, and the parameter of the material that it is.
SCATTERED = {"E": "E", "rho": "rho", "strength": "yield_stress"}
#: What each of them may be.
VARIATION = {"ge": 0, "le": 1, "expected": "a coefficient of variation, 0 to 1"}


@dataclass(frozen=True)
class Scatter:
    """[material.scatter]: factors of mean 1 on a material's parameters, one for each grain.

    The factors depend on the seed, the grain's label and the parameter alone: not on the ranks,
    nor on which other grains there are. Strengths of brittle grains follow Weibull's law.

    Raises:
        InputError: a coefficient of variation outside [0, 1], an unknown distribution or a
            seed < 0.
    """

    E: float = setting(0.0, "-", "coefficient of variation of Young's modulus", **VARIATION)
    rho: float = setting(0.0, "-", "the same of the density", **VARIATION)
    strength: float = setting(
        0.0, "-", "the same of all yield stresses of the grain's table", **VARIATION
    )
    distribution: str = setting("lognormal", "", 'or "weibull"', allowed=("lognormal", "weibull"))
    seed: int = setting(0, "", "of the random numbers", ge=0, plausible=(0, 2**63 - 1))

    def __post_init__(self):
        check_keys(self)

    def of(self, material: IsotropicSolid, label: int) -> IsotropicSolid:
        """The material of the grain ``label``.

        Raises:
            InputError: the material has no such parameter.
        """
        changes: dict[str, Any] = {}
        for i, (key, name) in enumerate(SCATTERED.items()):
            variation = getattr(self, key)
            if variation == 0.0:
                continue
            if not hasattr(material, name):
                raise InputError(f"{key} = {variation}, expected none: the material has no {name}")
            random = np.random.default_rng([self.seed, int(label), i])
            factor, value = self._factor(variation, random), getattr(material, name)
            if name == "yield_stress":
                changes[name] = tuple((strain, stress * factor) for strain, stress in value)
            else:
                changes[name] = value * factor
        return dataclasses.replace(material, **changes) if changes else material

    def _factor(self, variation, random):
        """A factor of mean 1 and that coefficient of variation."""
        if self.distribution == "lognormal":
            variance = math.log(1 + variation**2)
            return math.exp(math.sqrt(variance) * random.standard_normal() - 0.5 * variance)
        shape = weibull_shape(variation)
        return float(random.weibull(shape)) / math.gamma(1 + 1 / shape)


def weibull_shape(variation: float) -> float:
    """Modulus m of the Weibull law with a coefficient of variation ``variation``, by bisection.

    Variance over squared mean is G(1 + 2/m)/G(1 + 1/m)² - 1, G the gamma function.
    """
    low, high = 0.5, 1e6
    for _ in range(80):
        m = math.sqrt(low * high)
        spread = math.exp(math.lgamma(1 + 2 / m) - 2 * math.lgamma(1 + 1 / m)) - 1
        low, high = (m, high) if spread > variation**2 else (low, m)
    return math.sqrt(low * high)
