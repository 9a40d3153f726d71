"""Closed forms: their limits and the identities they have to satisfy."""

import numpy as np
import pytest

from mufe_fenicsx.theory import elasticity, finite_sphere, hertz, rotation


def test_oedometric_modulus_solves_hookes_law():
    E, nu = 100e9, 0.3
    compliance = (np.eye(3) * (1 + nu) - nu * np.ones((3, 3))) / E
    stress = np.linalg.solve(compliance, [0.0, 0.0, 1.0])
    assert elasticity.oedometric_modulus(E, nu) == pytest.approx(stress[2], rel=1e-13)
    assert elasticity.lateral_stress_ratio(nu) == pytest.approx(stress[0] / stress[2], rel=1e-13)
    assert elasticity.oedometric_modulus(E, 0.0) == E


def test_hertz_pressure_carries_the_force():
    """∫ p0 √(1 - ρ²/a²) dA = F, with p0 = 2 E* a / (π R)."""
    R, E, delta = 2e-3, 50e9, 1e-6
    a, force = hertz.contact_radius(delta, R), hertz.hertz_force(delta, R, E)
    p0 = hertz.largest_pressure(force, a)
    assert p0 == pytest.approx(2 * E * a / (np.pi * R), rel=1e-13)
    assert 2 / 3 * np.pi * a**2 * p0 == pytest.approx(force, rel=1e-13)
    assert hertz.hertz_force(-delta, R, E) == 0.0


def test_effective_values_of_a_rigid_plane_and_of_twins():
    assert hertz.effective_radius(1e-3, np.inf) == 1e-3
    assert hertz.effective_radius(1e-3, 1e-3) == 5e-4
    assert hertz.effective_modulus((1e9, 0.0), (1e9, 0.0)) == pytest.approx(5e8, rel=1e-15)


@pytest.mark.parametrize("nu, value, depth", [(0.15, 0.692, 0.431), (0.3, 0.620, 0.481)])
def test_largest_von_mises_stress_below_a_hertz_contact(nu, value, depth):
    """Johnson 1985, section 3.4, tabulated to three figures."""
    zeta = np.linspace(0.0, 2.0, 20001)
    axial, radial = hertz.stress_on_axis(zeta, nu)
    von_mises = np.abs(axial - radial)
    assert von_mises.max() == pytest.approx(value, abs=5e-4)
    assert zeta[von_mises.argmax()] == pytest.approx(depth, abs=1e-3)


def test_stress_on_the_axis_at_the_surface_and_far_below():
    axial, radial = hertz.stress_on_axis(np.array([0.0, 1e3]), 0.3)
    assert axial[0] == -1.0 and radial[0] == pytest.approx(-(0.5 + 0.3), rel=1e-13)
    assert abs(axial[1]) < 2e-6 and abs(radial[1]) < 2e-6


def test_mean_stress_of_a_spinning_bar():
    """Of a bar of length 2L: σ = ρω²(L² - x²)/2, whose mean is ρω²L²/3."""
    rho, omega, L = 2650.0, 100.0, 0.5
    x = (np.arange(10000) + 0.5) / 10000 * L
    mean = np.mean(0.5 * rho * omega**2 * (L**2 - x**2))
    # The midpoint rule: error h²/12 relative.
    assert rotation.mean_centrifugal_stress(rho, omega, L**2 / 3) == pytest.approx(mean, rel=1e-8)


def test_sphere_under_uniform_pressure():
    """Order 0: u = σ R/(3K), with 2G/3K = (1 - 2ν)/(1 + ν)."""
    nu = 0.2
    ur = finite_sphere.surface_compliance(np.array([0.0]), nu)[0]
    assert ur[0] == pytest.approx((1 - 2 * nu) / (1 + nu), rel=1e-13)


def test_sphere_in_simple_tension():
    """σz = 1 is σr = 1/3 + 2/3 P2 and τ = P2'/3; then u_z = z/E and u_x = -ν x/E."""
    nu = 0.2
    rs, rt, ts, tt = (c[0] for c in finite_sphere.surface_compliance(np.array([2.0]), nu))
    zero = finite_sphere.surface_compliance(np.array([0.0]), nu)[0][0]
    ur2, ut2 = 2 / 3 * rs + 1 / 3 * rt, 2 / 3 * ts + 1 / 3 * tt
    theta = np.array([0.3, 1.1])
    P2 = 0.5 * (3 * np.cos(theta) ** 2 - 1)
    # In units of R/2G: 2G/E = 1/(1 + ν).
    ur = (np.cos(theta) ** 2 - nu * np.sin(theta) ** 2) / (1 + nu)
    ut = -np.sin(theta) * np.cos(theta)
    np.testing.assert_allclose(zero / 3 + ur2 * P2, ur, rtol=1e-12)
    np.testing.assert_allclose(ut2 * -3 * np.sin(theta) * np.cos(theta), ut, rtol=1e-12)


@pytest.mark.parametrize("order", [50.0, 500.0])
def test_high_orders_see_a_half_space(order):
    """u = p (1 - ν)/(G k) with k = n + ½ under a wavy pressure; differs by 1/n."""
    nu = 0.2
    ur = finite_sphere.surface_compliance(np.array([order]), nu)[0][0]
    assert ur == pytest.approx(2 * (1 - nu) / (order + 0.5), rel=1 / order)


def test_finite_sphere_tends_to_hertz():
    """The difference is O(a/R ln a/R): it falls as a/R does."""
    errors = []
    for a in (0.1, 0.02):
        delta, force, p0 = finite_sphere.compression(a, 0.15)
        errors.append(abs(force / (4 / 3 * delta**1.5) - 1))
        assert abs(p0 / (2 * a / np.pi) - 1) < 0.3 * a
    assert errors[1] < errors[0] / 5
    assert 0.03 < errors[0] < 0.06
