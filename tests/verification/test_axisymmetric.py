"""The law of the axisymmetric elements is that of the kernel."""

from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

from mufe_fenicsx.kernels.hardening import plastic_increment
from mufe_fenicsx.kernels.solid import PLAIN, InternalForces
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.verification import axisymmetric_law as law

TABLE = ((0.0, 1.0), (0.01, 1.5), (0.03, 3.5), (0.1, 4.0))


def number(expression):
    return float(apply_algebra_lowering(ufl.as_ufl(expression))(()))


def test_the_forms_yield_as_the_kernel_does():
    """Return on a table that hardens more, then less."""
    material = J2(3000.0, 0.3, 1.0, TABLE)
    G, row = material.shear_modulus, material.parameters()
    random = np.random.default_rng(5)
    for q, alpha in zip(random.uniform(0.5, 400, 60), random.uniform(0, 0.12, 60), strict=True):
        found = number(law.plastic_increment(ufl.as_ufl(q), ufl.as_ufl(alpha), G, TABLE))
        expected = plastic_increment(q, 0.0, alpha, 1.0, G, row)
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_the_forms_take_a_step_as_the_kernel_does():
    """A tetrahedron with the axes r, hoop, z: two steps of large strain and turning, with yield."""
    material = J2(3000.0, 0.3, 1.0, TABLE)
    random = np.random.default_rng(2)
    x = np.array([[0, 0, 0], [1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    cells, grain = np.array([[0, 1, 2, 3]], dtype=np.int32), np.zeros(1, dtype=np.int64)
    kernel = InternalForces(
        cells, np.full(1, 1 / 6), np.array([0, 1]), grain, np.array([4]),
        np.array([material.bulk_modulus]), np.array([material.shear_modulus]),
        material.parameters()[None, :], np.zeros(4), PLAIN, x,
    )  # fmt: skip
    deviator, strain = np.zeros((1, 6)), np.zeros(1)
    before, state = motion(np.eye(3)), np.zeros(5)
    for _ in range(2):
        gradient = np.eye(3)
        gradient[np.ix_([0, 2], [0, 2])] += random.uniform(-0.2, 0.2, (2, 2))
        gradient[1, 1] += random.uniform(-0.2, 0.2)
        now = motion(gradient)
        state = law.deviator(now, before, ufl.as_vector(list(state)), material.shear_modulus,
                             TABLE, True)  # fmt: skip
        state = np.array([number(state[i]) for i in range(5)])
        old, x = x, np.eye(4, 3, -1) @ gradient.T
        kernel(np.zeros((4, 3)), deviator, strain, np.zeros(1), x, x - old, 1.0, grain)
        before = now
        # xx yy zz xy yz xz; the kernel's series for the angle end at the eighth power.
        np.testing.assert_allclose(state[:4], deviator[0, [0, 2, 1, 5]], rtol=1e-10)
        assert state[4] == pytest.approx(strain[0], rel=1e-10)
        assert state[4] > 0.01


def motion(gradient):
    """A homogeneous :class:`law.Motion`."""
    plane = ufl.as_matrix(gradient[np.ix_([0, 2], [0, 2])].tolist())
    return SimpleNamespace(F=plane, hoop=ufl.as_ufl(float(gradient[1, 1])))
