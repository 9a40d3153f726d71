"""Two elastic spheres pressed on each other, each whole: Hertz's contact of finite bodies.

Each sphere carries the same pressure at its opposite pole, as between two smooth rigid planes,
or is cut at its equator and rests there on a smooth plane: by symmetry the same. Its surface
responds as in :mod:`.finite_sphere`; where the spheres touch

    Σ u_z + δ = Σ Rᵢ (1 - cos θᵢ)

in linear elasticity, for the positions on the unstrained surface. What remains outside is
large strain and the difference of radial displacements of unlike spheres, both of order a/R
in the strain, not in the force's leading order.
"""

from functools import lru_cache

import numpy as np

from .finite_sphere import legendre, surface_compliance


def compression(a, spheres, num_terms=3, resolution=80.0):
    """Approach, force and central pressure where the contact has the radius ``a``.

    Args:
        a: Radius of the contact [m].
        spheres: Tuples (radius [m], E [Pa], ν) of elastic spheres; what is not named is a
            rigid plane.
        num_terms: Terms (1 - ρ²/a²)^(k+½) of the pressure.
        resolution: Highest order of the series of the sphere of radius R, times a/R.

    Returns:
        delta: Approach of the equators [m].
        force: [N].
        p0: Pressure at the centre [Pa].
    """
    at = a * _places(num_terms)
    sag, uz = np.zeros(at.size), np.zeros((at.size, num_terms))
    for radius, E, nu in spheres:
        response, force = _response(a / radius, nu, num_terms, resolution)
        uz += response * radius * (1 + nu) / E  # 2G = E/(1 + ν)
        sag += radius * (1 - np.sqrt(1 - (at / radius) ** 2))
        total = force * radius**2
    # Columns of like size: the pressure in units of E*.
    unit = 1 / sum((1 - nu**2) / E for _, E, nu in spheres)
    matrix = np.column_stack([unit * uz / a, np.ones(at.size)])
    *factors, delta = np.linalg.lstsq(matrix, sag / a, rcond=None)[0]
    factors = unit * np.array(factors)
    return float(delta * a), float(factors @ total), float(factors.sum())


def _places(num_terms):
    """Radii over that of the contact at which the surfaces shall meet."""
    return np.sin(0.5 * np.pi * (np.arange(3 * num_terms) + 0.5) / (3 * num_terms))


@lru_cache(maxsize=64)
def _response(a, nu, num_terms, resolution):
    """Axial displacements of the unit sphere under the terms of the pressure.

    Pressures in units of 2G; also the forces of the terms.
    """
    # Gauss points in t = ρ/a; the substitution t = sin s tames the root.
    s, weight = np.polynomial.legendre.leggauss(200)
    s, weight = 0.25 * np.pi * (s + 1), 0.25 * np.pi * weight
    t, dt = np.sin(s), np.cos(s)
    rho, at = a * t, a * _places(num_terms)
    cos, cos_at = np.sqrt(1 - rho**2), np.sqrt(1 - at**2)
    area = weight * a * dt * rho / cos  # sin θ dθ
    powers = np.array([(1 - t**2) ** (k + 0.5) for k in range(num_terms)])

    uz = np.zeros((at.size, num_terms))
    both = zip(legendre(cos, rho, a, resolution), legendre(cos_at, at, a, resolution), strict=True)
    for n, ((P, dP), (Q, dQ)) in enumerate(both):
        if n % 2:  # the two poles are loaded alike
            continue
        sigma = -(2 * n + 1) * (powers * (area * cos * P)).sum(axis=1)
        tau = (2 * n + 1) / max(n * (n + 1), 1) * (powers * (area * rho * dP)).sum(axis=1)
        rs, rt, ts, tt = surface_compliance(np.array([n]), nu)
        uz += np.outer(Q * cos_at, rs * sigma + rt * tau)
        uz -= np.outer(dQ * at, ts * sigma + tt * tau)
    return uz, 2 * np.pi * (powers * area).sum(axis=1)
