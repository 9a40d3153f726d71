"""Free vibrations of an elastic ball, and what an impact leaves in them.

A contact force at a pole moves the spheroidal modes that are symmetric about its axis. Each
is a mass on a spring; what it keeps when the force has gone is lost to the rebound.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import spherical_jn

from .ball_impact import ball_impact
from .impact import DURATION, pulse_spectrum


@dataclass(frozen=True)
class Mode:
    """A spheroidal mode of a free ball, symmetric about an axis."""

    order: int  #: n of Pₙ(cos θ)
    frequency: float  #: ω R/c_s
    mass: float  #: ∫ ρ u² dV over the mass of the ball, with u_r = 1 at the pole


@lru_cache(maxsize=16)
def modes(nu, highest=40.0, max_order=12):
    """Spheroidal modes up to the frequency ``highest`` (ω R/c_s) and the order ``max_order``.

    u = grad(A jₙ(h r) Pₙ) + curl curl(r B jₙ(k r) Pₙ), h = ω/c_p, k = ω/c_s, free of traction
    at the surface; without the rigid translation, which is of order 1.

    Source: H. Lamb, On the vibrations of an elastic sphere, Proc. London Math. Soc. 13, 1882,
    189-212.
    """
    ratio = math.sqrt((1 - 2 * nu) / (2 * (1 - nu)))  # c_s / c_p
    gauss = np.polynomial.legendre.leggauss(200)
    found = []
    for n in range(max_order + 1):
        k = np.linspace(0.3, highest, int(highest / 0.02))
        value = _free(n, k, ratio)[0]
        at = np.flatnonzero(value[:-1] * value[1:] < 0)
        low, high = k[at], k[at + 1]
        for _ in range(50):
            middle = 0.5 * (low + high)
            same = _free(n, middle, ratio)[0] * value[at] > 0
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        found += [Mode(n, float(f), _modal_mass(n, f, ratio, gauss)) for f in low]
    return tuple(sorted(found, key=lambda mode: mode.frequency))


def displacement(mode, nu, x):
    """Shape of a spheroidal mode about the axis z, of unit size at most somewhere.

    Args:
        mode: One of :func:`modes`.
        nu: Poisson's ratio.
        x: Positions over the radius, shape (num_points, 3); the centre is not one of them.

    Returns:
        Displacements, shape (num_points, 3).
    """
    ratio, n, k = math.sqrt((1 - 2 * nu) / (2 * (1 - nu))), mode.order, mode.frequency
    _, tau_a, tau_b = _free(n, k, ratio)
    A, B = (1.0, 0.0) if n == 0 else (tau_b, -tau_a)
    r = np.linalg.norm(x, axis=1)
    j, dj, _ = _radial(n, ratio * k, r)
    g, dg, _ = _radial(n, k, r)
    P, cosine = np.polynomial.Legendre.basis(n), x[:, 2] / r
    along = (A * dj + B * n * (n + 1) * g / r) * P(cosine)
    # dP/dθ = -sin θ P'; the unit vector of θ times sin θ is cos θ r̂ - ẑ.
    across = -(A * j / r + B * (g / r + dg)) * P.deriv()(cosine)
    radial = x / r[:, None]
    u = along[:, None] * radial + across[:, None] * (
        cosine[:, None] * radial - np.array([0.0, 0.0, 1.0])
    )
    return u / np.linalg.norm(u, axis=1).max()


def torsional_frequency(n):
    """ω R/c_s of the lowest torsional mode of order n >= 2: k jₙ'(k) = jₙ(k). Lamb 1882."""

    def traction(k):
        return k * spherical_jn(n, k, derivative=True) - spherical_jn(n, k)

    return float(brentq(traction, 0.5 * n, n + 2.0))


def twist(x):
    """Shape of the lowest torsional mode of order 2 about z: both halves turn against each other.

    Args and answer as of :func:`displacement`.
    """
    r = np.linalg.norm(x, axis=1)
    size = spherical_jn(2, torsional_frequency(2) * r) / r**2 * x[:, 2]
    u = size[:, None] * np.column_stack([-x[:, 1], x[:, 0], np.zeros(r.size)])
    return u / np.linalg.norm(u, axis=1).max()


def vibration_loss(m, R, E, nu, rho, v):
    """Energy left in vibrations over the kinetic energy before the impact [-].

        Σ P² S(ωᵢ)² / (m² μᵢ v²),  P = 2 m v

    with the spectrum S of the force, 1 at ω = 0, and the masses m μᵢ of the modes;
    restitution is √(1 - loss). Assumed: a pulse of Hertz's form and of the duration of
    :func:`~mufe_fenicsx.theory.ball_impact.ball_impact`, at one point, and not changed by the
    vibration. The first is good while n a/R is small, and high orders count little: the
    spectrum falls as ω^(-5/2).

    Args:
        m, R, E, nu, v: As for ``ball_impact``.
        rho: Density [kg/m³].

    Source: the idea, with S2 alone, Lord Rayleigh, On the production of vibrations by forces of
    relatively long duration, Phil. Mag. 11, 1906, 283-291.
    """
    time = ball_impact(m, R, E, nu, v).time
    unit = math.sqrt(0.5 * E * (1 - nu) / rho) / R  # c_s / R, G = E* (1 - ν)/2
    omega = np.array([mode.frequency for mode in modes(nu)]) * unit
    mass = np.array([mode.mass for mode in modes(nu)])
    spectrum = pulse_spectrum(omega * time) * 0.625 * DURATION
    return float((4 * spectrum**2 / mass).sum())


def _radial(n, q, r):
    """jₙ(q r) and its first two derivatives by r."""
    x = q * r
    j, dj = spherical_jn(n, x), spherical_jn(n, x, derivative=True)
    return j, q * dj, q * q * (-2 / x * dj - (1 - n * (n + 1) / x**2) * j)


def _free(n, k, ratio):
    """Determinant of the tractions of A and B at r = 1, and their shear tractions, over G."""
    j, dj, d2j = _radial(n, ratio * k, 1.0)
    g, dg, d2g = _radial(n, k, 1.0)
    # σ = λ/G div u + 2 u_r' and div u = -h² jₙ, with λ/G h² = k² - 2 h².
    sigma_a = -(k**2 - 2 * (ratio * k) ** 2) * j + 2 * d2j
    if n == 0:
        return sigma_a, None, None
    sigma_b = 2 * n * (n + 1) * (dg - g)
    # τ = u_θ' - u_θ + u_r, the factors of Pₙ'.
    tau_a, tau_b = 2 * (dj - j), d2g + (n * (n + 1) - 2) * g
    return sigma_a * tau_b - sigma_b * tau_a, tau_a, tau_b


def _modal_mass(n, k, ratio, gauss):
    """∫ u² dV over the volume, for u_r = 1 at the pole."""
    _, tau_a, tau_b = _free(n, k, ratio)
    A, B = (1.0, 0.0) if n == 0 else (tau_b, -tau_a)
    r, weight = 0.5 * (gauss[0] + 1), 0.5 * gauss[1]
    r = np.append(r, 1.0)
    j, dj, _ = _radial(n, ratio * k, r)
    g, dg, _ = _radial(n, k, r)
    U = A * dj + B * n * (n + 1) * g / r
    V = (A * j / r + B * (g / r + dg))[:-1]
    # ∫ Pₙ² sin θ dθ = 2/(2n+1), ∫ Pₙ'² sin θ dθ = n(n+1) 2/(2n+1); volume 4π/3.
    square = (weight * r[:-1] ** 2 * (U[:-1] ** 2 + n * (n + 1) * V**2)).sum()
    return float(3 * square / (2 * n + 1) / U[-1] ** 2)
