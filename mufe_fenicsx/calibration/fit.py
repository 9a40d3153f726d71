"""Least squares over all curves at once: one material, and what belongs to each curve.

Unknowns are the logarithms of Young's modulus, of the yield stress and of the slope of hardening,
the compliance of the machine, and an offset of each curve. Residuals are differences of forces over
their scatter, which is in proportion to the force beyond a part of the largest.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import f as f_distribution
from scipy.stats import t as student

from ..errors import InputError
from ..materials.elastic import USUAL_E
from .covariance import covariance_of, shift_of
from .model import forces

MATERIAL = ("E", "yield", "hardening")
#: Part of the largest force of a curve below which the scatter does not fall with it.
FLOOR = 0.05
#: Of H/Y, and of the yield stress [Pa]; the modulus is within :data:`USUAL_E`.
HARDENING, YIELD = (0.02, 4000.0), (1e2, 1e12)
#: Starting values of Y/E and H/Y.
STARTS = tuple((y, k) for y in (2e-4, 2e-3, 1e-2, 4e-2) for k in (2.0, 40.0, 400.0))
#: Standard deviations of the model's own forces over these: of an error that is constant, and of
#: half a wave and a whole one over so many decades of the force. Measured against finer meshes on
#: platens that are bodies, of two materials.
MODEL_ERRORS, DECADES = (0.01, 0.007, 0.003), 2.0
#: Squares of second differences over those of the noise that makes them.
SECOND = 6.0
#: Moduli that are tried, over the one that was found; H/Y that are, where it is not determined.
ASIDE, RATIOS = (0.1, 0.3, 0.7, 1.4, 3.0, 10.0), (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
#: Room that least squares want between ends of what is held, over it.
TINY = 1e-6
#: Half-width of an interval in logarithms from which on a value counts as not determined.
WIDE = math.log(2.0)
#: Approach over that of first yield below which the force is that of an elastic ball.
ELASTIC = 1.9
#: Evaluations that each start has, and how many of the best go on.
FEW, FURTHER = 5, 3


@dataclass(frozen=True)
class Given:
    """What is not sought but given."""

    E: float | None = None  #: Young's modulus [Pa]
    offset: float | None = None  #: of all curves [m]
    compliance: float | str = "common"  #: of the machine [m/N], or one unknown: "common" or "each"
    elastic: bool = False  #: grains do not yield
    ratio: float | None = None  #: slope of hardening over yield stress

    @property
    def known_compliance(self):
        """Compliance of the machine [m/N] where it is given, else 0."""
        return 0.0 if isinstance(self.compliance, str) else self.compliance


@dataclass
class Fit:
    """What was found."""

    names: list  #: of the unknowns, shape (num_unknowns,)
    values: np.ndarray  #: natural logarithms of E, yield [Pa], hardening [Pa]; else SI units
    covariance: np.ndarray  #: shape (num_unknowns, num_unknowns)
    freedom: int  #: degrees of freedom of the intervals
    curves: list  #: forces [N] of the model for each curve
    scatter: float  #: standard deviation of force over force
    noise: float  #: the same by differences of neighbours, which no smooth misfit adds to
    strain: float  #: largest plastic strain that any grain reached
    yields: float  #: largest approach over that of first yield
    held: list  #: names of unknowns at an end of what is sought, without an interval
    material: dict  #: E, yield, hardening [Pa], given or found
    others: list = field(default_factory=list)  #: materials that fit as well, as ``material``

    def interval(self, name):
        """Ends of the interval of 95 %, in SI units."""
        i, half = self.names.index(name), self.half_width(name)
        low, high = self.values[i] - half, self.values[i] + half
        if name.startswith("compliance"):
            low = max(low, 0.0)
        if name not in MATERIAL:
            return low, high
        others = [other[name] for other in self.others]
        return min(math.exp(low), *others, math.inf), max(math.exp(min(high, 700.0)), *others, 0.0)

    def value(self, name):
        """A value in SI units."""
        value = float(self.values[self.names.index(name)])
        return math.exp(value) if name in MATERIAL else value

    def half_width(self, name, chance=0.05):
        """Of an interval that misses the value with a chance; of a material in logarithms."""
        i = self.names.index(name)
        return student.ppf(1 - chance / 2, self.freedom) * math.sqrt(self.covariance[i, i])

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
        self.names = ["E"] if given.E is None else []
        self.names += [] if given.elastic else ["yield", "hardening"]
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
        if self.given.elastic:  # no table has balls that yield there
            material += [material[0], 0.0]
        n, at = len(self.curves), self.num_material
        if self.machine:
            compliance = np.broadcast_to(x[at : at + self.machine] * self.soft, n)
        else:
            compliance = np.full(n, float(self.given.compliance))
        offset = np.full(n, self.given.offset)
        if self.given.offset is None:
            offset = x[at + self.machine :] * self.reach
        return material, compliance, offset

    def material(self, x):
        """E, Y and H [Pa]."""
        E, Y, k = map(math.exp, self.parts(x)[0])
        return E, Y, Y * k

    def predict(self, x):
        """Forces and slopes of each curve, as by :func:`~.model.forces`."""
        _, compliance, offset = self.parts(x)
        course = self.setup.course(*self.material(x))
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
                E = float(np.clip(E * ratio, *USUAL_E))
        values = {"E": math.log(E), "yield": math.log(y * E), "hardening": math.log(k)}
        x = np.zeros(len(self.names))
        x[: self.num_material] = [values[name] for name in self.names[: self.num_material]]
        if self.given.offset is None:
            first = [c.displacement.min() for c in self.curves]
            x[self.num_material + self.machine :] = np.array(first) / self.reach
        return x

    def bounds(self):
        """Lowest and highest values of the unknowns."""
        low, high = np.full(len(self.names), -np.inf), np.full(len(self.names), np.inf)
        k = self.given.ratio
        ratios = HARDENING if k is None else (k * (1 - TINY), k * (1 + TINY))
        ends = {"E": USUAL_E, "yield": YIELD, "hardening": ratios}
        for i, name in enumerate(self.names[: self.num_material]):
            low[i], high[i] = np.log(ends[name])
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
    tried, starts = [], STARTS[:1] if problem.given.elastic else STARTS
    for i, (y, k) in enumerate(starts):
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


def fit_simplest(curves, setup, given, progress=None):
    """As :func:`simplest`, with the other materials that fit as well. Local."""
    fit, given = simplest(curves, setup, given, progress)
    if given.elastic:
        return fit, given
    return replace(fit, others=_others(fit, curves, setup, given)), given


def simplest(curves, setup, given, progress=None):
    """As :func:`fit_curves`, without yield where curves do not ask for it. Local.

    Returns:
        :class:`Fit`, and :class:`Given` of it: ``elastic`` where grains do not yield.
    """
    fit = fit_curves(curves, setup, given, progress)
    if "E" not in fit.names and given.offset is not None and not isinstance(given.compliance, str):
        return fit, given  # nothing would be left to seek
    without = replace(given, elastic=True)
    elastic = fit_curves(curves, setup, without)
    # By noise alone the square grows by so much in one of a hundred cases.
    more, most = elastic.scatter**2 - fit.scatter**2, _by_chance(fit, curves, 2, 0.99)
    # Or the model's own error makes up for it, and the interval has grains that do not yield.
    to_elastic = 0.5 * math.log(max(fit.yields / ELASTIC, 1.0))
    reached = more < MODEL_ERRORS[0] ** 2 and fit.half_width("yield") >= to_elastic
    if more < most or reached:
        return elastic, without
    return fit, given


def _by_chance(fit, curves, fewer, part):
    """By how much the square of the scatter grows with fewer unknowns, in a part of all cases."""
    free = max(sum(curve.force.size for curve in curves) - len(fit.names), 1)
    return fit.scatter**2 * fewer / free * f_distribution.ppf(part, fewer, free)


def _others(fit, curves, setup, given):
    """Materials that fit as well, which the curvature at the best one does not tell.

    Where all flows they have quite another modulus, where contacts are alike another hardening.
    """
    most = fit.scatter**2 + _by_chance(fit, curves, 1, 0.99)
    tried = []
    if "E" in fit.names:
        moduli = [fit.material["E"] * part for part in ASIDE]
        tried += [replace(given, E=E) for E in moduli if USUAL_E[0] < E < USUAL_E[1]]
    if "hardening" in fit.held or fit.half_width("hardening") > WIDE:
        tried += [replace(given, ratio=ratio) for ratio in RATIOS]
    found = [fit_curves(curves, setup, each) for each in tried]
    return [each.material for each in found if each.scatter**2 < most]


def _solve(problem, x, bounds, most):
    x = np.clip(x, bounds[0] + 1e-9, bounds[1] - 1e-9)
    return least_squares(
        problem.residual, x, problem.slopes, bounds, x_scale="jac", max_nfev=most,
        ftol=1e-10, xtol=1e-10,
    )  # fmt: skip


def _result(problem, best):
    """A :class:`Fit` of the best unknowns, in SI units."""
    covariance, freedom = covariance_of(
        best.jac, best.fun, [w.size for w in problem.weights], best.active_mask == 0
    )
    sure = best.active_mask == 0
    for error in _model_errors(problem, best.x):
        shift = shift_of(best.jac, error, sure)
        covariance = covariance + np.outer(shift, shift)
    # From log H/Y to log H, and from parts to SI units.
    at = problem.num_material
    turn = np.eye(len(problem.names))
    if not problem.given.elastic:
        turn[at - 1, at - 2] = 1.0
    turn[at : at + problem.machine] *= problem.soft
    if problem.given.offset is None:
        turn[at + problem.machine :] *= problem.reach[:, None]
    held = best.active_mask != 0
    x = np.where(held, np.where(best.active_mask < 0, *problem.bounds()), best.x)
    E, Y, H = problem.material(x)
    predicted = [found[0] for found in problem.predict(x)]
    parts = [
        (f - c.force) / np.maximum(f, FLOOR * c.force.max())
        for f, c in zip(predicted, problem.curves, strict=True)
    ]
    residual = np.concatenate(parts)
    bend = [np.diff(part[np.argsort(c.displacement, kind="stable")], 2)
            for part, c in zip(parts, problem.curves, strict=True)]  # fmt: skip
    noise = float(np.sqrt(np.mean(np.concatenate(bend) ** 2) / SECOND))
    delta, force, strain = problem.setup.course(E, Y, H)
    most = max(c.force.max() / c.size.radius**2 for c in problem.curves)
    onset = (2.5 * Y / problem.setup.modulus(E)) ** 2
    return Fit(
        problem.names, turn @ x, turn @ covariance @ turn.T, freedom, predicted,
        float(np.sqrt(np.mean(residual**2))), noise, float(np.interp(most, force, strain)),
        float(np.interp(most, force, delta) / onset),
        [n for n, is_held in zip(problem.names, held, strict=True) if is_held],
        {"E": E, "yield": Y, "hardening": H},
    )  # fmt: skip


def _model_errors(problem, x):
    """Residuals that the model's own errors of one standard deviation make, one after the other."""
    found = [each[0] for each in problem.predict(x)]
    stress = np.concatenate([f / c.size.radius**2
                             for f, c in zip(found, problem.curves, strict=True)])  # fmt: skip
    weighted = np.concatenate([w * f for w, f in zip(problem.weights, found, strict=True)])
    most = stress.max()
    way = np.log10(most / np.maximum(stress, most * 10**-DECADES)) / DECADES
    errors = [size * np.cos(k * np.pi * way) * weighted for k, size in enumerate(MODEL_ERRORS)]
    if problem.setup.shape is not None:
        E, Y, H = problem.material(x)
        delta, force, _ = problem.setup.course(E, Y, H)
        errors.append(weighted * problem.setup.shape.error(
            np.interp(stress, force, delta), Y / problem.setup.modulus(E), H / Y
        ))  # fmt: skip
    return errors
