"""Closed forms and fits of spheres that yield: limits, continuity, identities."""

import numpy as np
import pytest

from mufe_fenicsx.theory import hertz, plastic_contact


@pytest.mark.parametrize("nu", [0.15, 0.3])
def test_onset_is_where_hertz_reaches_the_yield_stress(nu):
    R, E, Y = 1e-3, 100e9, 100e6
    C = plastic_contact.onset_factor(nu)
    delta, force, a = plastic_contact.onset(R, E, Y, C)
    assert hertz.hertz_force(delta, R, E) == pytest.approx(force, rel=1e-12)
    assert hertz.contact_radius(delta, R) == pytest.approx(a, rel=1e-12)
    assert 3 * force / (2 * np.pi * a**2) == pytest.approx(C * Y, rel=1e-12)
    # Johnson 1985, section 6.1: p0 = 1.60 Y for nu = 0.3; the fit is one to the same function.
    assert plastic_contact.onset_factor(0.3) == pytest.approx(1.613, abs=2e-3)
    assert plastic_contact.fitted_onset_factor(nu) == pytest.approx(C, rel=0.005)


def test_jackson_and_green_continue_hertz_and_end_on_the_plateau():
    R, E, Y, nu = 1e-3, 100e9, 100e6, 0.3
    delta_c = plastic_contact.onset(R, E, Y, plastic_contact.fitted_onset_factor(nu))[0]
    d = delta_c * plastic_contact.ELASTIC_UP_TO * np.array([1 - 1e-9, 1 + 1e-9])
    force, a = plastic_contact.jackson_green(d, R, E, Y, nu)
    # The fit itself jumps by that little.
    assert force[1] == pytest.approx(force[0], rel=0.005)
    assert a[1] == pytest.approx(a[0], rel=1e-6)
    elastic = hertz.hertz_force(0.5 * delta_c, R, E)
    assert plastic_contact.jackson_green(0.5 * delta_c, R, E, Y, nu)[0] == pytest.approx(elastic)
    # Deep, F over π a² tends to H, but for what is left of the exponential, 7 % here.
    deep = 2000 * delta_c
    force, a = plastic_contact.jackson_green(deep, R, E, Y, nu)
    mean = force / (np.pi * a**2) / Y
    assert mean == pytest.approx(plastic_contact.plateau(a / R), rel=0.08)
    assert plastic_contact.plateau(1e-6) == pytest.approx(2.84, rel=1e-9)


def test_hardening_lies_between_perfect_plasticity_and_hertz():
    R, E, Y, nu = 1e-3, 200e9, 0.5e9, 0.33
    modulus = E / (1 - nu**2)
    delta_c = plastic_contact.onset(R, modulus, Y, plastic_contact.fitted_onset_factor(nu))[0]
    delta = delta_c * np.array([2.0, 10.0, 50.0, 100.0])
    perfect, a_perfect = plastic_contact.jackson_green(delta, R, modulus, Y, nu)
    none, a_none = plastic_contact.ghaednia(delta, R, E, 0.0, Y, nu)
    # The same but for the two fits of the plateau.
    np.testing.assert_allclose(none, perfect, rtol=0.03)
    np.testing.assert_allclose(a_none, a_perfect, rtol=1e-12)
    before = none
    for ratio in (0.01, 0.1, 0.5):
        force, a = plastic_contact.ghaednia(delta, R, E, ratio * E, Y, nu)
        assert np.all(force > before) and np.all(a <= a_perfect)
        before = force
    assert np.all(before < hertz.hertz_force(delta, R, modulus))
