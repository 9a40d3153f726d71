"""Strength of grains from the forces at which they broke: Weibull's law by maximum likelihood.

The strength of a grain of diameter d that breaks under the force F is by convention

    σ = F/d²  (J. C. Jaeger, Int. J. Rock Mech. Min. Sci. 4, 1967, 219-227),

of which the tension that splits it is 0.9 (Y. Hiramatsu, Y. Oka 1966), and the part of grains that
survives a stress is

    P(σ) = exp[-(σ/s)^m],  s = σ₀ (d/d₀)^(-b),

with d₀ the geometric mean of the diameters. By Weibull's weakest link the exponent b is 3/m where
flaws are in the volume (G. R. McDowell, M. D. Bolton, Géotechnique 48, 1998, 667-679); here it is
an unknown where sizes differ enough, and 0 where not. Intervals are those of the likelihood ratio
(J. F. Lawless, Statistical Models and Methods for Lifetime Data, 2003, section 5.2).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, minimize
from scipy.stats import chi2

from ..errors import InputError

#: Largest over smallest size, and number of grains, from which on b is an unknown.
SPREAD, ENOUGH = 1.5, 10
#: Deviation of the logarithms of strengths below which no modulus is sought.
ALIKE = 1e-6


@dataclass(frozen=True)
class Weibull:
    """What was found; intervals are of 95 %."""

    modulus: float  #: m
    modulus_interval: tuple[float, float]
    strength: float  #: σ₀ [Pa], which 37 % survive
    strength_interval: tuple[float, float]
    size: float  #: d₀ [m]
    exponent: float  #: b; 0 where sizes are alike
    exponent_interval: tuple[float, float] | None  #: None where it was not sought
    stresses: np.ndarray  #: σ of each grain [Pa], shape (num_grains,)
    scaled: np.ndarray  #: the same brought to the size d₀, shape (num_grains,)


def fit_weibull(forces, diameters):
    """Weibull modulus, strength and effect of size. Local.

    Args:
        forces: At which grains broke [N], shape (num_grains,).
        diameters: Of these [m], shape (num_grains,).

    Returns:
        :class:`Weibull`.

    Raises:
        InputError: Strengths are alike, or hang on the size alone.
    """
    stresses = np.asarray(forces) / np.asarray(diameters) ** 2
    y, x = np.log(stresses), np.log(diameters)
    size = x.mean()
    x = x - size
    sought = bool(np.ptp(x) > math.log(SPREAD) and y.size >= ENOUGH)
    level = y.mean()
    scatter = float(np.std(y - np.polyval(np.polyfit(x, y, int(sought)), x)))
    if scatter < ALIKE:
        raise InputError(f"strengths scatter by {scatter:.2g}, expected {ALIKE:g} of them or more")
    # Of the logarithms: log m, log σ₀ over the mean, b.
    start = np.array([math.log(1.2 / scatter), 0.0, 0.0])[: 3 if sought else 2]

    def minus(p):
        m, b = math.exp(min(p[0], 50.0)), p[2] if sought else 0.0
        z = m * (y - level - p[1] + b * x)
        return float(np.sum(np.exp(np.minimum(z, 500.0)) - z) - y.size * p[0])

    best = minimize(minus, start, method="Nelder-Mead",
                    options={"xatol": 1e-8, "fatol": 1e-10, "maxiter": 4000})  # fmt: skip
    ends = [_profile(minus, best, i) for i in range(start.size)]
    m, strength = math.exp(best.x[0]), math.exp(level + best.x[1])
    b = float(best.x[2]) if sought else 0.0
    return Weibull(
        m, tuple(np.exp(ends[0]).tolist()),
        strength, tuple(np.exp(level + np.array(ends[1])).tolist()),
        math.exp(size), b, tuple(ends[2]) if sought else None,
        stresses, stresses * np.exp(b * x),
    )  # fmt: skip


def _profile(minus, best, i):
    """Ends of the interval of one unknown: where the likelihood falls by χ²₀.₉₅/2 at best."""
    others = [j for j in range(best.x.size) if j != i]

    def excess(value):
        def held(rest):
            p = np.empty(best.x.size)
            p[i], p[others] = value, rest
            return minus(p)

        found = minimize(held, best.x[others], method="Nelder-Mead",
                         options={"xatol": 1e-7, "fatol": 1e-9})  # fmt: skip
        return 2 * (found.fun - best.fun) - chi2.ppf(0.95, 1)

    ends = []
    for side in (-1, 1):
        step = 0.05
        while excess(best.x[i] + side * step) < 0.0 and step < 50.0:
            step *= 1.7
        ends.append(float(brentq(excess, best.x[i], best.x[i] + side * step, xtol=1e-5)))
    return ends
