"""Impact of a whole ball: what half-spaces leave out, by statics.

The ball is no half-space: all of it is strained, and its own inertia balances the force at
the contact. Here it is solved by linear elasticity, with one contact where
:mod:`~mufe_fenicsx.theory.finite_sphere` has two, in the frame of its centre of mass, which
the displacements are measured from. Two like balls that meet do the same, each against
the plane between them. What remains outside is vibration
(:mod:`~mufe_fenicsx.theory.sphere_modes`) and large strain.

Lengths are in radii, stresses in 2G unless stated; series of spherical functions of order n.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .finite_sphere import cap_points, contact_places, flat_contact, legendre, surface_compliance
from .impact import Impact, loading
from .oblique_impact import ContactLaw


@lru_cache(maxsize=64)
def compression(a, nu, num_terms=3, resolution=80.0):
    """Approach and force of one smooth contact of radius ``a`` of a ball held by its inertia.

    The force F needs the body force b = F/V, carried by the pressure -b z; what is
    left of the tractions is in equilibrium. Arguments as for
    :func:`~mufe_fenicsx.theory.finite_sphere.compression`.

    Returns:
        delta: Approach of the plane to the centre of mass, over R.
        force: Over E* R², E* = E/(1 - ν²).
    """
    t, cos, rho, area = cap_points(a)
    powers = np.array([(1 - t**2) ** (k + 0.5) for k in range(num_terms)])
    total = 2 * np.pi * (powers * area).sum(axis=1)  # force of each power
    at = a * contact_places(num_terms)
    cos_at = np.sqrt(1 - at**2)

    uz = np.zeros((at.size, num_terms))
    both = zip(legendre(cos, rho, a, resolution), legendre(cos_at, at, a, resolution), strict=True)
    for n, ((P, dP), (Q, dQ)) in enumerate(both):
        # Traction -p e_z has σ_r = -p cos θ and τ = p sin θ.
        sigma = -(n + 0.5) * (powers * (area * cos * P)).sum(axis=1)
        tau = (n + 0.5) / max(n * (n + 1), 1) * (powers * (area * rho * dP)).sum(axis=1)
        ur, ut = _displacements(n, sigma, tau, total, nu)
        uz += np.outer(Q * cos_at, ur) - np.outer(dQ * at, ut)

    delta, pressure = flat_contact(uz, at, nu)
    return delta, float(pressure @ total)


@lru_cache(maxsize=64)
def tangential_compliance(a, nu, resolution=80.0):
    """Displacement over force along the surface of a contact of radius ``a``, times 2G R.

    Under the traction q ~ √(1 - t²), t = ρ/a, along x, in the mean over that traction; against
    the rigid motion with the ball's momentum and angular momentum. The series has
    Yₙ = Pₙ¹(cos θ) cos φ: tractions σ Y, τ grad Y as for the pressure, and those about the
    radius, g r × grad Y, whose displacement is g/(G (n - 1)); of order 1 they are the
    moment of the force, which the body force r × α carries with u ~ r³.

    Returns:
        The compliance, and that of the half-space, 2π (2 - ν) 1.6 a/16 / (2π a²/3)
        (K. L. Johnson, Contact Mechanics, 1985, eq. (3.91a), averaged).
    """
    t, cos, rho, area = cap_points(a)
    q = np.sqrt(1 - t**2) * area
    force = 2 * np.pi * q.sum()
    work, before, P = 0.0, np.zeros_like(rho), rho.copy()  # P₀¹ and P₁¹ = sin θ
    for n in range(1, int(resolution / a) + 1):
        dP = (n * cos * P - (n + 1) * before) / rho
        square, L = 2 * np.pi * n * (n + 1) / (2 * n + 1), n * (n + 1)  # ∫ Y² dΩ
        sigma = np.pi / square * (q * rho * P).sum()
        tau = np.pi / (L * square) * (q * (cos * dP + P / rho)).sum()
        g = -np.pi / (L * square) * (q * (cos * P / rho + dP)).sum()
        ur, ut = _displacements(n, sigma, tau, -force, nu)
        # r³ on the surface, less the rotation of its angular momentum: 1 - 5/7.
        about = 2 / (n - 1) * g if n > 1 else 2 / 7 * g
        work += square * (sigma * ur + L * (tau * ut + g * about))
        before, P = P, ((2 * n + 1) * cos * P - (n + 1) * before) / n
    return float(work / force**2), 0.3 * (2 - nu) / a


def _displacements(n, sigma, tau, force, nu):
    """Surface displacements u_r and u_θ, by the factors of Y and grad Y, of tractions σ and τ.

    Order 1 has the resultant -``force`` along its axis z, balanced by the body force b e_z with the
    stress -b z and u = c (z r - r²/2 e_z), c = -b (1 - 2ν)/(1 + ν), on the surface
    u_r = c/2, u_θ = -c/2. The tractions left are σ = -2 τ, those of A r² alone.
    """
    if n != 1:
        rs, rt, ts, tt = surface_compliance(n, nu)
        return rs * sigma + rt * tau, ts * sigma + tt * tau
    b = force / (4 / 3 * np.pi)
    A, c = tau / (2 * (1 + nu)), -b * (1 - 2 * nu) / (1 + nu)
    ur, ut = A * 2 * (4 * nu - 1) + 0.5 * c, A * (6 - 4 * nu) - 0.5 * c
    # u_z = r² (u_r cos² θ + u_θ sin² θ): its mean over the ball is the motion of its centre.
    mean = (ur + 2 * ut) / 5
    return ur - mean, ut - mean


@dataclass(frozen=True)
class Series:
    """1 + a (c₀ + c₁ ln a + c₂ a), which small contacts of a ball follow."""

    factors: tuple

    @classmethod
    def fit(cls, values, radii):
        """By least squares to values at radii a, relative to a."""
        radii = np.asarray(radii)
        matrix = np.column_stack([np.ones_like(radii), np.log(radii), radii])
        target = (np.asarray(values) - 1) / radii
        return cls(tuple(np.linalg.lstsq(matrix, target, rcond=None)[0]))

    def __call__(self, a):
        """Its value at the radius a over R."""
        c0, c1, c2 = self.factors
        return 1 + a * (c0 + c1 * np.log(np.maximum(a, 1e-300)) + c2 * a)


@lru_cache(maxsize=16)
def against_half_space(nu):
    """Three :class:`Series` of a/R, fitted to a/R of 0.01 to 0.1, within 3e-4.

    They are the approach over a²/R, the force over 4/3 E* a³/R, and the compliance along the
    surface over that of the half-space.
    """
    radii = [0.01, 0.02, 0.04, 0.07, 0.1]
    approach, force, along = [], [], []
    for a in radii:
        delta, F = compression(a, nu)
        ball, half_space = tangential_compliance(a, nu)
        approach.append(delta / a**2)
        force.append(F / (4 / 3 * a**3))
        along.append(ball / half_space)
    return tuple(Series.fit(values, radii) for values in (approach, force, along))


def ball_law(nu, a):
    """:class:`~mufe_fenicsx.theory.oblique_impact.ContactLaw` of a ball, largest radius a/R."""
    return ContactLaw(*(lambda r, s=series: s(a * r) for series in against_half_space(nu)))


def ball_impact(m, R, E, nu, v):
    """Largest approach, largest force and time of contact of a ball with a smooth plane.

        m δ'' = -F(δ)

    Args:
        m: Mass of the ball [kg].
        R: Its radius [m].
        E: E/(1 - ν²) [Pa].
        nu: Poisson's ratio [-].
        v: Speed against the plane [m/s].
    """
    approach, force, _ = against_half_space(nu)
    kinetic = 0.5 * m * v**2 / (E * R**3)
    a = (15 / 8 * kinetic) ** 0.2
    for _ in range(30):
        _, delta, F, work, time = loading(
            lambda r, a=a: (a * r) ** 2 * approach(a * r),
            lambda r, a=a: 4 / 3 * (a * r) ** 3 * force(a * r),
        )
        scale = (kinetic / work) ** 0.2
        if abs(scale - 1) < 1e-12:
            break
        a *= scale
    return Impact(float(delta[-1] * R), float(F[-1] * E * R**2), float(2 * time[-1] * R / v))
