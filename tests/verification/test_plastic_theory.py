"""Closed forms and fits of spheres that yield: limits, continuity, identities."""

import numpy as np
import pytest

from mufe_fenicsx.theory import hertz, plastic_contact, plastic_impact


def restitution_by_work(v, p, E, m, R, num_steps=20000):
    """The same from the law of force, integrated: for a check of the closed form.

    Args:
        v: Speed of impact [m/s].
        p, E, m, R: As of ``plastic_impact.yield_speed``.
        num_steps: Of the integration.
    """
    a_yield = np.pi * R * p / (2 * E)
    delta_yield = a_yield**2 / R
    force_yield = 4 / 3 * E * a_yield**3 / R
    energy = 0.5 * m * v**2
    end = 4 * delta_yield + 2 * np.sqrt(energy / (np.pi * R * p))
    delta = np.linspace(0.0, end, num_steps)
    hertz = 4 / 3 * E * np.sqrt(R * np.minimum(delta, delta_yield) ** 3)
    force = hertz + np.pi * R * p * np.maximum(delta - delta_yield, 0.0)
    work = np.append(0.0, np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(delta)))
    last = np.interp(energy, work, delta)
    if last <= delta_yield:
        return 1.0
    largest = force_yield + np.pi * R * p * (last - delta_yield)
    # The contact has the radius √(R δ), and carries this force as one of the radius R_p would.
    a = np.sqrt(R * last)
    R_p = 4 * E * a**3 / (3 * largest)
    back = np.linspace(0.0, a**2 / R_p, num_steps)
    unload = 4 / 3 * E * np.sqrt(R_p * back**3)
    return float(np.sqrt(np.sum(0.5 * (unload[1:] + unload[:-1]) * np.diff(back)) / energy))


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


def test_restitution_is_that_of_the_law_of_force():
    R, E, m, p = 1e-3, 50e9, 1e-5, 300e6
    v_yield = plastic_impact.yield_speed(p, E, m, R)
    assert plastic_impact.restitution(v_yield, v_yield) == pytest.approx(1.0, rel=1e-14)
    for ratio in (0.5, 1.5, 10.0, 100.0):
        work = restitution_by_work(ratio * v_yield, p, E, m, R)
        # The trapezoidal rule on 20000 steps.
        assert plastic_impact.restitution(ratio * v_yield, v_yield) == pytest.approx(work, rel=1e-5)
    # (6√3/5)^½ / (2 √(6/5))^¼, 1e-4 of V_y.
    limit = plastic_impact.restitution(1e8 * v_yield, v_yield)
    assert limit == pytest.approx(1.185 * 1e-2, rel=1e-3)


def test_thorntons_law_of_force_has_his_restitution_by_its_curve():
    R, E, m, p = 1e-3, 50e9, 1e-5, 300e6
    v = 20 * plastic_impact.yield_speed(p, E, m, R)
    # Roots of the approach are even: the curve starts as one of its powers.
    delta = (np.linspace(0, 1, 100001) ** 2) * 0.05 * R
    start = R * (np.pi * p / (2 * E)) ** 2
    elastic = hertz.hertz_force(np.minimum(delta, start), R, E)
    force = elastic + np.pi * R * p * np.maximum(delta - start, 0)
    found = plastic_impact.restitution_by_curve(0.5 * m * v**2, delta, force, np.sqrt(R * delta), E)
    # Of the trapezoidal rule.
    assert found == pytest.approx(restitution_by_work(v, p, E, m, R), rel=1e-5)
