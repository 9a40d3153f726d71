"""Stress in squeezed discs and spheres: equilibrium, compatibility, tractions, limits."""

import itertools

import numpy as np
import pytest

from mufe_fenicsx.theory import finite_sphere, splitting

NU, WIDTH = 0.2, 0.2


def disc(x, nu):
    """Stress tensors at places (n, 3), plane strain, the load along y."""
    sx, sy, t = splitting.disc_stress(x[:, 0], x[:, 1], WIDTH)
    zero = np.zeros_like(t)
    return np.array([[sx, t, zero], [t, sy, zero], [zero, zero, nu * (sx + sy)]]).transpose(2, 0, 1)


def sphere(x, nu, kind="hertz"):
    """The same in a sphere, the load along z."""
    r = np.linalg.norm(x, axis=1)
    theta, phi = np.arccos(x[:, 2] / r), np.arctan2(x[:, 1], x[:, 0])
    sr, st, sp, t = splitting.sphere_stress(r, theta, WIDTH, nu, kind)
    zero = np.zeros_like(t)
    own = np.array([[sr, t, zero], [t, st, zero], [zero, zero, sp]]).transpose(2, 0, 1)
    axes = np.array(
        [
            [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)],
            [np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), -np.sin(theta)],
            [-np.sin(phi), np.cos(phi), zero],
        ]
    ).transpose(2, 0, 1)
    return axes.transpose(0, 2, 1) @ own @ axes


@pytest.mark.parametrize(
    "field",
    [disc, sphere, lambda x, nu: sphere(x, nu, "uniform")],
    ids=["disc", "sphere", "sphere, uniform"],
)
def test_stress_is_in_balance_and_compatible(field):
    """div σ = 0 and (1+ν) ∇²σ + ∇∇ tr σ = 0 (Beltrami and Michell), by central differences."""
    h = 1e-3
    steps = h * np.array(list(itertools.product((-1, 0, 1), repeat=3)))
    for place in ([0.31, 0.22, 0.4], [-0.1, 0.5, -0.3]):
        s = field(np.array(place) + steps, NU).reshape(3, 3, 3, 3, 3)
        first = np.array([(s[2, 1, 1] - s[0, 1, 1]), (s[1, 2, 1] - s[1, 0, 1]),
                          (s[1, 1, 2] - s[1, 1, 0])]) / (2 * h)  # fmt: skip
        second = np.empty((3, 3, 3, 3))
        for i, j in itertools.product(range(3), repeat=2):
            e = np.eye(3, dtype=int)
            if i == j:
                ends = (s[tuple(1 + e[i])], s[tuple(1 - e[i])])
                second[i, i] = (ends[0] + ends[1] - 2 * s[1, 1, 1]) / h**2
            else:
                signs = itertools.product((1, -1), repeat=2)
                second[i, j] = sum(p * q * s[tuple(1 + p * e[i] + q * e[j])] for p, q in signs) / (
                    4 * h**2
                )
        # Differences of second order, h² times two more derivatives: some 1e-5 of the terms.
        assert np.abs(np.einsum("iij->j", first)).max() < 1e-4 * np.abs(first).max()
        laplacian = np.einsum("kkij->ij", second)
        trace = np.einsum("ijkk->ij", second)
        assert np.abs((1 + NU) * laplacian + trace).max() < 1e-4 * np.abs(second).max()


def test_disc_carries_the_load_and_its_edge_is_free():
    angle = np.linspace(0.0, np.pi / 2 - 1.2 * np.arcsin(WIDTH), 7)
    c, s = np.cos(angle), np.sin(angle)
    sx, sy, t = splitting.disc_stress(c, s, WIDTH)
    np.testing.assert_allclose([c * sx + s * t, c * t + s * sy], 0, atol=1e-13)
    # Over the cut normal to the load -P, along it nothing: units P/πRt. Gauss, smooth integrands.
    x, weight = np.polynomial.legendre.leggauss(60)
    assert weight @ splitting.disc_stress(x, 0.0, WIDTH)[1] == pytest.approx(-np.pi, rel=1e-12)
    y, weight = np.polynomial.legendre.leggauss(400)
    # Endpoints at the contact: the pressure there is as rough as a root at one chord.
    assert weight @ splitting.disc_stress(0.0, y, WIDTH)[0] == pytest.approx(0.0, abs=1e-3)


def test_hondros_is_a_sum_of_radial_forces():
    """Opposite radial forces at φ are a disc under point forces, turned by φ."""
    alpha, y = np.arcsin(WIDTH), np.array([0.0, 0.4, 0.7])
    angle, weight = np.polynomial.legendre.leggauss(80)
    total = np.zeros((2, 3))
    for phi, w in zip(alpha * angle, weight, strict=True):
        sx, sy, t = splitting.chord_stress(-y * np.sin(phi), y * np.cos(phi), 0.0)
        c, s = np.cos(phi), np.sin(phi)
        total += w * np.array(
            [c * c * sx + s * s * sy + 2 * s * c * t, s * s * sx + c * c * sy - 2 * s * c * t]
        )
    # 2α R dφ-forces whose sum along y is P: each pR, p = P/(2R sin α).
    expected = total * alpha / (2 * np.sin(alpha))
    np.testing.assert_allclose(splitting.arc_stress(y, WIDTH), expected, rtol=1e-12)


def test_middle_of_the_disc_splits():
    """2P/πDt across and three times that along, as the spots get small."""
    for stress in (splitting.disc_stress(0, 0, 1e-3)[:2], splitting.arc_stress(0, 1e-3)):
        np.testing.assert_allclose(stress, [1, -3], rtol=1e-5)


def test_approach_of_a_disc():
    """The strain along the axis, summed from the contact to the middle, in plane strain."""
    E, a = 1.0, 0.02
    force = np.pi * E * a**2 / 4
    assert splitting.line_contact(force, 1.0, E)[0] == pytest.approx(a, rel=1e-14)
    x, weight = np.polynomial.legendre.leggauss(400)
    y = 0.5 * (x + 1)
    across, along, _ = splitting.disc_stress(0.0, y, a) * force / np.pi
    # (1 - ν²) σy - ν(1 + ν) σx over E; E* = E/(1 - ν²).
    strain = along - NU / (1 - NU) * across
    # The 200 forces that stand for the pressure dent the surface between them: 0.014 of P'/πE*.
    approach = splitting.disc_approach(force, 1.0, E)
    assert -0.5 * weight @ strain == pytest.approx(approach, rel=2e-3)


@pytest.mark.parametrize("kind", splitting.KINDS)
def test_traction_of_the_sphere_is_the_load(kind):
    theta = np.array([0.3, 0.8, 1.3]) * np.arcsin(WIDTH)
    theta = np.append(theta, [0.8, 1.5])
    sr, _, _, t = splitting.sphere_stress(1.0, theta, WIDTH, NU, kind, resolution=1000.0)
    rho = np.sin(theta)
    on = rho < WIDTH
    if kind == "hertz":
        p = np.sqrt(np.maximum(1 - rho**2 / WIDTH**2, 0)) * on
        # Per area of the sphere: its force is 2π ∫ p sin θ dθ = π a² ∫ √(1-w)/√(1-a² w) dw.
        w = (np.arange(20000) + 0.5) / 20000
        p *= 4 / (np.pi * WIDTH**2 * np.mean(np.sqrt((1 - w) / (1 - WIDTH**2 * w))))
        expected = -p * np.cos(theta), p * rho
    else:
        expected = -4 / (np.pi * WIDTH**2) * on, 0.0 * theta
    # The series breaks off: its jump at the edge leaves waves of 1/(orders per spot).
    scale = 4 / (np.pi * WIDTH**2)
    np.testing.assert_allclose(sr, expected[0], atol=(0.01 if kind == "uniform" else 1e-3) * scale)
    np.testing.assert_allclose(t, expected[1], atol=1e-3 * scale)


def test_sphere_carries_the_load():
    """-F over the plane of the equator: 2π ∫ σθ r dr, in units of F/4R²."""
    x, weight = np.polynomial.legendre.leggauss(300)
    r = 0.5 * (x + 1)
    hoop = splitting.sphere_stress(r, np.pi / 2, WIDTH, NU)[1]
    # The orders left out, whose traction at the caps is 1e-3 of the pressure.
    assert np.pi * weight @ (hoop * r) == pytest.approx(-4, rel=1e-4)


def sphere_middle(nu):
    """Stresses across and along the axis in the middle of a sphere under two point forces.

        σx = (F/2πR²) [5/2 (7+2ν)/(7+5ν) - 1],  σz = -(F/2πR²) [5 (7+2ν)/(7+5ν) + 1]

    These are the orders 0 and 2 of ``splitting.sphere_stress``, which alone reach the middle.

    Returns:
        σx, σz in units of F/d².
    """
    two = 5 * (7 + 2 * nu) / (7 + 5 * nu)
    return 2 / np.pi * (0.5 * two - 1), -2 / np.pi * (two + 1)


@pytest.mark.parametrize("nu, tension", [(0.0, 3 / np.pi), (0.25, 0.810), (0.5, 0.704)])
def test_middle_of_the_sphere_splits(nu, tension):
    """Of point loads; 0.7 to 0.95 F/d² in Hiramatsu & Oka's range. Caps differ by (a/R)²."""
    across, along = sphere_middle(nu)
    assert across == pytest.approx(tension, rel=1e-3)
    for kind in splitting.KINDS:
        stress = splitting.sphere_stress(0.0, 0.3, 1e-2, nu, kind, resolution=2.0)
        turned = np.cos(0.3) ** 2 * along + np.sin(0.3) ** 2 * across
        assert stress[0] == pytest.approx(turned, rel=3e-4)
        assert stress[2] == pytest.approx(across, rel=3e-4)


def test_load_of_the_caps_matters_only_near_them():
    """St Venant: Hertz's pressure along the axis against an even one along the radii."""
    r, a = np.array([0.0, 0.5, 0.7, 0.9]), 0.05
    across = [splitting.sphere_stress(r, 0.0, a, NU, kind)[1] for kind in splitting.KINDS]
    even = np.abs(across[1] / across[0] - 1)
    assert np.all(even < [1e-3, 3e-3, 0.015, 0.25])
    assert even[3] > 0.1


def test_stresses_belong_to_the_displacements_of_the_finite_sphere():
    """Orders with one constant alone: σθ + σφ at the pole from u_r and u_θ of theory.finite_sphere.

    At θ = 0: ε_θ = ε_φ = u_r/r - n(n+1)/2 u_θ'; with the traction σr: E ε_θ = (1-ν) σ_θ - ν σr.
    """
    a = 0.3
    orders = np.arange(0, 40, 2)
    radial, shear = splitting._load(orders, a, "hertz")
    rs, rt, ts, tt = finite_sphere.surface_compliance(orders, NU)
    ur, ut = rs * radial + rt * shear, ts * radial + tt * shear
    strain = np.sum(ur - 0.5 * orders * (orders + 1) * ut)  # over 2G
    sr, hoop, *_ = splitting.sphere_stress(1.0, 0.0, a, NU, resolution=38.5 * a) / 4
    assert (1 + NU) * strain == pytest.approx((1 - NU) * hoop - NU * sr, rel=1e-10)
