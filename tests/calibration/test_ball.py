"""The table of a ball between platens against other solutions."""

import numpy as np
import pytest

from mufe_fenicsx.calibration import ball
from mufe_fenicsx.calibration.data import Curve, Size
from mufe_fenicsx.calibration.model import Setup, forces
from mufe_fenicsx.theory import finite_sphere, hertz
from mufe_fenicsx.verification import reference

#: Of the table, whose mesh has 8 edges on the radius of the contact: of balls that harden, and of
#: others, whose contact grows node by node. Their reference is converged to 2.8 %.
HARDENS, PERFECT = 0.02, 0.04


def force_over_ER2(nu, Y_over_E, H_over_Y, delta):
    """From the table, at approaches over R."""
    x, ratio, _ = ball.load().course(nu, Y_over_E * (1 - nu**2), H_over_Y)
    return 4 / 3 / (1 - nu**2) * delta**1.5 * np.interp(delta, x, ratio)


@pytest.mark.parametrize("nu", [0.0, 0.15, 0.3, 0.45])
def test_a_ball_that_does_not_yield_is_that_of_the_reference(nu):
    """Of the series for small contacts, also beyond the ν of the table; of large strain then."""
    delta, force, _ = finite_sphere.compression(0.04, nu)
    found = force_over_ER2(nu, 1.0, 0.0, np.array(delta)) * (1 - nu**2)
    assert found == pytest.approx(force, rel=0.01)
    stored = reference.load().get(reference.elastic_name(0.16, nu, True))
    if stored is None:
        return
    found = force_over_ER2(nu, 1.0, 0.0, stored["delta"])
    assert found == pytest.approx(stored["force"], rel=0.01)


def test_small_contacts_are_those_of_hertz():
    """Exact as the approach goes to 0: similarity leaves what the smallest ball has, 1 %."""
    delta = np.array([1e-7, 1e-6])
    found = force_over_ER2(0.15, 1.0, 0.0, delta)
    theory = hertz.hertz_force(delta, 1.0, 1 / (1 - 0.15**2))
    assert found == pytest.approx(theory, rel=0.015)


@pytest.mark.parametrize(
    ("name", "nu", "Y_over_E", "H_over_Y", "error"),
    [
        (reference.perfect_name(100, 0.3), 0.3, 1e-2, 0.0, PERFECT),
        (reference.perfect_name(1000, 0.3), 0.3, 1e-3, 0.0, PERFECT),
        (reference.paper_name(10e6), 0.15, 1e-4, 200.0, HARDENS),
        (reference.paper_name(40e6), 0.15, 4e-4, 50.0, HARDENS),
    ],
)
def test_balls_that_yield_are_those_of_the_reference(name, nu, Y_over_E, H_over_Y, error):
    """Its mesh is twice as fine, its base glued, and its strains at other points of the grid."""
    stored = reference.load()[name]
    found = force_over_ER2(nu, Y_over_E, H_over_Y, stored["delta"])
    assert found == pytest.approx(stored["force"], rel=error)


def test_hardening_and_yield_raise_the_force():
    """No spline between the points turns that round, but for 1 %, the error of balls beside."""
    table = ball.load()
    grid = np.geomspace(7e-5, 0.06, 25)
    forces = np.array([table.course(0.2, Y, 50.0)[1] for Y in grid])
    assert (np.diff(forces, axis=0) > -0.01).all()
    forces = np.array([table.course(0.2, 1e-3, k)[1] for k in np.geomspace(1.0, 3000.0, 25)])
    assert (np.diff(forces, axis=0) > -0.01).all()


@pytest.mark.parametrize(
    ("test", "contacts", "R", "bodies"),
    [
        ("platens", 2, 1.0, [(70e9, 0.2), (210e9, 0.3)]),
        ("platen", 1, 1.0, [(70e9, 0.2), (210e9, 0.3)]),
        ("grains", 1, 0.5, [(70e9, 0.2), (70e9, 0.2)]),
    ],
)
def test_grains_that_do_not_yield_follow_hertz_machine_and_offset(test, contacts, R, bodies):
    """D = o + n δ + C F at small contacts, with the closed form of each contact."""
    d, offset, compliance = 1e-3, 2e-7, 1e-8
    delta = np.linspace(1e-8, 2e-7, 20)
    force = hertz.hertz_force(delta, R * d / 2, hertz.effective_modulus(*bodies))
    displacement = offset + contacts * delta + compliance * force
    curve = Curve("", displacement, force, Size(d, d, d))
    setup = Setup(0.2, test, (210e9, 0.3))
    found = forces(curve, setup, setup.course(70e9, 50e9, 1e9), offset, compliance)[0]
    assert found == pytest.approx(force, rel=0.02)  # the table's error, 1 % of the force
