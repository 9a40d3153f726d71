"""Newton's method with a guard, for contacts that open, close and slip on the way: a PETSc SNES.

An iteration solves (K + μ D) d = -r and goes λ d. D is a stiffness of each node, those of a grain
adding up to that of the grain: as if each iteration were an implicit step of a viscous motion, of
length 1/μ (pseudo-transient continuation: C. T. Kelley, D. E. Keyes, SIAM J. Numer. Anal. 35, 1998,
508-523). Without it a grain that hardly anything holds goes very far, and keeps all others from
going on. λ is where the energy along d is least as far as there is one: a root of r(q + λ d) · d,
bracketed, then found by false position, the other end's value halved each time (as in the Illinois
rule). μ follows the residual down and up, rises where steps are short, and vanishes at last: it
changes the way to the solution, not the solution.

Where the bracket closes around a jump of the forces, both of its sides count from then on, and the
solution may be a mix of them (see :mod:`.jumps`).
"""

import math

import numpy as np
from petsc4py import PETSc

from .nonsmooth import Sides, least_mix

#: μ at first; bounds of its change in an iteration; below which it is none, and at most.
FIRST, EASIER, HARDER, NONE, LARGEST = 1e-2, 1e-3, 5.0, 1e-8, 1e2
#: λ up to which a step is short; part of the residual from which on one to a jump counts as such.
SHORT, HALF = 0.3, 0.5
#: Part of the slope at the start of a step that may be left at its end, trials until the bracket is
#: halved by each, and at most.
SLOPE, TRIALS, MOST_TRIALS = 0.3, 10, 60
#: Shortest step.
SHORTEST = 1e-5

LARGEST_OF_ALL = PETSc.NormType.NORM_INFINITY
_REASONS = PETSc.SNES.ConvergedReason


class GuardedNewton:
    """The solver of a SNES of type "python". Collective.

    Args:
        newton: Weak reference of the :class:`~.newton.Newton` whose functions it uses.
    """

    def __init__(self, newton):
        self.newton = newton
        self.num_linear = 0
        self.num_sides = 1  #: of a jump that the last residual is a mix of

    def solve(self, snes, b, x):
        """From ``x`` to the solution, in place; the reason of the end goes to ``snes``."""
        newton, f = self.newton, self.newton.f
        self._d, self._trial = x.duplicate(), x.duplicate()
        # A method would hold on to what has this solver.
        self._sides, self.num_linear = Sides(lambda x: newton.residual_vector(x)), 0
        regularisation, iteration = FIRST, 0
        snes.computeFunction(x, f)
        norm = self._least(f)
        while True:
            snes.setIterationNumber(iteration)
            snes.logConvergenceHistory(norm)
            snes.monitor(iteration, norm)
            reason = newton.test(iteration, norm, snes.getTolerances()[3])
            if reason == _REASONS.ITERATING and newton.stalled():
                reason = _REASONS.CONVERGED_SNORM_RELATIVE
            if reason != _REASONS.ITERATING:
                break
            length = None
            while length is None and regularisation <= LARGEST:
                self._direction(snes.getKSP(), x, f, regularisation)
                length = self._length(x)
                if length is None:
                    regularisation = max(HARDER * regularisation, FIRST)
            if length is None:
                reason = _REASONS.DIVERGED_LINE_SEARCH
                break
            x.axpy(length, self._d)
            snes.computeFunction(x, f)
            if self._beyond is not None:
                self._sides.add(self._beyond)
            self._sides.follow(x, newton.tolerance * x.norm(LARGEST_OF_ALL))
            before, norm = norm, self._least(f)
            if self._beyond is None or norm > HALF * before:  # else it is short for another reason
                change = norm / before if length > SHORT else HARDER
                if length == 1.0 and norm < before:  # more than is needed creeps
                    change = min(change, 1.0 / HARDER)
                regularisation = max(regularisation, NONE) * min(max(change, EASIER), HARDER)
                regularisation = 0.0 if regularisation < NONE else min(regularisation, LARGEST)
            iteration += 1
        if reason in (_REASONS.CONVERGED_FNORM_RELATIVE, _REASONS.CONVERGED_SNORM_RELATIVE):
            self._sides.best(x, f).copy(x)
        snes.setConvergedReason(reason)

    def _least(self, f):
        """Norm of the least mix of the residuals here and on the other sides of jumps [N]."""
        sides = self._sides.residuals(f)
        self.num_sides = 1
        if len(sides) == 1:
            return f.norm()
        products = np.array([[one.dot(other) for other in sides] for one in sides])
        weights = least_mix(products)
        self.num_sides = int(np.count_nonzero(weights))
        return math.sqrt(max(weights @ products @ weights, 0.0))

    def _direction(self, ksp, x, f, regularisation):
        """d, and the slope along it at its start."""
        newton, d = self.newton, self._d
        newton.set_tangent(x, regularisation)
        ksp.setOperators(*newton.operators)
        sides, ways = self._sides.residuals(f), []
        for one in sides:
            ksp.solve(one, d)
            self.num_linear += ksp.getIterationNumber()
            ways.append(d.copy())
        weights = least_mix(np.array([[one.dot(way) for way in ways] for one in sides]))
        d.set(0.0)
        d.maxpy(-weights, ways)
        self._sides.keep(weights[1:] > 0.0)
        self._start = sum(w * one.dot(d) for w, one in zip(weights, sides, strict=True))

    def _length(self, x):
        """λ; None where d leads nowhere. Up to a jump, beyond which ``_beyond`` leads."""
        d, trial, start, self._beyond = self._d, self._trial, self._start, None
        if not (math.isfinite(start) and start < 0.0):
            return None
        low, at_low, high, at_high, length = 0.0, start, None, None, 1.0
        moved, way = x.norm(LARGEST_OF_ALL), d.norm(LARGEST_OF_ALL)
        for trials in range(1, MOST_TRIALS + 1):
            slope = self._slope(x, d, trial, length)
            if slope is None:  # there is no such state
                length *= 0.25
                if length < SHORTEST:
                    return None
                continue
            if abs(slope) <= SLOPE * abs(start) or (slope < 0.0 and high is None):
                return length
            if slope < 0.0:
                low, at_low = length, slope
                at_high *= 0.5
            else:
                high, at_high = length, slope
                at_low *= 0.5 if low > 0.0 else 1.0
            if (high - low) * way <= self.newton.tolerance * max(moved, high * way):
                self._beyond = d * float(high - low)
                return low
            length = (low * at_high - high * at_low) / (at_high - at_low)
            length = min(max(length, low + 0.02 * (high - low)), high - 0.02 * (high - low))
            if trials >= TRIALS:
                length = 0.5 * (low + high)
        return None

    def _slope(self, x, d, trial, length):
        """r(x + length d) · d; None where there is no such state."""
        trial.waxpy(length, d, x)
        g = self.newton.residual_vector(trial)
        slope = d.dot(g)
        return slope if np.isfinite(slope) else None
