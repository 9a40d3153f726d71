"""What was put in comes back, with honest intervals and sentences."""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import weibull_min

from mufe_fenicsx.calibration import sentences
from mufe_fenicsx.calibration.covariance import covariance_of
from mufe_fenicsx.calibration.data import Rubbed, Size
from mufe_fenicsx.calibration.fit import Given, fit_curves, fit_simplest
from mufe_fenicsx.calibration.friction import fit_friction, mindlin_force
from mufe_fenicsx.calibration.model import Setup, forces
from mufe_fenicsx.calibration.parts import agreement
from mufe_fenicsx.calibration.weibull import fit_weibull
from mufe_fenicsx.theory import mindlin
from mufe_fenicsx.verification.calibrate import (
    COMPLIANCE,
    GLASS_NU,
    STEEL,
    YIELD,
    E,
    made_curves,
)

SETUP = Setup(GLASS_NU, "platens", STEEL)


def test_parameters_come_back_from_curves_with_noise():
    """Twenty curves of 3 %, offsets and a soft machine: the figures that the command promises."""
    H = 10e9
    curves = made_curves(SETUP.course(E, YIELD, H), SETUP, 20, 0.03, 5)
    fit = fit_curves(curves, SETUP)
    assert fit.value("E") == pytest.approx(E, rel=0.03)
    assert fit.value("yield") == pytest.approx(YIELD, rel=0.10)
    strain, stress, (low, high) = sentences.end_of_table(fit)
    assert stress == pytest.approx(YIELD + H * strain, rel=0.10)
    assert low < YIELD + H * strain < high
    assert fit.scatter == pytest.approx(0.03, rel=0.2)  # 800 points; the floor takes some


def test_the_variance_of_a_mean_is_that_of_books():
    """Of 9 curves that of their means; of few that of points, of which neighbours are alike."""
    values = np.random.default_rng(0).standard_normal((9, 20)) + 2.0 * np.arange(9)[:, None]
    every, means = np.ones((180, 1)), values.mean(axis=1)
    found, freedom = covariance_of(
        every, values.ravel() - values.mean(), [20] * 9, np.array([True])
    )
    # All is exact: only rounding remains.
    assert found[0, 0] == pytest.approx(means.var(ddof=1) / 9, rel=1e-12) and freedom == 8
    strayed = np.cumsum(values, axis=1)[0] - np.cumsum(values, axis=1)[0].mean()
    a, b = strayed[:-1], strayed[1:]
    rho = min(2 * (a @ b) / (a @ a + b @ b), 0.9)
    found, _ = covariance_of(every[:20], strayed, [20], np.array([True]))
    wanted = strayed.var(ddof=1) / 20 * (1 + rho) / (1 - rho)  # of an autoregression
    assert found[0, 0] == pytest.approx(wanted, rel=1e-12)


def test_elastic_curves_give_no_yield_stress():
    """Small forces of hard grains: the yield stress has a least value only."""
    curves = made_curves(SETUP.course(E, 50e9, 1e9), SETUP, 6, 0.02, 1)
    fit, given = fit_simplest(curves, SETUP, Given())
    assert not sentences.yielded(fit) and given.elastic
    low, high = fit.interval("E")
    assert low < E < high < 1.2 * low  # six curves of 2 %, a soft machine
    (said,) = sentences.limits_of(fit, given)
    assert "at least about" in said
    # At their largest force grains of that yield stress begin to leave the branch.
    least = sentences.least_yield(fit)
    again = SETUP.course(fit.value("E"), least, 0.0)[1] / SETUP.course(fit.value("E"), E, 0.0)[1]
    most = max(c.force.max() / c.size.radius**2 for c in curves)
    assert again[SETUP.course(E, E, 0.0)[1] < most].min() == pytest.approx(1.0, abs=0.1)
    assert 'model = "elastic"' in sentences.material_block(fit, 0.2, 2500.0)


def test_what_comes_to_an_end_of_its_range_has_no_interval():
    """Forces of a machine that gives way by less than nothing."""
    course = SETUP.course(E, YIELD, 10e9)
    (curve,) = made_curves(course, SETUP, 1, 0.0, 0)
    force = forces(curve, SETUP, course, 0.0, -0.1 * COMPLIANCE)[0]
    fit = fit_curves([replace(curve, force=force)], SETUP)
    assert fit.held == ["compliance"] and fit.value("compliance") == 0.0
    said = sentences.limits_of(fit, Given())
    assert said[0].startswith("compliance = 0 m/N is an end of what is")


def test_what_one_curve_does_not_determine_is_said():
    """Where all flows the force hardly depends on the modulus; with it the rest is known."""
    curves = made_curves(SETUP.course(100e9, 20e6, 1e9), SETUP, 1, 0.03, 1)
    fit = fit_curves(curves, SETUP)
    assert "do not determine Young's modulus" in " ".join(sentences.limits_of(fit, Given()))
    (curve,) = curves
    waves = 1 + 0.1 * np.sin(20 * curve.displacement / curve.displacement.max())
    assert sentences.misfit(fit) is None
    other = fit_curves([replace(curve, force=curve.force * waves)], SETUP)
    assert other.noise == pytest.approx(0.03, rel=0.2)  # as of the scatter above
    said = sentences.misfit(other)
    assert said and said in sentences.limits_of(other, Given())
    held = fit_curves(curves, SETUP, Given(E=100e9, compliance=COMPLIANCE))
    assert held.value("hardening") == pytest.approx(1e9, rel=0.1)  # 200 points of 3 %


def test_another_hardening_that_fits_as_well_is_in_the_intervals():
    """Of one curve the best fit has none, and its yield stress alone would miss the true one."""
    H = 10e9
    curves = made_curves(SETUP.course(E, YIELD, H), SETUP, 1, 0.03, 11)
    given = Given(compliance=COMPLIANCE)
    assert fit_curves(curves, SETUP, given).interval("yield")[0] > YIELD
    fit, _ = fit_simplest(curves, SETUP, given)
    assert fit.held == ["hardening"]
    strain, _, ends = sentences.end_of_table(fit)
    for (low, high), true in (
        (fit.interval("yield"), YIELD), (fit.interval("hardening"), H), (ends, YIELD + H * strain)
    ):  # fmt: skip
        assert low < true < high


def power_law(E, first, exponent, ends=0.002):
    """Approaches and stresses of balls with σ = Y (1 + ε/ε₀)ⁿ, by Tabor's strain, 0.2 a/R."""
    delta = np.geomspace(1e-7, 0.037, 60)
    Y = first * (1 + 0.2 * np.sqrt(2 * delta) / ends) ** exponent
    stress = [np.interp(d, *SETUP.course(E, y, 0.0)[:2]) for d, y in zip(delta, Y, strict=True)]
    fine = np.geomspace(delta[0], delta[-1], 2000)
    return fine, np.exp(np.interp(np.log(fine), np.log(delta), np.log(stress)))


def test_a_law_that_fits_with_another_modulus_is_not_confirmed_by_parts():
    """No residual tells that a grain hardens by a power of strain; grains of the model's law do."""
    course = power_law(95e9, 0.3e9, 0.3)
    curves = made_curves(course, SETUP, 12, 0.02, 3)
    fit = fit_curves(curves, SETUP)
    law = agreement(fit, curves, SETUP, Given())
    assert sentences.misfit(fit) is None and not law.agrees
    assert sentences.reasons(fit, Given(), law)[-1].startswith("Up to their largest force")
    block = sentences.material_block(fit, GLASS_NU, 2500.0, unsure=True)
    assert not {"E", "yield_stress"} & set(tomllib.loads(block)["material"])
    # Tabor's strain makes curves nearly those of a grain; whole ones are three times as far off.
    assert law.values[-1] == pytest.approx(95e9, rel=0.15) and law.values[0] > 1.45 * 95e9

    curves = made_curves(SETUP.course(E, YIELD, 10e9), SETUP, 6, 0.02, 3)
    fit = fit_curves(curves, SETUP)
    law = agreement(fit, curves, SETUP, Given())
    assert law.agrees and not sentences.reasons(fit, Given(), law)
    # From a tenth of the force on grains flow, and what is below could have told.
    late = [replace(c, displacement=c.displacement[on], force=c.force[on])
            for c in curves for on in [c.force > 0.1 * c.force.max()]]  # fmt: skip
    law = agreement(fit_curves(late, SETUP), late, SETUP, Given())
    assert not law.agrees
    assert sentences.reasons(fit, Given(), law)[-1].startswith("Curves begin at 10 % of")


def test_the_model_s_own_error_is_in_intervals():
    """Curves without noise whose forces are 1 % off: the modulus is within its interval."""
    delta, stress, _ = SETUP.course(E, YIELD, 10e9)
    for error in (1.01 + 0.0 * delta, 1 + 0.007 * np.log10(delta / 0.004)):
        curves = made_curves((delta, stress * error), SETUP, 6, 1e-4, 1)
        fit = fit_curves(curves, SETUP)
        low, high = fit.interval("E")
        assert low < E < high < 1.25 * low


def test_friction_and_stiffness_of_mindlin():
    """The formula is that of theory; friction comes back within its interval."""
    mu, P, a, S = 0.3, 2.0, 1e-5, 1e-10
    Q = np.linspace(0.01, 0.99, 30) * mu * P
    way = mindlin.displacement(Q, P, mu, a, S)
    stiffness = mindlin.stick_stiffness(a, S)
    assert mindlin_force(way, stiffness, mu * P) == pytest.approx(Q, rel=1e-9)  # round-off

    rng = np.random.default_rng(3)
    curves = []
    for P in (1.0, 3.0, 9.0):
        x = np.linspace(0.0, 6 * mu * P / stiffness, 50)
        force = mindlin_force(x - 0.1 * x[-1], stiffness, mu * P)
        force += 0.01 * P * rng.standard_normal(50)
        curves.append(Rubbed(f"{P}", x, force, np.full(50, P)))
    found = fit_friction(curves)
    assert found.interval[0] < mu < found.interval[1] and found.sliding == 3
    assert found.stiffness == pytest.approx(stiffness, rel=0.2)  # few points before it slides


def test_weibull_is_that_of_scipy_and_its_intervals_hold():
    """Maximum likelihood of equal sizes; twenty samples of 25 hold m in 16 or more."""
    rng = np.random.default_rng(1)
    d, m, strength, hits = 1e-3, 3.5, 80e6, 0
    for sample in range(20):
        forces = strength * rng.weibull(m, 25) * d**2
        found = fit_weibull(forces, np.full(25, d))
        hits += found.modulus_interval[0] < m < found.modulus_interval[1]
        if sample == 0:
            shape, _, scale = weibull_min.fit(forces / d**2, floc=0)
            assert found.modulus == pytest.approx(shape, rel=1e-4)  # both stop there
            assert found.strength == pytest.approx(scale, rel=1e-4)
    assert hits >= 16  # of 19 expected, three standard deviations less


def test_size_effect_of_flaws_in_the_volume():
    rng = np.random.default_rng(2)
    d = rng.uniform(0.4e-3, 1.6e-3, 60)
    stress = 80e6 * (d / 1e-3) ** (-3 / 3.5) * rng.weibull(3.5, 60)
    found = fit_weibull(stress * d**2, d)
    assert found.exponent_interval[0] < 3 / 3.5 < found.exponent_interval[1]


def test_an_ellipsoid_has_the_radius_of_its_curvature():
    """R = w²/2h of two like axes; of others nearly the root of both."""
    assert Size(0.8, 0.8, 0.5).radius == pytest.approx(0.4**2 / 0.25, rel=1e-6)
    both = Size(1.0, 0.8, 0.6)
    mean = math.sqrt(1.0**2 / 1.2 * 0.8**2 / 1.2)
    assert both.radius == pytest.approx(mean, rel=0.02)  # Johnson 1985, section 4.3
