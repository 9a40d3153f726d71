"""Least squares over all curves at once: one material, and what belongs to each curve.

Unknowns are the logarithms of Young's modulus, of the yield stress and of the slope of hardening,
the compliance of the machine, and an offset of each curve. Residuals are differences of forces over
their scatter, which is in proportion to the force beyond a part of the largest.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from ..errors import InputError
from .covariance import covariance_of
from .model import forces

MATERIAL = ("E", "yield", "hardening")
#: Part of the largest force of a curve below which the scatter does not fall with it.
FLOOR = 0.05
#: Of H/Y, and of Y and H over E at most.
HARDENING = (0.02, 4000.0)
#: Starting values of Y/E and H/Y.
STARTS = tuple((y, k) for y in (2e-4, 2e-3, 1e-2, 4e-2) for k in (2.0, 40.0, 400.0))
#: Evaluations that each start has, and how many of the best go on.
FEW, FURTHER = 5, 3


@dataclass(frozen=True)
class Given:
    """What is not sought but given."""

    E: float | None = None  #: Young's modulus [Pa]
    offset: float | None = None  #: of all curves [m]
    compliance: float | str = "common"  #: of the machine [m/N], or one unknown: "common" or "each"


@dataclass
class Fit:
    """What was found."""

    names: list  #: of the unknowns, shape (num_unknowns,)
    values: np.ndarray  #: natural logarithms of E, yield [Pa], hardening [Pa]; else SI units
    covariance: np.ndarray  #: shape (num_unknowns, num_unknowns)
    freedom: int  #: degrees of freedom of the intervals
    curves: list  #: forces [N] of the model for each curve
    scatter: float  #: standard deviation of force over force
    strain: float  #: largest plastic strain that any grain reached
    yields: float  #: largest approach over that of first yield
    straying: float  #: correlation of neighbours among the residuals
    held: list  #: names of unknowns at an end of what is sought, without an interval
    material: dict  #: E, yield, hardening [Pa], given or found

    def interval(self, name):
        """Ends of the interval of 95 %, in SI units."""
        i = self.names.index(name)
        half = student.ppf(0.975, self.freedom) * math.sqrt(self.covariance[i, i])
        low, high = self.values[i] - half, self.values[i] + half
        return (math.exp(low), math.exp(min(high, 700.0))) if name in MATERIAL else (low, high)

    def value(self, name):
        """A value in SI units."""
        value = float(self.values[self.names.index(name)])
        return math.exp(value) if name in MATERIAL else value

    @property
    def correlation(self):
        """Of all unknowns, shape (num_unknowns, num_unknowns)."""
        scale = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        return self.covariance / np.outer(scale, scale)


class Problem:
    """Residuals of all curves and their slopes.

    Args:
        curves: List of :class:`~.data.Curve`.
        setup: :class:`~.model.Setup`.
        given: :class:`Given`.
    """

    def __init__(self, curves, setup, given):
        self.curves, self.setup, self.given = curves, setup, given
        n = len(curves)
        self.names = [name for name in MATERIAL if name != "E" or given.E is None]
        self.num_material = len(self.names)
        self.machine = {"common": 1, "each": n}.get(given.compliance, 0)
        labels = ["compliance"] if self.machine == 1 else [f"compliance {c.name}" for c in curves]
        self.names = self.names + labels[: self.machine]
        if given.offset is None:
            self.names += [f"offset {c.name}" for c in curves]
        #: Lengths and compliances that values are measured by.
        self.reach = np.array([np.ptp(c.displacement) for c in curves])
        self.soft = float(np.median([np.ptp(c.displacement) / c.force.max() for c in curves]))
        self.weights = [1 / (np.abs(c.force) + FLOOR * c.force.max()) for c in curves]

    def parts(self, x):
        """log E, log Y, log H/Y; compliances [m/N] and offsets [m] of each curve."""
        material = list(x[: self.num_material])
        if self.given.E is not None:
            material.insert(0, math.log(self.given.E))
        n, at = len(self.curves), self.num_material
        if self.machine:
            compliance = np.broadcast_to(x[at : at + self.machine] * self.soft, n)
        else:
            compliance = np.full(n, float(self.given.compliance))
        offset = np.full(n, self.given.offset)
        if self.given.offset is None:
            offset = x[at + self.machine :] * self.reach
        return material, compliance, offset

    def predict(self, x):
        """Forces and slopes of each curve, as by :func:`~.model.forces`."""
        (log_E, log_Y, log_k), compliance, offset = self.parts(x)
        E, Y = math.exp(log_E), math.exp(log_Y)
        course = self.setup.course(E, Y, Y * math.exp(log_k))
        return [
            forces(curve, self.setup, course, o, c)
            for curve, o, c in zip(self.curves, offset, compliance, strict=True)
        ]

    def residual(self, x):
        """Differences of forces over their scatter, shape (num_rows of all,)."""
        return np.concatenate([
            w * (found[0] - curve.force)
            for w, found, curve in zip(self.weights, self.predict(x), self.curves, strict=True)
        ])  # fmt: skip

    def slopes(self, x):
        """Derivatives of the residuals, shape (num_rows of all, num_unknowns)."""
        J = np.zeros((sum(w.size for w in self.weights), x.size))
        step = 1e-4
        for i in range(self.num_material):
            up, down = x.copy(), x.copy()
            up[i] += step
            down[i] -= step
            J[:, i] = (self.residual(up) - self.residual(down)) / (2 * step)
        start, at = 0, self.num_material
        for i, (w, found) in enumerate(zip(self.weights, self.predict(x), strict=True)):
            rows = slice(start, start + w.size)
            start += w.size
            if self.machine:
                J[rows, at + (i if self.machine > 1 else 0)] = w * found[2] * self.soft
            if self.given.offset is None:
                J[rows, at + self.machine + i] = w * found[1] * self.reach[i]
        return J

    def start(self, y, k):
        """Unknowns from Y/E and H/Y: E from the largest forces, no compliance, no offset."""
        E = self.given.E
        if E is None:
            E = 1e11
            for _ in range(6):  # the larger E, the larger all stresses
                course = self.setup.course(E, y * E, k * y * E)
                found = [forces(c, self.setup, course, 0.0, 0.0)[0].max() for c in self.curves]
                ratio = np.median(
                    [c.force.max() / f for c, f in zip(self.curves, found, strict=True)]
                )
                E = float(np.clip(E * ratio, 1e6, 1e13))
        material = [math.log(E), math.log(y * E), math.log(k)]
        x = np.zeros(len(self.names))
        x[: self.num_material] = material[3 - self.num_material :]
        if self.given.offset is None:
            first = [c.displacement.min() for c in self.curves]
            x[self.num_material + self.machine :] = np.array(first) / self.reach
        return x

    def bounds(self):
        """Lowest and highest values of the unknowns."""
        low, high = np.full(len(self.names), -np.inf), np.full(len(self.names), np.inf)
        k = self.num_material - 1
        low[k], high[k] = np.log(HARDENING)
        low[k - 1], high[k - 1] = math.log(1e2), math.log(1e12)
        if self.given.E is None:
            low[0], high[0] = math.log(1e5), math.log(1e14)
        low[self.num_material : self.num_material + self.machine] = 0.0
        return low, high


def fit_curves(curves, setup, given=None, progress=None):
    """Material, compliance and offsets that fit all curves best. Local.

    Args:
        curves: List of :class:`~.data.Curve`.
        setup: :class:`~.model.Setup`.
        given: :class:`Given`, or None.
        progress: Function (done, total, text), or None.

    Returns:
        :class:`Fit`.

    Raises:
        InputError: There are fewer points than unknowns, or no start leads anywhere.
    """
    problem = Problem(curves, setup, given or Given())
    rows = sum(c.force.size for c in curves)
    if rows <= len(problem.names):
        raise InputError(
            f"{rows} points in all, expected more than the {len(problem.names)} unknowns"
        )
    tell = progress or (lambda *_: None)
    low, high = problem.bounds()
    tried = []
    for i, (y, k) in enumerate(STARTS):
        tell(i, len(STARTS) + 1, "starts")
        tried.append(_solve(problem, problem.start(y, k), (low, high), FEW))
    tried.sort(key=lambda found: found.cost)
    best = min((_solve(problem, each.x, (low, high), 10 * FEW) for each in tried[:FURTHER]),
               key=lambda found: found.cost)  # fmt: skip
    # Scatter is that of the forces of the model, not of the measured ones.
    tell(len(STARTS), len(STARTS) + 1, "the best of them")
    for _ in range(2):
        found = problem.predict(best.x)
        problem.weights = [
            1 / (f[0] + FLOOR * c.force.max()) for f, c in zip(found, curves, strict=True)
        ]
        best = _solve(problem, best.x, (low, high), 100)
    tell(len(STARTS) + 1, len(STARTS) + 1, "")
    return _result(problem, best)


def _solve(problem, x, bounds, most):
    x = np.clip(x, bounds[0] + 1e-9, bounds[1] - 1e-9)
    return least_squares(
        problem.residual, x, problem.slopes, bounds, x_scale="jac", max_nfev=most,
        ftol=1e-10, xtol=1e-10,
    )  # fmt: skip


def _result(problem, best):
    """A :class:`Fit` of the best unknowns, in SI units."""
    covariance, freedom, straying = covariance_of(
        best.jac, best.fun, [w.size for w in problem.weights], best.active_mask == 0
    )
    # From log H/Y to log H, and from parts to SI units.
    at = problem.num_material
    turn = np.eye(len(problem.names))
    turn[at - 1, at - 2] = 1.0
    turn[at : at + problem.machine] *= problem.soft
    if problem.given.offset is None:
        turn[at + problem.machine :] *= problem.reach[:, None]
    held = best.active_mask != 0
    x = np.where(held, np.where(best.active_mask < 0, *problem.bounds()), best.x)
    (log_E, log_Y, log_k), _, _ = problem.parts(x)
    E, Y = math.exp(log_E), math.exp(log_Y)
    H = Y * math.exp(log_k)
    predicted = [found[0] for found in problem.predict(x)]
    parts = [
        (f - c.force) / np.maximum(f, FLOOR * c.force.max())
        for f, c in zip(predicted, problem.curves, strict=True)
    ]
    residual = np.concatenate(parts)
    delta, force, strain = problem.setup.course(E, Y, H)
    most = max(c.force.max() / c.size.radius**2 for c in problem.curves)
    onset = (2.5 * Y / problem.setup.modulus(E)) ** 2
    return Fit(
        problem.names, turn @ x, turn @ covariance @ turn.T, freedom, predicted,
        float(np.sqrt(np.mean(residual**2))), float(np.interp(most, force, strain)),
        float(np.interp(most, force, delta) / onset), straying,
        [n for n, is_held in zip(problem.names, held, strict=True) if is_held],
        {"E": E, "yield": Y, "hardening": H},
    )  # fmt: skip
