"""The axisymmetric reference: its stored results."""

import weakref

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.theory import finite_sphere, hertz, plastic_contact
from mufe_fenicsx.verification import reference
from mufe_fenicsx.verification.axisymmetric.solver import Ball


def test_stored_results_are_converged():
    """What half the elements and steps change: four times what remains, for second order."""
    table = reference.load()
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


def test_a_ball_is_let_go():
    """A table takes hundreds, and each holds communicators, of which MPI has 2048."""
    ball = Ball(J2(1e11, 0.15, 2650.0, ((0.0, 1e9), (1.0, 2e9))), 0.2, elements=2, surface=1)
    assert ball.press(0.01).force > 0.0
    last = weakref.ref(ball)
    del ball
    assert last() is None
