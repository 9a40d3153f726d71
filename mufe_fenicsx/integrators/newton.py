"""Newton's method on a residual given as a function, by PETSc SNES."""

import math

import numpy as np
from petsc4py import PETSc

#: Line searches of PETSc, tried in turn.
LINE_SEARCHES = ("basic", "cp")
_REASONS = PETSc.SNES.ConvergedReason


class Newton:
    """Solves r(q) = 0. Collective.

    Args:
        system: :class:`~mufe_fenicsx.linear_system.LinearSystem`, whose matrix the tangent is in.
        residual: ``residual(q)`` gives r [N] and the size of what it balances [N], the same on all
            ranks; arrays of shape (num_nodes, 3); None instead of r where there is no such state.
        tangent: ``tangent()`` puts the derivative at the last ``q`` of ``residual`` there.
        prefix: Of the options of PETSc.
        tolerance: Of the norm of r over that size.
        floor: Size of the forces below which it is taken for this [N].
        max_iterations: Newton iterations at most.
    """

    def __init__(self, system, residual, tangent, prefix, tolerance, floor, max_iterations):
        self.system, self.residual, self.tangent = system, residual, tangent
        self.tolerance, self.floor = tolerance, floor
        self.history = []  #: norms of the residual of the last call, over its size
        self.num_iterations = 0  #: of the last call
        self.num_linear = 0  #: iterations of the linear solver in it
        self._scale, self._at, self._f = floor, None, None
        self.x, self.f = system.vector(), system.vector()
        snes = self.snes = PETSc.SNES().create(system.comm)
        snes.setOptionsPrefix(prefix)
        snes.setFunction(self._function, self.f)
        snes.setJacobian(self._jacobian, system.matrix)
        snes.setConvergenceTest(self._test)
        snes.setTolerances(max_it=max_iterations)
        snes.setType("newtonls")
        with system.options():
            snes.setFromOptions()
        #: Whether the options of PETSc name no line search.
        self._free_choice = not PETSc.Options(prefix).hasName("snes_linesearch_type")

    def __call__(self, guess):
        """The solution from ``guess``, shape (num_nodes, 3); None if there is none. Collective.

        Full steps come first: where contacts close or slip, the residual may rise on the way to
        the solution. Where they fail, those follow that a line search along the residual allows.
        """
        for line_search in LINE_SEARCHES[: None if self._free_choice else 1]:
            if self._free_choice:
                self.snes.getLineSearch().setType(line_search)
                self.snes.getLineSearch().setTolerances(max_its=8)
            found = self._solve(guess)
            if found is not None:
                break
        return found

    def _solve(self, guess):
        self.history, self._at = [], None
        self.x.array[:] = guess.ravel()
        with self.system.options():
            self.snes.solve(None, self.x)
        self.num_iterations = self.snes.getIterationNumber()
        self.num_linear = self.snes.getLinearSolveIterations()
        if self.snes.getConvergedReason() <= 0:
            return None
        self._evaluate(self.x)  # the last evaluation is that of the solution
        return self.x.array_r.reshape(-1, 3).copy()

    def _evaluate(self, x):
        """Residual at ``x``, unless that was the last one."""
        same = self._at is not None and bool((self._at == x.array_r).all())
        if self.system.comm.allreduce(int(not same)):
            self._at = x.array_r.copy()
            r, scale = self.residual(self._at.reshape(-1, 3))
            self._f = np.full(self._at.size, np.inf) if r is None else r.ravel().copy()
            self._scale = max(scale, self.floor) if r is not None else self._scale

    def _function(self, snes, x, f):
        self._evaluate(x)
        f.array[:] = self._f

    def _jacobian(self, snes, x, matrix, preconditioner):
        self._evaluate(x)
        self.tangent()
        if self.system.matrix.handle != matrix.handle:  # it has another pattern
            snes.setJacobian(self._jacobian, self.system.matrix)

    def _test(self, snes, iteration, norms):
        error = norms[2] / self._scale
        self.history.append(error)
        if not math.isfinite(error):
            return _REASONS.DIVERGED_FNORM_NAN
        if error <= self.tolerance:
            return _REASONS.CONVERGED_FNORM_RELATIVE
        if iteration >= snes.getTolerances()[3]:
            return _REASONS.DIVERGED_MAX_IT
        return _REASONS.ITERATING
