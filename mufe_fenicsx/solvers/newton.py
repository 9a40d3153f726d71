"""Newton's method on a residual given as a function, by PETSc SNES."""

import math
import weakref

import numpy as np
from petsc4py import PETSc

from .regularised_newton import GuardedNewton

#: Line searches of PETSc, tried in turn, and the iterations without a smaller residual after which
#: they are given up.
LINE_SEARCHES, PATIENCE = ("basic", "cp"), 8
#: Iterations without half the residual after which guarded ones end, as found where they are within
#: this multiple of the tolerance: where points pass from a facet to the next, forces jump a little.
STALLED, NEARLY = 12, 100.0
#: Growth of the linear iterations up to which the matrix near a tangent is kept, and iterations
#: more that do not count.
WORN, SPARED = 1.5, 5
#: But never above this part of the internal forces.
LARGEST_LEFT = 0.01
_REASONS = PETSc.SNES.ConvergedReason
#: Ends that :meth:`Newton.test` names, and guarded steps beside it. PETSc's own may be none: where
#: a step leads out of all states, lengths are infinite, and it takes the step for a short one.
FOUND = (_REASONS.CONVERGED_FNORM_RELATIVE,)
FOUND_GUARDED = (*FOUND, _REASONS.CONVERGED_SNORM_RELATIVE)


def _weak(method):
    """The method without a hold on its object, which has what PETSc would keep for ever.

    What PETSc's objects refer to, Python's collector of cycles does not see.
    """
    held = weakref.WeakMethod(method)
    return lambda *arguments: held()(*arguments)


class Newton:
    """Solves r(q) = 0. Collective.

    Args:
        system: :class:`~.LinearSystem`, whose matrix the tangent is in.
        residual: ``residual(q)`` gives r [N] and the size of what it balances [N], the same on all
            ranks; arrays of shape (num_nodes, 3); None instead of r where there is no such state.
        tangent: ``tangent(μ)`` puts the derivative at the last ``q`` of ``residual`` there, and μ
            times a stiffness of the nodes, for :mod:`.guarded`.
        prefix: Of the options of PETSc.
        tolerance: Of the norm of r over that size.
        floor: Size of the forces below which it is taken for this [N].
        max_iterations: Newton iterations at most.
        products: :class:`~.products.Products`, which are the tangent then; the matrix of
            ``system`` is near it. None: it is the tangent.
    """

    def __init__(
        self, system, residual, tangent, prefix, tolerance, floor, max_iterations, products=None
    ):
        self.system, self.residual, self.tangent = system, residual, tangent
        self.tolerance, self.floor = tolerance, floor
        self.history = []  #: norms of the residual of the last call, over its size
        self.num_iterations = 0  #: of the last call
        self.num_linear = 0  #: iterations of the linear solver in it
        self.effort = 0.0  #: iterations over the most allowed, of what ended the last call
        self.num_sides = 1  #: of a jump of the forces on which the last solution is; 1: on none
        self._scale, self._at, self._f = floor, None, None
        self.x, self.f, self._trial = system.vector(), system.vector(), system.vector()
        self._made = None  # μ of the matrix, linear iterations of the first solution with it
        self.products = products
        self.snes = self._make_snes(prefix, max_iterations)
        system.prepare(self.snes.getKSP())
        #: The last way, where the options of PETSc do not name one themselves.
        self.guarded = None
        options = PETSc.Options(prefix)
        if not (options.hasName("snes_type") or options.hasName("snes_linesearch_type")):
            self.guarded = self._make_snes(prefix, 2 * max_iterations)
            self.guarded.setKSP(self.snes.getKSP())
            self.guarded.setType("python")
            self.guarded.setPythonContext(GuardedNewton(weakref.proxy(self)))

    def _make_snes(self, prefix, max_iterations):
        snes = PETSc.SNES().create(self.system.comm)
        snes.setOptionsPrefix(prefix)
        snes.setFunction(_weak(self._function), self.f)
        snes.setJacobian(_weak(self._jacobian), *self.operators)
        snes.setConvergenceTest(_weak(self._test))
        snes.setTolerances(max_it=max_iterations)
        snes.setType("newtonls")
        with self.system.options():
            snes.setFromOptions()
        return snes

    def __call__(self, guess):
        """The solution from ``guess``, shape (num_nodes, 3); None if there is none. Collective.

        Full Newton steps come first: where contacts close or slip, the residual may rise on the
        way to the solution. Where they fail, those follow that a line search along the residual
        allows, and then guarded ones, each from the guess.
        """
        if self.guarded is None:
            return self._solve(self.snes, guess)
        for line_search in LINE_SEARCHES:
            self.snes.getLineSearch().setType(line_search)
            # Its own tolerance is one of forces in newtons, which ends where there is little load.
            self.snes.getLineSearch().setTolerances(atol=0.0, max_its=8)
            found = self._solve(self.snes, guess)
            if found is not None:
                return found
        return self._solve(self.guarded, guess)

    def _solve(self, snes, guess):
        self.history, self._at = [], None
        self.x.array[:] = guess.ravel()
        with self.system.options():
            snes.solve(None, self.x)
        self.num_iterations = snes.getIterationNumber()
        self.effort = self.num_iterations / snes.getTolerances()[3]
        self.num_linear = snes.getLinearSolveIterations()
        self.num_sides = 1
        if snes is self.guarded:
            context = snes.getPythonContext()
            self.num_linear, self.num_sides = context.num_linear, context.num_sides
        if snes.getConvergedReason() not in (FOUND_GUARDED if snes is self.guarded else FOUND):
            return None
        self.evaluate(self.x)  # the last evaluation is that of the solution
        return self.x.array_r.reshape(-1, 3).copy()

    def evaluate(self, x):
        """Residual at ``x``, unless that was the last one."""
        same = self._at is not None and bool((self._at == x.array_r).all())
        if self.system.comm.allreduce(int(not same)):
            self._at = x.array_r.copy()
            r, scale = self.residual(self._at.reshape(-1, 3))
            self._f = np.full(self._at.size, np.inf) if r is None else r.ravel().copy()
            self._scale = max(scale, self.floor) if r is not None else self._scale

    def _function(self, snes, x, f):
        self.evaluate(x)
        f.array[:] = self._f

    def residual_vector(self, x):
        """r at ``x``, infinite where there is none; a vector that the next call overwrites."""
        self._function(None, x, self._trial)
        return self._trial

    def solve_linear(self, q, load):
        """The solution of K d = ``load`` at ``q``; all of shape (num_nodes, 3). Collective."""
        self.x.array[:] = q.ravel()
        self.set_tangent(self.x, 0.0)
        ksp = self.snes.getKSP()
        ksp.setOperators(*self.operators)
        self.f.array[:] = load.ravel()
        with self.system.options():
            ksp.solve(self.f, self._trial)
        return self._trial.array_r.reshape(-1, 3).copy()

    @property
    def operators(self):
        """The tangent and the matrix that a preconditioner is made of."""
        matrix = self.system.matrix
        return (self.products.matrix if self.products else matrix), matrix

    def set_tangent(self, x, regularisation):
        """Make :attr:`operators` those at ``x``, with a regularisation μ."""
        self.evaluate(x)
        self.tangent(regularisation)
        if self.products:
            self._at = None  # products leave another state
            if self._worn(regularisation):
                self.system.renew()

    def _worn(self, regularisation):
        """Whether the matrix near the tangent has to be made again."""
        ksp = self.snes.getKSP()
        count, failed = ksp.getIterationNumber(), ksp.getConvergedReason() < 0
        if self._made and not failed:
            made_for, first = self._made
            first = count if first is None else first
            self._made = made_for, first
            if made_for == regularisation and count <= WORN * first + SPARED:
                return False
        self._made = regularisation, None
        return True

    def _jacobian(self, snes, x, matrix, preconditioner):
        self.set_tangent(x, 0.0)
        if self.system.matrix.handle != preconditioner.handle:  # it has another pattern
            snes.setJacobian(_weak(self._jacobian), *self.operators)

    def _test(self, snes, iteration, norms):
        reason = self.test(iteration, norms[2], snes.getTolerances()[3])
        best = int(np.argmin(self.history))
        if reason == _REASONS.ITERATING and self.guarded and iteration - best >= PATIENCE:
            return _REASONS.DIVERGED_DTOL
        return reason

    def test(self, iteration, norm, max_iterations):
        """Reason to end, after an iteration that left a residual of ``norm`` [N]."""
        error = norm / self._scale
        self.history.append(error)
        if not math.isfinite(error):
            return _REASONS.DIVERGED_FUNCTION_NANORINF
        if error <= self.tolerance:
            return _REASONS.CONVERGED_FNORM_RELATIVE
        if iteration >= max_iterations:
            return _REASONS.DIVERGED_MAX_IT
        return _REASONS.ITERATING

    def counts(self):
        """Of the last call: Newton iterations, linear ones, the last three residuals."""
        return self.num_iterations, self.num_linear, self.history[-3:]

    def reason(self):
        """Words for where the last call ended without a solution."""
        least = min(self.history, default=math.nan)
        return f"{self.num_iterations} iterations, residual {least:.1e} of the internal forces"

    def stalled(self):
        """Whether the residuals of the last iterations are as good as it gets."""
        before, last = self.history[:-STALLED], self.history[-STALLED:]
        if not before or min(last) < 0.5 * min(before):
            return False
        enough = max(self.tolerance, min(NEARLY * self.tolerance, LARGEST_LEFT))
        return self.history[-1] <= min(enough, 2.0 * min(last))
