"""Elliptic contacts and whole spheres against what defines them."""

import numpy as np
import pytest

from mufe_fenicsx.theory import finite_sphere, hertz, two_spheres


def half_space_displacement(x, y, a, b, p0, E):
    """Of the pressure p0 √(1 - x²/a² - y²/b²): 1/(πE*) ∫∫ p dr dφ about (x, y)."""
    phi = 2 * np.pi * (np.arange(400) + 0.5) / 400
    cos, sin = np.cos(phi), np.sin(phi)
    # 1 - (x + r cos)²/a² - (y + r sin)²/b² = α - 2βr - γr² vanishes at the edge.
    alpha = 1 - (x / a) ** 2 - (y / b) ** 2
    beta = -(x * cos / a**2 + y * sin / b**2)
    gamma = (cos / a) ** 2 + (sin / b) ** 2
    edge = (beta + np.sqrt(beta**2 + alpha * gamma)) / gamma
    t = (np.arange(2000) + 0.5) / 2000
    r = edge[:, None] * (1 - (1 - t) ** 2)  # tames the root at the edge
    dr = edge[:, None] * 2 * (1 - t) / 2000
    p = p0 * np.sqrt(np.maximum(alpha + 2 * beta[:, None] * r - gamma[:, None] * r**2, 0.0))
    return (p * dr).sum() * 2 * np.pi / 400 / (np.pi * E)


@pytest.mark.parametrize("A, B", [(0.5, 0.5), (0.25, 0.75), (0.1, 1.0)])
def test_pressure_on_an_ellipse_closes_the_gap(A, B):
    """u(x, y) = δ - A x² - B y² within the contact: Boussinesq's integral of the pressure."""
    delta, E = 1e-3, 2.0
    force, a, b, p0 = hertz.elliptic_contact(delta, A, B, E)
    assert force == pytest.approx(2 / 3 * np.pi * a * b * p0, rel=1e-14)
    for x, y in ((0, 0), (0.5 * a, 0), (0, 0.6 * b), (0.4 * a, -0.5 * b)):
        u = half_space_displacement(x, y, a, b, p0, E)
        # The midpoint rule over 2000 radii and 400 directions.
        assert u == pytest.approx(delta - A * x**2 - B * y**2, rel=1e-5)


def test_circular_contact_is_that_of_spheres():
    delta, R, E = 1e-3, 2.0, 3.0
    force, a, b, p0 = hertz.elliptic_contact(delta, 0.5 / R, 0.5 / R, E)
    assert a == b == pytest.approx(hertz.contact_radius(delta, R), rel=1e-14)
    assert force == pytest.approx(hertz.hertz_force(delta, R, E), rel=1e-14)
    nearly = hertz.elliptic_contact(delta, 0.4999999 / R, 0.5000001 / R, E)
    assert nearly == pytest.approx((force, a, b, p0), rel=1e-6)


@pytest.mark.parametrize("angle, A, B", [(0.0, 0.0, 0.75), (np.pi / 2, 0.25, 0.5)])
def test_gap_of_cylinders(angle, A, B):
    """Parallel: a line contact of 1/R = Σ1/Rᵢ; crossed at right angles: each its own."""
    assert hertz.crossed_cylinders(1.0, 2.0, angle) == pytest.approx((A, B), abs=1e-15)


def test_one_sphere_on_a_plane():
    a, nu, E = 0.05, 0.3, 7.0
    delta, force, p0 = finite_sphere.compression(a, nu)
    modulus = E / (1 - nu**2)
    # The same equations; only the order of sums and products differs.
    assert two_spheres.compression(2 * a, ((2.0, E, nu),)) == pytest.approx(
        (2 * delta, 4 * force * modulus, p0 * modulus), rel=1e-9
    )


def test_two_like_spheres_mirror_each_other():
    a, nu, E = 0.05, 0.15, 7.0
    one = two_spheres.compression(a, ((1.0, E, nu),))
    two = two_spheres.compression(a, ((1.0, E, nu), (1.0, E, nu)))
    assert two == pytest.approx((2 * one[0], one[1], one[2]), rel=1e-9)


@pytest.mark.parametrize("spheres", [((1.5, 1.0, 0.15), (3.0, 1.0, 0.3)), ((2.0, 1, 0), (2, 9, 0))])
def test_unlike_spheres_tend_to_hertz(spheres):
    """The finite size is an effect of the order a/R ln(R/a)."""
    modulus = hertz.effective_modulus(*(s[1:] for s in spheres))
    R = 1 / sum(1 / s[0] for s in spheres)
    for a in (0.1, 0.03):
        delta, force, p0 = two_spheres.compression(a, spheres)
        small = a / R * np.log(R / a)
        assert force == pytest.approx(hertz.hertz_force(delta, R, modulus), rel=0.1 * small)
        assert p0 == pytest.approx(3 * force / (2 * np.pi * a**2), rel=0.1 * small)
