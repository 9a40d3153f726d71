"""The highest frequency against a dense eigenvalue problem, and what it is worth."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import SolverError
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.solvers.highest_frequency import HighestFrequency
from mufe_fenicsx.verification.stability.limits import highest_frequency
from mufe_fenicsx.verification.stability.penalty import pressed_block
from tests.bodies import packed_spheres, simulation_of


def test_highest_frequency_of_a_dense_matrix():
    rng = np.random.default_rng(1)
    n = 20
    a = rng.standard_normal((3 * n, 3 * n))
    K, mass = a @ a.T, rng.uniform(1.0, 2.0, n)

    def add_stiffness(y, q):
        y += (K @ q.ravel()).reshape(-1, 3)

    x = rng.random((n, 3))
    found = HighestFrequency(MPI.COMM_SELF, mass, x, add_stiffness, tolerance=1e-6)()
    root = np.repeat(1 / np.sqrt(mass), 3)
    exact = np.sqrt(np.linalg.eigvalsh(root[:, None] * K * root)[-1])
    # The residual of 1e-6 of the eigenvalue bounds the error of its square root by half.
    assert found == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("split", [1e-8, 1e-9, 1e-10, 1e-11])
def test_rounding_does_not_decide_where_few_frequencies_are(split):
    """A few springs on many masses, alike but for ``split``: the vectors are used up soon."""
    rng = np.random.default_rng(2)
    n, num = 40, 12
    modes = np.linalg.qr(rng.standard_normal((3 * n, num)))[0]
    stiffness = rng.choice([1.0, 0.9, 0.6, 0.3], num) + split * rng.random(num)
    x, found = rng.random((n, 3)), []
    for rounding in (0.0, 1e-15):

        def add_stiffness(y, q, rounding=rounding):
            force = (modes @ (stiffness * (modes.T @ q.ravel()))).reshape(-1, 3)
            y += force * (1 + rounding * rng.standard_normal((n, 3)))

        highest = HighestFrequency(MPI.COMM_SELF, np.ones(n), x, add_stiffness)
        found.append([highest() for _ in range(3)])
    # Rounding over the least part that is still taken for a vector, 2e-6.
    np.testing.assert_allclose(*found, rtol=1e-9)


def test_the_last_vector_may_be_of_other_rows():
    """Contacts that open while others close: nothing of the last vector is at the new rows."""
    x = np.random.default_rng(3).random((12, 3))
    highest = HighestFrequency(MPI.COMM_SELF, np.ones(12), x, None)

    def stiff(y, q):
        y[:] = 4.0 * q

    # One frequency: exact but for rounding.
    for rows in (np.arange(4), np.arange(6, 12), np.arange(3, 8)):
        assert highest(rows, stiff) == pytest.approx(2.0, rel=1e-12)


@pytest.mark.mpi
def test_ranks_without_rows_take_part():
    """No contact touches their grains; the frequency is that of the others."""
    x = np.random.default_rng(3).random((5, 3))
    highest = HighestFrequency(MPI.COMM_WORLD, np.ones(5), x, None)

    def stiff(y, q):
        y[:] = 4.0 * q

    rows = np.arange(5 if MPI.COMM_WORLD.rank == 0 else 0)
    for mass in (None, np.full(rows.size, 0.25)):
        rate = 2.0 if mass is None else 4.0
        assert highest(rows, stiff, mass) == pytest.approx(rate, rel=1e-12)


def test_assembled_step_is_larger_than_the_element_bound_and_stable():
    """A free body that starts with random velocities keeps its energy at 0.9 of the limit."""
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), gap=0.5)
    material = Elastic(1e9, 0.15, 2650.0)
    velocity = 1e-3 * np.sin(37.0 * mesh.x / np.abs(mesh.x).max())
    sim = simulation_of(mesh, material, velocity=velocity)
    assert sim.dt / 0.9 > sim.dt_element
    for _ in range(300):
        sim.step()
    # Small strains (v/c = 2e-6): the discrete energy is conserved up to terms of that order.
    assert abs(sim.energies()["residual"]) < 1e-5 * sim.initial_kinetic


def test_beyond_the_assembled_limit_it_blows_up():
    """1.1 times the limit of stability is unstable: the limit is sharp, not merely safe."""
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), gap=0.5)
    velocity = 1e-6 * np.sin(37.0 * mesh.x / np.abs(mesh.x).max())
    sim = simulation_of(mesh, Elastic(1e9, 0.15, 2650.0), velocity=velocity)
    sim.time_step_factor = 1.1  # which cannot be given
    sim.update_time_step()
    # Its highest mode grows by exp(2 acosh 1.1) = 2.4 a step: the program has to notice.
    with pytest.raises(SolverError):
        for _ in range(1000):
            sim.step()


@pytest.mark.parametrize("compliance, contact_rules", [(0.02, True), (1.0, False)])
def test_products_with_tets_are_left_out_only_where_contact_rules(compliance, contact_rules):
    """A block between platens: the step of the springs alone, where the sum of squares allows."""
    s = pressed_block(MPI.COMM_SELF, compliance=compliance)
    products = s.stable.highest.num_products
    limit = s.stable(0.0, s.stable.of_elements())  # of the springs that are closed
    assert (s.stable.highest.num_products == products) == contact_rules
    both = 2.0 / highest_frequency(s)
    springs = np.sqrt(2.0) / highest_frequency(s, bulk=False)
    # Lanczos adds its residual, up to 2 % of the eigenvalue and 1 % of its root.
    assert limit == pytest.approx(min(both, springs), rel=0.01)
    assert limit <= both
