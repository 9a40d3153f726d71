"""Theory of impact: limits, identities, and a second way to the same numbers."""

import numpy as np
import pytest

from mufe_fenicsx.theory import ball_impact, finite_sphere, impact, oblique_impact, sphere_modes
from mufe_fenicsx.verification.impact import contact_time

NU = 0.3
CHI = oblique_impact.inertia_parameter(NU)


def test_hertz_impact_keeps_energy_and_lasts_as_long_as_its_integral():
    m, R, E, v = 1e-5, 1e-3, 50e9, 2.0
    found = impact.hertz_impact(m, R, E, v)
    # ∫ F dδ = 2/5 F δ = m v²/2
    assert 0.4 * found.force * found.approach == pytest.approx(0.5 * m * v**2, rel=1e-13)
    # Johnson 1985, eq. (11.24), to three figures.
    assert found.time == pytest.approx(2.87 * (m**2 / (R * E**2 * v)) ** 0.2, rel=1e-3)
    _, delta, _, work, time = impact.loading(lambda r: r**2, lambda r: r**3)
    assert work == pytest.approx(0.4, rel=1e-8)
    assert 2 * time[-1] / delta[-1] == pytest.approx(impact.DURATION, rel=1e-4)


def test_contact_is_timed_by_its_force_above_a_level_where_facets_touch_one_by_one():
    time, force = impact.hertz_pulse(20001)
    for level in (0.02, 0.1):  # the series is good to 1e-6, interpolation to 1e-5
        above = 1 - 2 * np.interp(level, force[:10001], time[:10001])
        assert impact.part_above(level) == pytest.approx(above, abs=1e-5)
    # Forty samples of a contact that lasts 3, from 1 on, and touches before and after.
    t = np.linspace(0.0, 6.0, 81)
    touching = np.interp(t, 1.0 + 3.0 * time, force, 0.0, 0.0)
    touching[[3, 8, 70]] += 0.015
    # Chords of t^(3/2) cross the level late, by up to a tenth of the way between two samples,
    # which is 2.5 % of the contact.
    assert contact_time(t, touching) == pytest.approx(3.0, rel=5e-3)
    # A ball that is still there at 2.925 has been so far; 0.075 are below the level.
    part = impact.part_above(0.02)
    assert contact_time(t[:40], touching[:40]) == pytest.approx((1.925 - 0.075) / part, rel=5e-3)


def test_spectrum_of_the_pulse():
    """Its mean is the impulse; a slow sum over the pulse gives the same at high phase."""
    mean = 2 / (1.25 * impact.DURATION)  # 2 m v = F t_c mean, F = 5/4 m v²/δ
    assert impact.pulse_spectrum(0.0) == pytest.approx(mean, rel=1e-10)
    time, force = impact.hertz_pulse(20001)
    for phase in (7.0, 60.0):
        slow = np.trapezoid(force * np.cos(phase * (time - 0.5)), time)
        assert impact.pulse_spectrum(phase) == pytest.approx(slow, abs=1e-7)


def test_whole_ball_tends_to_hertz():
    """The differences are O(a/R ln a/R)."""
    m, R, E, rho = 1.1e-5, 1e-3, 1.02e11, 2650.0
    errors = []
    for v in (10.0, 0.1):
        whole, hertz = ball_impact.ball_impact(m, R, E, 0.15, v), impact.hertz_impact(m, R, E, v)
        errors.append([whole.time / hertz.time - 1, whole.force / hertz.force - 1])
        # Energy: ∫ F dδ lies between that of a spring and of a stiffer one than Hertz's.
        assert 0.37 < 0.5 * m * v**2 / (whole.force * whole.approach) < 0.4
    errors = np.abs(errors)
    assert np.all(errors[0] < 0.05) and np.all(errors[1] < 0.15 * errors[0])
    # The slower, the longer the contact against a period.
    slow, fast = (sphere_modes.vibration_loss(m, R, E, 0.15, rho, v) for v in (0.1, 10.0))
    assert slow < 1e-5 < fast < 1e-3


def test_contact_along_the_surface_tends_to_the_half_space():
    errors = []
    for a in (0.1, 0.025):
        ball, half_space = ball_impact.tangential_compliance(a, NU)
        errors.append(ball / half_space - 1)
    # Softer, as a ln(1/a): 4 times nearer would be 4/1.6 = 2.5 times smaller at least.
    assert 0 < errors[1] < errors[0] / 1.5 and errors[0] < 0.1


@pytest.mark.parametrize("nu, lowest", [(0.15, 2.6246), (0.25, 2.6399)])
def test_frequencies_of_lamb(nu, lowest):
    """₀S₂ of Lamb 1882 to the five figures of the tables."""
    assert sphere_modes.modes(nu)[0].order == 2
    assert sphere_modes.modes(nu)[0].frequency == pytest.approx(lowest, abs=5e-5)
    breathing = next(mode for mode in sphere_modes.modes(nu) if mode.order == 0)
    if nu == 0.15:  # ω R/c_p = 2.3612
        ratio = np.sqrt((1 - 2 * nu) / (2 * (1 - nu)))
        assert breathing.frequency * ratio == pytest.approx(2.3612, abs=5e-5)


@pytest.mark.parametrize("order", [0, 2, 3])
def test_modes_add_up_to_the_static_compliance(order):
    """Σ 1/(mᵢ ωᵢ²) is the static displacement; modes above 100 hold about 1/100 of it."""
    static = finite_sphere.surface_compliance(np.array([order]), NU)[0][0] / 2
    modal = sum(
        3 / ((2 * order + 1) * mode.mass * mode.frequency**2)
        for mode in sphere_modes.modes(NU, 100.0, 3)
        if mode.order == order
    )
    assert 0.97 < modal / static < 1.0


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
def test_oblique_impact_that_slips_all_the_time(nu):
    """ψ₂ = ψ₁ - 4χ from the impulse alone, at and above ψ₁ = 4χ - 1."""
    chi = oblique_impact.inertia_parameter(nu)
    for psi1 in (4 * chi - 1, 9.0):
        found = oblique_impact.oblique_impact(psi1, chi)
        # The trapezoidal rule of the rings: 0.2 % of the change.
        assert found.psi2 == pytest.approx(psi1 - 4 * chi, abs=0.01)
        spin = oblique_impact.spin_change(psi1, found.psi2, nu)
        assert spin == pytest.approx(5.0, rel=2e-3)
        np.testing.assert_allclose(found.tangential, found.normal, atol=0.02)


def test_oblique_impact_loses_what_friction_takes():
    """(ψ₁² - ψ₂²)/2 is the work of friction, never negative; the rings' error falls as 1/n."""
    errors = []
    for num_rings in (30, 60):
        worst = 0.0
        for psi1 in (0.05, 0.3, 1.0, 2.0, 3.5, 5.0):
            found = oblique_impact.oblique_impact(psi1, CHI, num_rings)
            lost = 0.5 * (psi1**2 - found.psi2**2)
            assert lost >= 0
            worst = max(worst, abs(found.dissipated - lost) / psi1)
        errors.append(worst)
    assert errors[1] < 0.6 * errors[0] and errors[1] < 0.005


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("psi1", [0.2, 1.0, 3.0, 4.5])
def test_oblique_impact_by_independent_springs(nu, psi1):
    """A row of springs, each with friction of its own, has the same forces as the rings.

    Method of dimensionality reduction: V. L. Popov, M. Heß, Method of Dimensionality Reduction
    in Contact Mechanics and Friction, 2015, chapter 5.
    """
    chi = oblique_impact.inertia_parameter(nu)
    x, dt = (np.arange(300) + 0.5) / 300, impact.DURATION / 3000
    spring = np.zeros(x.size)
    delta, speed, psi, force = 0.0, 1.0, psi1, 0.0
    while True:
        speed, psi = speed - 0.625 * dt * delta**1.5, psi - 1.25 * chi * dt * force
        delta += dt * speed
        if delta <= 0:
            break
        limit = np.maximum(delta - x**2, 0.0)
        spring = np.clip(spring + dt * psi, -limit, limit)
        force = 1.5 * spring.mean()
        speed, psi = speed - 0.625 * dt * delta**1.5, psi - 1.25 * chi * dt * force
    # The error of 60 rings.
    assert oblique_impact.oblique_impact(psi1, chi).psi2 == pytest.approx(psi, abs=0.006)


def test_oblique_impact_against_finite_elements():
    """R Δω/(μ V) of steel (ν = 0.3) against v/(μ V), finite elements in Chung & Ooi 2011, test 5.

    Read off their figure; 2 % of the range is what reading and those elements allow.
    """
    curve = [(0.59, 0.41), (1.19, 0.98), (1.90, 1.79), (2.76, 2.86), (3.89, 4.04), (5.66, 4.94)]
    kappa = oblique_impact.tangential_ratio(NU)
    for ratio, spin in curve:
        psi1 = kappa * ratio
        found = oblique_impact.oblique_impact(psi1, CHI)
        assert oblique_impact.spin_change(psi1, found.psi2, NU) == pytest.approx(spin, abs=0.1)
