"""Closed forms: their limits and the identities they have to satisfy."""

import itertools

import numpy as np
import pytest

from mufe_fenicsx.theory import (
    elasticity,
    finite_sphere,
    hertz,
    hypoelastic,
    mindlin,
    rolling,
    rotation,
    torsion,
)


def test_oedometric_modulus_solves_hookes_law():
    E, nu = 100e9, 0.3
    compliance = (np.eye(3) * (1 + nu) - nu * np.ones((3, 3))) / E
    stress = np.linalg.solve(compliance, [0.0, 0.0, 1.0])
    assert elasticity.oedometric_modulus(E, nu) == pytest.approx(stress[2], rel=1e-13)
    assert elasticity.lateral_stress_ratio(nu) == pytest.approx(stress[0] / stress[2], rel=1e-13)
    assert elasticity.oedometric_modulus(E, 0.0) == E


def test_rayleigh_speed_at_a_quarter():
    """ν = 1/4: r = 2 - 2/√3, and G = E/2.5."""
    speed = elasticity.rayleigh_speed(2.5, 0.25, 1.0)
    assert speed == pytest.approx(np.sqrt(2.0 - 2.0 / np.sqrt(3.0)), rel=1e-12)


def test_hertz_pressure_carries_the_force():
    """∫ p0 √(1 - ρ²/a²) dA = F, with p0 = 2 E* a / (π R)."""
    R, E, delta = 2e-3, 50e9, 1e-6
    a, force = hertz.contact_radius(delta, R), hertz.hertz_force(delta, R, E)
    p0 = 3 * force / (2 * np.pi * a**2)
    assert p0 == pytest.approx(2 * E * a / (np.pi * R), rel=1e-13)
    assert 2 / 3 * np.pi * a**2 * p0 == pytest.approx(force, rel=1e-13)
    assert hertz.hertz_force(-delta, R, E) == 0.0


def test_effective_modulus_of_twins():
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


# --- friction of spheres ----------------------------------------------------------------------

#: Two like balls, pressed; the contact of one millimetre of effective radius.
BALL = (100e9, 0.3)
MODULUS, S = hertz.effective_modulus(BALL, BALL), mindlin.tangential_compliance(BALL, BALL)
RADIUS, APPROACH, MU = 1e-3, 1e-6, 0.3
A, P = hertz.contact_radius(APPROACH, RADIUS), hertz.hertz_force(APPROACH, RADIUS, MODULUS)
G = BALL[0] / (2 * (1 + BALL[1]))


def shear_cycle(q, num_points=400):
    """Displacements from zero to that of Q = q μP, to its opposite and back again."""
    top = mindlin.displacement(q * MU * P, P, MU, A, S)
    way = np.linspace(0, 1, num_points)
    return np.concatenate([top * way, top * (1 - 2 * way[1:]), top * (2 * way[1:] - 1)])


def test_shear_starts_stuck_and_ends_sliding():
    small = 1e-6 * MU * P
    stiffness = small / mindlin.displacement(small, P, MU, A, S)
    assert stiffness == pytest.approx(mindlin.stick_stiffness(A, S), rel=1e-5)
    assert mindlin.stick_radius(MU * P, P, MU, A) == 0.0
    # Tangential over normal stiffness of like bodies: 2(1 - ν)/(2 - ν).
    ratio = 2 * (1 - BALL[1]) / (2 - BALL[1])
    assert mindlin.stick_stiffness(A, S) == pytest.approx(ratio * 2 * MODULUS * A, rel=1e-12)


@pytest.mark.parametrize("q", [0.3, 0.8, 0.99])
def test_shear_to_and_fro_closes_its_loop(q):
    """Back at -Q* the displacement is opposite, and the area is the energy of a cycle."""
    top = q * MU * P
    Q = np.linspace(-top, top, 20001)
    back = mindlin.unloading(Q, top, P, MU, A, S)
    assert back[0] == pytest.approx(-back[-1], rel=1e-12)
    assert back[-1] == pytest.approx(mindlin.displacement(top, P, MU, A, S), rel=1e-12)
    # Loading again is the same curve turned about the origin. Trapezoids near the root of
    # (1 - q): their error falls like the step.
    area = np.trapezoid(back + back[::-1], Q)
    assert area == pytest.approx(mindlin.energy_per_cycle(top, P, MU, A, S), rel=1e-4)


def test_energy_of_a_small_cycle_grows_with_the_cube():
    q = 1e-2
    limit = (MU * P) ** 2 * S * q**3 / (36 * A)
    assert mindlin.energy_per_cycle(q * MU * P, P, MU, A, S) == pytest.approx(limit, rel=0.02)


def test_springs_reproduce_the_closed_forms_of_shear():
    shift = shear_cycle(0.8)
    normal, Q, lost = mindlin.history(
        np.full_like(shift, APPROACH), shift, RADIUS, MODULUS, S, MU, 1000
    )
    n = shift.size // 3
    # Springs and steps of a thousandth of the range.
    assert normal[0] == pytest.approx(P, rel=1e-5)
    assert Q[n] == pytest.approx(0.8 * MU * P, rel=1e-4)
    back = slice(n, 2 * n)
    closed = mindlin.unloading(Q[back], Q[n], P, MU, A, S)
    np.testing.assert_allclose(shift[back], closed, atol=1e-4 * shift.max())
    cycle = mindlin.energy_per_cycle(0.8 * MU * P, P, MU, A, S)
    assert lost[-1] - lost[n] == pytest.approx(cycle, rel=1e-3)


def test_shear_and_pressure_that_grow_together():
    """Mindlin and Deresiewicz 1953: no slip while dQ/dP < μ; then dδ follows the stiffness 8a/S."""
    way = np.linspace(0, 1, 2001)
    for slope, slips in ((0.8 * MU, False), (1.3 * MU, True)):
        # dQ/dP = slope where both displacements keep their proportion.
        proportion = slope * 2 * MODULUS * S / 8
        normal, Q, lost = mindlin.history(
            APPROACH * way, proportion * APPROACH * way, RADIUS, MODULUS, S, MU, 1000
        )
        assert Q[-1] == pytest.approx(min(slope, MU) * normal[-1], rel=1e-3)
        assert (lost[-1] > 1e-3 * P * APPROACH) == slips


def test_shear_under_a_falling_normal_force_stays_coulombic():
    """Where the pressure goes, springs slide back; what is left of Q is within μP."""
    approach = APPROACH * np.concatenate([np.ones(50), np.linspace(1, 0, 200)])
    shift = mindlin.displacement(0.9 * MU * P, P, MU, A, S) * np.minimum(np.arange(250) / 49, 1)
    normal, Q, lost = mindlin.history(approach, shift, RADIUS, MODULUS, S, MU, 300)
    assert np.all(np.abs(Q) <= MU * normal * (1 + 1e-12))
    assert np.all(np.diff(lost) >= -1e-12 * lost[-1])
    # All that was put in is gone when the bodies part.
    work = np.sum(0.5 * (Q[1:] + Q[:-1]) * np.diff(shift))
    assert lost[-1] == pytest.approx(work, rel=1e-12)


def test_torsion_starts_stuck_and_ends_sliding():
    beta = torsion.twist(1 - 1e-6, P, MU, A, G)
    stuck = torsion.stick_moment(beta, A, G)
    assert torsion.moment(1 - 1e-6, P, MU, A) == pytest.approx(stuck, rel=1e-4)
    # 2π ∫ μ p r² dr with p = p0 √(1 - r²/a²), midpoint rule.
    r = (np.arange(100000) + 0.5) / 100000 * A
    p = 1.5 * P / (np.pi * A**2) * np.sqrt(1 - (r / A) ** 2)
    sliding = 2 * np.pi * MU * np.sum(p * r**2) * A / 100000
    assert torsion.sliding_moment(P, MU, A) == pytest.approx(sliding, rel=1e-6)
    assert torsion.moment(0.0, P, MU, A) == pytest.approx(sliding, rel=1e-6)
    assert torsion.moment_of_twist(10 * beta / 1e-6, P, MU, A, G) <= sliding * (1 + 1e-6)


def test_torsion_to_rounding_at_both_ends():
    """β = (3μP/4πGa²) (ln(4a/c) - 1) for c → 0; M falls short of sliding like c³ ln(a/c)."""
    unit = 3 * MU * P / (4 * np.pi * G * A**2)
    for c in (1e-9, 1e-12, 1e-100):
        assert torsion.twist(c, P, MU, A, G) == pytest.approx(unit * (np.log(4 / c) - 1), rel=1e-14)
        assert torsion.moment(c, P, MU, A) == pytest.approx(
            torsion.sliding_moment(P, MU, A), rel=1e-11
        )  # by quadrature of a logarithm
    # K - E = (π/4) k² for k → 0, and M is that of bodies that stick.
    beta = torsion.twist(1 - 1e-12, P, MU, A, G)
    assert beta == pytest.approx(unit * np.pi / 4 * 2e-12, rel=1e-4)  # of 1 - 1e-12 itself
    stuck = torsion.stick_moment(beta, A, G)
    assert torsion.moment(1 - 1e-12, P, MU, A) == pytest.approx(stuck, rel=1e-11)


def test_torsion_inverts():
    for ratio in (0.95, 0.7, 0.2):
        beta, M = torsion.twist(ratio, P, MU, A, G), torsion.moment(ratio, P, MU, A)
        assert torsion.moment_of_twist(beta, P, MU, A, G) == pytest.approx(M, rel=1e-9)
        assert torsion.moment_of_twist(-beta, P, MU, A, G) == pytest.approx(-M, rel=1e-9)


def test_traction_of_partly_slipping_torsion():
    """The sum of turned discs is q = μp in the annulus: Abel's integral, done numerically."""
    ratio, r = 0.4, 0.7
    s = r + (1 - r) * (np.arange(40000) + 0.5) ** 2 / 40000**2  # dense where the root is
    edges = r + (1 - r) * np.arange(40001) ** 2 / 40000**2
    turned = torsion.twist(edges, 1.0, 1.0, 1.0, 1.0)  # of all discs larger than s
    q = 4 / np.pi * r * np.sum(-np.diff(turned) / np.sqrt(s**2 - r**2))
    assert q == pytest.approx(1.5 / np.pi * np.sqrt(1 - r**2), rel=1e-3)
    assert torsion.twist(ratio, 1.0, 1.0, 1.0, 1.0) > turned[0]


def test_creep_of_a_rolling_ball():
    nu = 0.25
    # Three figures of Kalker's table, and Johnson's limit for small force.
    assert rolling.kalker_coefficient(nu) == pytest.approx(4.12, abs=5e-3)
    small = 1e-6 * MU * P
    creep = rolling.johnson_creep(small, P, MU, A, G, nu)
    assert small / (G * A**2 * creep) == pytest.approx(16 / (4 - 3 * nu), rel=1e-5)
    force = rolling.creep_force(1e-9, P, MU, A, G, nu)
    assert force == pytest.approx(4.12 * G * A**2 * 1e-9, rel=1e-3)
    assert rolling.creep_force(-1.0, P, MU, A, G, nu) == pytest.approx(-MU * P, rel=1e-12)
    # The same law, but for the coefficient.
    xi = rolling.johnson_creep(0.6 * MU * P, P, MU, A, G, nu) * 16 / (4 - 3 * nu) / 4.12
    assert rolling.creep_force(xi, P, MU, A, G, nu) == pytest.approx(0.6 * MU * P, rel=1e-3)


def test_what_a_closed_cycle_of_strain_leaves():
    """Nothing where the axes of strain stay; else what Jaumann's rate itself adds up to."""
    rng = np.random.default_rng(1)
    A, B = rng.normal(size=(2, 3, 3))
    A, B = (0.5 * (M + M.T) for M in (A, B))
    t = np.linspace(0, 1, 2001)[:, None, None]
    straight = np.sin(np.pi * t) * A
    assert np.abs(hypoelastic.residual_strain(straight)).max() < 1e-14

    a = 1e-2
    e = a * ((1 - np.cos(2 * np.pi * t)) * A + np.sin(2 * np.pi * t) * B)
    values, vectors = np.linalg.eigh(e)
    U = (vectors * np.exp(values)[:, None]) @ vectors.transpose(0, 2, 1)
    stress = np.zeros((3, 3))
    for U0, U1 in itertools.pairwise(U):
        L = 2 * (U1 - U0) @ np.linalg.inv(U0 + U1)
        D, W = 0.5 * (L + L.T), 0.5 * (L - L.T)
        R = np.linalg.solve(np.eye(3) - 0.5 * W, np.eye(3) + 0.5 * W)
        stress = R @ (stress + 0.5 * D) @ R.T + 0.5 * D
    left = hypoelastic.residual_strain(e)
    # The series neglects a² of it, times norms of A and B; steps 1/2000² times some tens.
    assert np.abs(stress - left).max() < 20 * a**2 * np.abs(left).max()
    length = np.linalg.norm(np.diff(e, axis=0), axis=(1, 2)).sum()
    bound = hypoelastic.residual_strain_bound(np.linalg.norm(e, axis=(1, 2)).max(), length)
    assert 0.01 * bound < np.linalg.norm(left) < bound
