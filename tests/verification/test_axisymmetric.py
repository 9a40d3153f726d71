"""The axisymmetric reference: its law, its stored results, and that they can be made again."""

from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.kernels.hardening import plastic_increment
from mufe_fenicsx.kernels.solid import PLAIN, InternalForces
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.theory import finite_sphere, hertz, plastic_contact
from mufe_fenicsx.verification import reference
from mufe_fenicsx.verification.axisymmetric import cases as cases
from mufe_fenicsx.verification.axisymmetric import law as law

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
        np.array([material.bulk_modulus]), np.array([material.shear_modulus]), np.zeros(1),
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


def test_stored_results_are_converged():
    """What half the elements and steps change: four times what remains, for second order."""
    table = reference.load()
    assert sorted(table) == sorted(case.name for case in cases.all_cases())
    for name, course in table.items():
        if name.startswith("elastic"):
            for column in ("force", "moment_radius", "p0"):
                assert course.change(column).max() < 0.001, (name, column)
        else:
            # Single rows jump as nodes close, by the area of a ring between nodes.
            mean = np.nanmean(course.checks["force"] / course["force"]) - 1
            assert abs(mean) < 0.012, name
            assert course.change("force").max() < 0.04, name


@pytest.mark.parametrize("nu", [0.15, 0.3])
def test_stored_elastic_balls_are_those_of_theory(nu):
    table, modulus = reference.load(), 1 / (1 - nu**2)
    for a in (0.005, 0.04, 0.16):
        linear = table[reference.elastic_name(a, nu, False)]
        _, force, p0 = finite_sphere.compression(a, nu)
        # The series ends at order 80 R/a, the mesh at 60 edges: some parts of 10⁴ each.
        assert linear["force"][0] == pytest.approx(modulus * force, rel=3e-4)
        assert linear["p0"][0] == pytest.approx(modulus * p0, rel=1e-3)
        assert linear["moment_radius"][0] == pytest.approx(a, rel=3e-3)
        # Large strain: of the order of the strain, a/R.
        assert abs(reference.large_strain(a, nu) - 1) < 0.15 * a
    # Hertz, the finite size left out: 0.4 a/R.
    small = table[reference.elastic_name(0.005, nu, True)]
    assert small["force"][0] == pytest.approx(
        hertz.hertz_force(small["delta"][0], 1.0, modulus), rel=0.002
    )
    zeta = np.linspace(0.2, 1, 8001)
    axial, radial = hertz.stress_on_axis(zeta, nu)
    mises = np.abs(axial - radial)
    # As before, and a fit of the stress around the axis.
    assert small["mises"][0] / small["p0"][0] == pytest.approx(mises.max(), rel=0.005)
    assert small["mises_depth"][0] == pytest.approx(zeta[mises.argmax()], abs=0.01)


@pytest.mark.parametrize("nu", [0.15, 0.3])
def test_stored_yielding_balls_are_near_the_fits(nu):
    """Jackson and Green fitted elements with ν = 0.32, to some percent."""
    course = reference.load()[reference.perfect_name(1000, nu)]
    force, _ = plastic_contact.jackson_green(course["delta"], 1.0, 1 / (1 - nu**2), 1e-3, nu)
    np.testing.assert_allclose(course["force"], force, rtol=0.08)


def test_an_approach_beyond_the_table_is_refused():
    course = reference.load()[reference.steel_name(140)]
    with pytest.raises(InputError, match=r"approach over radius = 0.001 to 0.1, expected"):
        course.at([0.001, 0.1])
