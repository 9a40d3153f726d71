"""An elastic sphere pressed between two smooth rigid planes, by series of Legendre polynomials.

Hertz takes the sphere for a half-space near the contact. Here the whole sphere is
solved by linear elasticity, with the exact profile 1 - cos θ and the true opposite
contact; what remains outside is large strain. Lengths are in radii, stresses in 2G.

Displacements and stresses of order n (A. I. Lurie, Three-Dimensional Problems of the
Theory of Elasticity, 1964, chapter 8), with Pₙ = Pₙ(cos θ) and ' = d/dθ:

    u_r  = [A (n+1)(n-2+4ν) rⁿ⁺¹ + B n rⁿ⁻¹] Pₙ
    u_θ  = [A (n+5-4ν) rⁿ⁺¹ + B rⁿ⁻¹] Pₙ'
    σ_r  = 2G [A (n+1)(n²-n-2-2ν) rⁿ + B n(n-1) rⁿ⁻²] Pₙ
    τ_rθ = 2G [A (n²+2n-1+2ν) rⁿ + B (n-1) rⁿ⁻²] Pₙ'
"""

from functools import lru_cache

import numpy as np


def surface_compliance(n, nu):
    """Displacements at r = 1 of unit tractions of order n >= 1, in units of R/2G.

    Args:
        n: Orders, shape (num_orders,); n = 1 would be a rigid motion, so n = 0 or n >= 2.
        nu: Poisson's ratio [-].

    Returns:
        (u_r of σ_r, u_r of τ, u_θ of σ_r, u_θ of τ), each of shape (num_orders,).
    """
    n = np.asarray(n, dtype=float)
    rA, rB = (n + 1) * (n - 2 + 4 * nu), n
    tA, tB = n + 5 - 4 * nu, np.ones_like(n)
    sA, sB = (n + 1) * (n**2 - n - 2 - 2 * nu), n * (n - 1)
    qA, qB = n**2 + 2 * n - 1 + 2 * nu, n - 1
    det = sA * qB - sB * qA
    ur_s, ur_t = (rA * qB - rB * qA) / det, (rB * sA - rA * sB) / det
    ut_s, ut_t = (tA * qB - tB * qA) / det, (tB * sA - tA * sB) / det
    zero = n == 0  # no tangential part: B is nothing and Pₙ' = 0
    return ur_s, np.where(zero, 0, ur_t), np.where(zero, 0, ut_s), np.where(zero, 0, ut_t)


def contact_places(num_terms):
    """Radii over that of the contact at which the surfaces shall meet."""
    return np.sin(0.5 * np.pi * (np.arange(3 * num_terms) + 0.5) / (3 * num_terms))


def cap_points(a):
    """Gauss points of the cap of the contact: t = sin θ / a, cos θ, sin θ, weights of sin θ dθ."""
    s, weight = np.polynomial.legendre.leggauss(200)
    s, weight = 0.25 * np.pi * (s + 1), 0.25 * np.pi * weight
    t = np.sin(s)  # tames the root at the edge
    rho = a * t
    cos = np.sqrt(1 - rho**2)
    return t, cos, rho, weight * a * np.cos(s) * rho / cos


@lru_cache(maxsize=64)
def axial_response(a, nu, num_terms, resolution):
    """What the terms of the pressure, in units of 2G, do to the unit sphere.

    Args:
        a: Contact radius over R [-].
        nu: Poisson's ratio [-].
        num_terms: Terms (1 - t²)^(k+½), t = ρ/a, of the pressure.
        resolution: Highest order of the series times a.

    Returns:
        uz: Axial displacements at `contact_places`, shape (3 num_terms, num_terms).
        force: Of each term, shape (num_terms,).
    """
    t, cos, rho, area = cap_points(a)
    at = a * contact_places(num_terms)
    cos_at = np.sqrt(1 - at**2)
    powers = np.array([(1 - t**2) ** (k + 0.5) for k in range(num_terms)])

    uz = np.zeros((at.size, num_terms))
    both = zip(legendre(cos, rho, a, resolution), legendre(cos_at, at, a, resolution), strict=True)
    for n, ((P, dP), (Q, dQ)) in enumerate(both):
        if n % 2:  # the two poles are loaded alike
            continue
        # Traction -p e_z has σ_r = -p cos θ and τ = p sin θ; twice for both poles.
        sigma = -(2 * n + 1) * (powers * (area * cos * P)).sum(axis=1)
        tau = (2 * n + 1) / max(n * (n + 1), 1) * (powers * (area * rho * dP)).sum(axis=1)
        rs, rt, ts, tt = surface_compliance(np.array([n]), nu)
        uz += np.outer(Q * cos_at, rs * sigma + rt * tau)
        uz -= np.outer(dQ * at, ts * sigma + tt * tau)
    return uz, 2 * np.pi * (powers * area).sum(axis=1)


@lru_cache(maxsize=16)
def compression(a, nu, num_terms=3, resolution=80.0):
    """Approach and force where the contact has the radius ``a``.

    The pressure is a sum of ``num_terms`` powers (1 - t²)^(k+½), t = ρ/a; their factors
    make the surface flat at points inside the contact, by least squares.

    Args:
        a: Contact radius over R, the reference position of its edge [-].
        nu: Poisson's ratio [-].
        num_terms: Terms of the pressure.
        resolution: Highest order of the series times a.

    Returns:
        delta: Approach of a plane to the centre, over R.
        force: Over E* R², E* = E/(1 - ν²).
        p0: Pressure at the centre over E*.
    """
    at = a * contact_places(num_terms)
    uz, total = axial_response(a, nu, num_terms, resolution)

    delta, pressure = flat_contact(uz, at, nu)
    return delta, float(pressure @ total), float(pressure.sum())


def flat_contact(uz, at, nu):
    """The pressure that makes the surface flat in the contact, u_z(θ) + δ = 1 - cos θ.

    Args:
        uz: Axial displacements under its terms, in units of 2G, shape (num_places, num_terms).
        at: sin θ of the places.
        nu: Poisson's ratio [-].

    Returns:
        δ over R, and the factors of the terms over E*, shape (num_terms,).
    """
    matrix = np.column_stack([uz, np.ones(at.size)])
    unknowns = np.linalg.lstsq(matrix, 1 - np.sqrt(1 - at**2), rcond=None)[0]
    shear_over_modulus = 0.5 * (1 - nu)  # G / E*
    return float(unknowns[-1]), 2 * shear_over_modulus * unknowns[:-1]


def legendre(x, sine, a, resolution):
    """Yield Pₙ(x) and dPₙ/dθ for n = 0, 1, … up to resolution / a."""
    before, now = np.zeros_like(x), np.ones_like(x)
    for n in range(int(resolution / a) + 1):
        # dP/dθ = -sin θ dP/dx = n (x Pₙ - Pₙ₋₁) / sin θ
        yield now, n * (x * now - before) / sine
        before, now = now, ((2 * n + 1) * x * now - n * before) / (n + 1)
