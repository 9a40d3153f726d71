"""Newton's method with a guard, on springs that close and bodies that hardly anything holds."""

from contextlib import nullcontext

import numpy as np
import pytest

import mufe_fenicsx  # noqa: F401  first: the wheel's MPI

# isort: split
from mpi4py import MPI
from petsc4py import PETSc

from mufe_fenicsx.solvers.newton import Newton


class Springs:
    """Three unknowns between stops, as the matrix and the functions that Newton's method needs.

    A line of three nodes joined by springs of stiffness ``soft``, pushed by ``load``, each with a
    stop of stiffness 1 at ``stop`` on its right: r_i = soft (2 q_i - neighbours) + <q_i - stop_i>
    - load_i, the gradient of a convex energy that bends where stops close.
    """

    comm = MPI.COMM_SELF

    def __init__(self, soft, load, stop):
        self.chain = soft * (2 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1))
        self.load, self.stop = np.asarray(load), np.asarray(stop)
        self.matrix = PETSc.Mat().createDense((3, 3), comm=self.comm)
        self.matrix.setUp()

    def options(self):
        return nullcontext()

    def prepare(self, ksp):
        """Solvers here have nothing to complete."""

    def vector(self):
        return PETSc.Vec().createMPI(3, comm=self.comm)

    def residual(self, q):
        self.q = q.ravel()
        into = np.maximum(self.q - self.stop, 0.0)
        return (self.chain @ self.q + into - self.load).reshape(1, 3), np.linalg.norm(self.load)

    def tangent(self, regularisation):
        closed = (self.q > self.stop).astype(float)
        slope = self.chain + np.diag(closed) + regularisation * np.eye(3)
        self.matrix.setValues(range(3), range(3), slope)
        self.matrix.assemble()


def newton(system, max_iterations=40):
    return Newton(
        system, system.residual, system.tangent, "guard_", 1e-10, 1e-12, max_iterations
    )  # fmt: skip


def test_bodies_that_little_holds_come_to_rest_at_their_stops():
    """Springs of 1e-6 between stops of stiffness 1: the solution is within 1e-5 of the stiff limit.

    A full step takes a free node a million times as far as its stop. By hand: chain forces are
    1e-6 times the places, so that stops 0 and 2 take their loads and node 1 their mean place.
    """
    system = Springs(1e-6, [1.0, 0.0, 2.0], [0.5, 9.0, -0.5])
    solver = newton(system)
    q = solver(np.zeros((1, 3))).ravel()
    np.testing.assert_allclose(q, [1.5, 1.5, 1.5], atol=1e-5)
    assert abs(system.residual(q)[0]).max() < 1e-9


@pytest.mark.parametrize("distance", [1.0, 50.0])
def test_the_guard_ends_quadratically_and_changes_no_solution(distance):
    """Where all stops are closed the problem is linear: the last iteration is exact.

    The guard alone from a guess far away: what it adds to the matrix is gone at the end.
    """
    system = Springs(0.3, [1.0, 1.0, 1.0], [-1.0, -1.0, -1.0])
    # Closed: chain q + q + 1 = 1, whose solution is at rest in the middle.
    exact = np.zeros(3)
    solver = newton(system)
    q = solver._solve(solver.guarded, np.full((1, 3), -distance)).ravel()
    np.testing.assert_allclose(q, exact, atol=1e-9)
    assert solver.history[-1] < 1e-3 * solver.history[-2]


def test_a_force_that_saturates_is_found_where_full_steps_run_away():
    """r = arctan(q) - load from q = 3: full steps diverge beyond 1.39, guarded ones do not."""

    class Saturating(Springs):
        def residual(self, q):
            self.q = q.ravel()
            return (np.arctan(self.q) - self.load).reshape(1, 3), 1.0

        def tangent(self, regularisation):
            self.matrix.setValues(range(3), range(3), np.diag(1 / (1 + self.q**2) + regularisation))
            self.matrix.assemble()

    system = Saturating(0.0, [0.0, 0.5, -0.5], np.zeros(3))
    q = newton(system)(np.array([[3.0, -3.0, 8.0]])).ravel()
    np.testing.assert_allclose(q, np.tan([0.0, 0.5, -0.5]), atol=1e-8)


class Ledges(Springs):
    """The same line without stops; a force ``push`` acts on a node up to the ``edge`` of its ledge.

    r_i = soft (2 q_i - neighbours) - load_i - push_i [q_i < edge_i].
    """

    def __init__(self, soft, load, push, edge):
        super().__init__(soft, load, edge)
        self.push = np.asarray(push)

    def residual(self, q):
        self.q = q.ravel()
        on = self.push * (self.q < self.stop)
        return (self.chain @ self.q - self.load - on).reshape(1, 3), np.linalg.norm(self.push)

    def tangent(self, regularisation):
        self.matrix.setValues(range(3), range(3), self.chain + regularisation * np.eye(3))
        self.matrix.assemble()


@pytest.mark.parametrize("push", [[0.0, 3.0, 0.0], [3.0, 0.0, 4.0], [3.0, 2.0, 4.0]])
def test_equilibrium_on_the_edges_of_ledges(push):
    """On its ledge a node is pushed beyond the edge, and beyond it springs pull it back.

    Forces vanish nowhere. The place is known: nodes with a ledge are at its edge, where a part of
    ``push`` between none and all of it balances them; the others are where the springs hold them.
    """
    edge, on = np.array([1.0, 1.1, 0.9]), np.asarray(push) > 0
    system = Ledges(1.0, [0.0, 0.0, 0.0], push, edge)
    solver = newton(system)
    q = solver(np.zeros((1, 3)))
    assert q is not None
    q = q.ravel()
    np.testing.assert_allclose(q[on], edge[on], atol=1e-9)
    part = (system.chain @ q)[on] / np.asarray(push)[on]
    assert ((part > 0) & (part < 1)).all()
    np.testing.assert_allclose((system.chain @ q)[~on], 0.0, atol=1e-9)
    assert solver.num_sides > 1


def test_a_short_step_is_no_solution():
    """PETSc names one where a line search leads out of all states, at whatever residual."""

    class Ended:
        def solve(self, b, x):
            pass

        def __init__(self, reason):
            self.getConvergedReason = lambda: reason

        def getIterationNumber(self):
            return 0

        def getLinearSolveIterations(self):
            return 7

        def getTolerances(self):
            return 0.0, 0.0, 0.0, 40

    solver = newton(Springs(1.0, [1.0, 0.0, 2.0], [0.5, 9.0, -0.5]))
    reasons, guess = PETSc.SNES.ConvergedReason, np.array([[0.1, 0.2, 0.3]])
    assert solver._solve(Ended(reasons.CONVERGED_SNORM_RELATIVE), guess) is None
    assert np.array_equal(solver._solve(Ended(reasons.CONVERGED_FNORM_RELATIVE), guess), guess)
