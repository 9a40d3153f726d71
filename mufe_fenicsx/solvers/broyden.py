"""A few unknowns within bounds, each with a function that costs much to evaluate."""

import numpy as np


class Broyden:
    """Solves r(q) = 0 with a slope that learns from each step.

    Source: C. G. Broyden, Math. Comput. 19, 1965, 577-593. What stands at a bound that keeps
    it from its goal counts as solved.

    Args:
        slope: First guess of the derivative of r by q, diagonal > 0, shape (n,).
        tolerance: Of |r|, shape (n,).
        max_evaluations: Of r in one search.
    """

    def __init__(self, slope, tolerance, max_evaluations=20):
        self.slope = np.diag(np.asarray(slope, float))
        self._first, self._learnt = self.slope.copy(), False
        self.tolerance, self.max_evaluations = tolerance, max_evaluations
        self.num_evaluations = 0  #: of the last search

    def __call__(self, evaluate, residual, bound):
        """Search from q = 0, where r is ``residual``.

        Args:
            evaluate: ``evaluate(q)`` gives r, or None where there is none.
            residual: r at the start, shape (n,).
            bound: Largest |q|, shape (n,).

        Returns:
            q, shape (n,), the last one that was evaluated; None where r is not found.
        """
        q = np.zeros(residual.size)
        for k in range(self.max_evaluations):
            change = self._change(residual, q, bound)
            if k and not change.any():
                self.slope = self._first.copy()
                change = self._change(residual, q, bound)
            before, q = q, np.clip(q + change, -bound, bound)
            known, residual = residual, evaluate(q)
            self.num_evaluations = k + 1
            if residual is None:
                return None
            # What else changed since the start counts as little where nothing is known yet.
            if k or not self._learnt:
                self._learn(q - before, residual - known)
            stopped = (q >= bound) & (residual < 0) | (q <= -bound) & (residual > 0)
            if (stopped | (np.abs(residual) <= self.tolerance)).all():
                return q
        return None

    def _change(self, residual, q, bound):
        try:
            change = -np.linalg.solve(self.slope, residual)
        except np.linalg.LinAlgError:
            change = -residual / np.diag(self._first)
        # A slope that leads away from the goal was learnt where others moved more.
        wrong = change * residual > 0
        change[wrong] = -(residual / np.diag(self._first))[wrong]
        return np.clip(q + change, -bound, bound) - q

    def _learn(self, dq, dr):
        size = dq @ dq
        if size > 0 and dq @ dr > 0:
            self.slope = self.slope + np.outer(dr - self.slope @ dq, dq) / size
            self._learnt = True
        # Where nothing answered, slopes are those to begin with.
        idle = (dr == 0) & (dq != 0)
        self.slope[idle] = self._first[idle]
