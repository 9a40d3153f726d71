"""Newton's method with a guard, for contacts that open, close and slip on the way: a PETSc SNES.

An iteration solves (K + μ D) d = -r and goes λ d. D is a stiffness of each node, those of a grain
adding up to that of the grain: as if each iteration were an implicit step of a viscous motion, of
length 1/μ (pseudo-transient continuation: C. T. Kelley, D. E. Keyes, SIAM J. Numer. Anal. 35, 1998,
508-523). Without it a grain that hardly anything holds goes very far, and keeps all others from
going on. λ is where the energy along d is least as far as there is one: a root of r(q + λ d) · d,
bracketed, then found by false position, the other end's value halved each time (as in the Illinois
rule). μ follows the residual down and up, rises where steps are short, and vanishes at last: it
changes the way to the solution, not the solution.
"""

import math

import numpy as np
from petsc4py import PETSc

#: μ at first; bounds of its change in an iteration; below which it is none, and at most.
FIRST, EASIER, HARDER, NONE, LARGEST = 1e-2, 1e-3, 5.0, 1e-8, 1e2
#: λ up to which a step is short.
SHORT = 0.3
#: Part of the slope at the start of a step that may be left at its end, and trials for that.
SLOPE, TRIALS = 0.3, 10
#: Shortest step.
SHORTEST = 1e-5

_REASONS = PETSc.SNES.ConvergedReason


class GuardedNewton:
    """The solver of a SNES of type "python". Collective.

    Args:
        newton: :class:`~.newton.Newton` whose functions it uses.
    """

    def __init__(self, newton):
        self.newton = newton
        self.num_linear = 0

    def solve(self, snes, b, x):
        """From ``x`` to the solution, in place; the reason of the end goes to ``snes``."""
        newton, ksp = self.newton, snes.getKSP()
        d, trial, f = x.duplicate(), x.duplicate(), newton.f
        regularisation, self.num_linear, iteration = FIRST, 0, 0
        snes.computeFunction(x, f)
        while True:
            snes.setIterationNumber(iteration)
            norm = f.norm()
            snes.logConvergenceHistory(norm)
            snes.monitor(iteration, norm)
            reason = newton.test(iteration, norm, snes.getTolerances()[3])
            if reason == _REASONS.ITERATING and newton.stalled():
                reason = _REASONS.CONVERGED_SNORM_RELATIVE
            if reason != _REASONS.ITERATING:
                break
            length = None
            while length is None and regularisation <= LARGEST:
                newton.set_tangent(x, regularisation)
                ksp.setOperators(*newton.operators)
                ksp.solve(f, d)
                self.num_linear += ksp.getIterationNumber()
                d.scale(-1.0)
                length = self._length(x, d, trial, f)
                if length is None:
                    regularisation = max(HARDER * regularisation, FIRST)
            if length is None:
                reason = _REASONS.DIVERGED_LINE_SEARCH
                break
            x.axpy(length, d)
            snes.computeFunction(x, f)
            change = f.norm() / norm if length > SHORT else HARDER
            regularisation = max(regularisation, NONE) * min(max(change, EASIER), HARDER)
            regularisation = 0.0 if regularisation < NONE else regularisation
            iteration += 1
        snes.setConvergedReason(reason)

    def _length(self, x, d, trial, f):
        """λ; None where ``d`` leads nowhere. ``f`` is the residual at ``x``."""
        start = f.dot(d)
        if not (math.isfinite(start) and start < 0.0):
            return None
        low, at_low, high, at_high, length = 0.0, start, None, None, 1.0
        for _ in range(TRIALS):
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
            length = (low * at_high - high * at_low) / (at_high - at_low)
            length = min(max(length, low + 0.02 * (high - low)), high - 0.02 * (high - low))
        return length if length >= SHORTEST else None

    def _slope(self, x, d, trial, length):
        """r(x + length d) · d; None where there is no such state."""
        trial.waxpy(length, d, x)
        g = self.newton.residual_vector(trial)
        slope = d.dot(g)
        return slope if np.isfinite(slope) else None
