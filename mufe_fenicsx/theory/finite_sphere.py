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
    # Gauss points in t; ρ = sin θ = a t. The substitution t = sin s tames the root.
    s, weight = np.polynomial.legendre.leggauss(200)
    s, weight = 0.25 * np.pi * (s + 1), 0.25 * np.pi * weight
    t, dt = np.sin(s), np.cos(s)
    rho = a * t
    cos = np.sqrt(1 - rho**2)
    area = weight * a * dt * rho / cos  # sin θ dθ
    powers = np.array([(1 - t**2) ** (k + 0.5) for k in range(num_terms)])

    at = a * np.sin(0.5 * np.pi * (np.arange(3 * num_terms) + 0.5) / (3 * num_terms))
    cos_at = np.sqrt(1 - at**2)

    uz = np.zeros((at.size, num_terms))
    both = zip(legendre(cos, rho, a, resolution), legendre(cos_at, at, a, resolution), strict=True)
    for n, ((P, dP), (Q, dQ)) in enumerate(both):
        if n % 2:  # the two poles are loaded alike
            continue
        # Traction -p e_z has σ_r = -p cos θ and τ = p sin θ; twice for both poles.
        sigma = -(2 * n + 1) * (powers * (area * cos * P)).sum(axis=1)
        tau = (2 * n + 1) / max(n * (n + 1), 1) * (powers * (area * rho * dP)).sum(axis=1)
        rs, rt, ts, tt = surface_compliance(np.array([n]), nu)
        ur, ut = rs * sigma + rt * tau, ts * sigma + tt * tau
        uz += np.outer(Q * cos_at, ur) - np.outer(dQ * at, ut)

    # Flat: u_z(θ) + δ = 1 - cos θ.
    matrix = np.column_stack([uz, np.ones(at.size)])
    unknowns = np.linalg.lstsq(matrix, 1 - cos_at, rcond=None)[0]
    factors, delta = unknowns[:-1], unknowns[-1]
    shear_over_modulus = 0.5 * (1 - nu)  # G / E*
    pressure = factors * 2 * shear_over_modulus  # in E*
    force = 2 * np.pi * (pressure @ (powers * area).sum(axis=1))
    return float(delta), float(force), float(pressure.sum())


def force_of_approach(delta, nu):
    """Force over E* R² and contact radius and p0/E* at the approach ``delta`` (over R).

    Secant iteration on :func:`compression` from Hertz's a = √δ.
    """
    a = np.sqrt(delta)
    for _ in range(20):
        reached = compression(float(a), nu)[0]
        a_next = a * np.sqrt(delta / reached)
        if abs(a_next / a - 1) < 1e-6:
            break
        a = a_next
    _, force, p0 = compression(float(a), nu)
    return force, float(a), p0


def legendre(x, sine, a, resolution):
    """Yield Pₙ(x) and dPₙ/dθ for n = 0, 1, … up to resolution / a."""
    before, now = np.zeros_like(x), np.ones_like(x)
    for n in range(int(resolution / a) + 1):
        # dP/dθ = -sin θ dP/dx = n (x Pₙ - Pₙ₋₁) / sin θ
        yield now, n * (x * now - before) / sine
        before, now = now, ((2 * n + 1) * x * now - n * before) / (n + 1)
