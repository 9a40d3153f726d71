"""Friction from tests in which a contact under a normal force is sheared.

Before it slides, a contact of elastic bodies gives way as Mindlin found,

    Q = μP [1 - (1 - 2kδ/3μP)^(3/2)],  and Q = μP from δ = 3μP/2k on,

with the stiffness k at rest. Measured contacts are softer than Mindlin's k, so that it is an
unknown of each curve, beside the offset; the friction μ is that of all.

Source: K. L. Johnson, Contact Mechanics, 1985, section 7.2.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from .covariance import covariance_of
from .data import FRICTION

#: Part of the way to sliding beyond which a curve tells the friction.
SLIDES = 0.9


@dataclass(frozen=True)
class Friction:
    """What was found."""

    mu: float
    interval: tuple[float, float]  #: of 95 %
    stiffness: np.ndarray  #: of each curve at rest [N/m], shape (num_curves,)
    forces: list  #: tangential forces [N] of the fit for each curve
    sliding: int  #: curves that come to slide, or nearly


def mindlin_force(displacement, stiffness, limit):
    """Tangential force Q [N] at displacements [m], ``limit`` = μP; the formula above."""
    way = np.clip(2 * stiffness * displacement / (3 * limit), 0.0, 1.0)
    return limit * (1 - (1 - way) ** 1.5)


def fit_friction(curves):
    """Friction, and stiffness of each curve, by least squares. Local.

    Args:
        curves: List of :class:`~.data.Rubbed`.

    Returns:
        :class:`Friction`.
    """
    n = len(curves)
    reach = np.array([np.ptp(c.displacement) for c in curves])
    first = np.array([c.displacement.min() for c in curves])
    ratio = np.array([np.max(c.force / c.normal) for c in curves])
    soft = np.array([c.force.max() for c in curves]) / reach

    def parts(x):
        return math.exp(x[0]), soft * np.exp(x[1 : n + 1]), first + reach * x[n + 1 :]

    def found(x):
        mu, stiffness, offset = parts(x)
        return [
            mindlin_force(c.displacement - o, k, mu * c.normal)
            for c, k, o in zip(curves, stiffness, offset, strict=True)
        ]

    def residual(x):
        return np.concatenate(
            [(f - c.force) / c.normal for f, c in zip(found(x), curves, strict=True)]
        )

    starts = [np.concatenate([[math.log(ratio.max())], np.full(n, s), np.zeros(n)])
              for s in (0.5, 1.5, 3.0)]  # fmt: skip
    # A curve that does not slide is a line: any larger friction fits as well.
    bounds = np.full(2 * n + 1, -np.inf), np.full(2 * n + 1, np.inf)
    bounds[0][0], bounds[1][0] = np.log(FRICTION)
    best = min(
        (least_squares(residual, np.clip(x, *bounds), bounds=bounds, x_scale="jac")
         for x in starts), key=lambda b: b.cost,
    )  # fmt: skip
    sizes = [c.force.size for c in curves]
    covariance, freedom = covariance_of(best.jac, best.fun, sizes, best.active_mask == 0)
    half = student.ppf(0.975, freedom) * math.sqrt(covariance[0, 0])
    mu, stiffness, offset = parts(best.x)
    ways = [2 * k * (c.displacement.max() - o) / (3 * mu * c.normal.mean())
            for c, k, o in zip(curves, stiffness, offset, strict=True)]  # fmt: skip
    return Friction(
        mu, (mu * math.exp(-half), mu * math.exp(min(half, 50.0))), stiffness, found(best.x),
        int(np.sum(np.array(ways) > SLIDES)),
    )  # fmt: skip
