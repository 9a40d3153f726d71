"""Frictionless contact of elastic spheres, contact radius much smaller than the bodies.

1/R = 1/R₁ + 1/R₂ and 1/E* = (1 - ν₁²)/E₁ + (1 - ν₂²)/E₂; a plane has 1/R = 0, a
rigid body 1/E = 0.

Source: K. L. Johnson, Contact Mechanics, 1985, section 4.2.
"""

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk


def effective_modulus(*bodies):
    """E* [Pa] of deformable bodies, each a pair (E [Pa], ν)."""
    return 1 / sum((1 - nu**2) / E for E, nu in bodies)


def hertz_force(delta, R, E):
    """Force between two elastic spheres [N].

        F = 4/3 E* √(R δ³)

    Args:
        delta: Approach of distant points [m].
        R: Effective radius [m].
        E: Effective modulus [Pa].

    Source: Johnson 1985, eqs (4.22)-(4.23).
    """
    return 4 / 3 * E * np.sqrt(R * np.maximum(delta, 0.0) ** 3)


def contact_radius(delta, R):
    """a = √(R δ) [m].

    Source: Johnson 1985, eq. (4.23).
    """
    return np.sqrt(R * np.maximum(delta, 0.0))


def stress_on_axis(zeta, nu):
    """Stresses below the centre of the contact over p0, tension positive.

        σz = -1/(1 + ζ²),  σr = -(1 + ν)(1 - ζ atan 1/ζ) + ½/(1 + ζ²)

    Args:
        zeta: Depth over the contact radius, >= 0.
        nu: Poisson's ratio [-].

    Returns:
        Axial and radial stress; the hoop stress equals the radial one.

    Source: Johnson 1985, eqs (3.45).
    """
    zeta = np.asarray(zeta, dtype=float)
    axial = -1 / (1 + zeta**2)
    radial = -(1 + nu) * (1 - zeta * np.arctan2(1.0, zeta)) + 0.5 / (1 + zeta**2)
    return axial, radial


def crossed_cylinders(R1, R2, angle):
    """A and B <= of the gap A x² + B y² between cylinders whose axes enclose ``angle`` [1/m].

    Args:
        R1, R2: Radii [m].
        angle: Between the axes [rad]; 0 is parallel, with A = 0.

    Source: Johnson 1985, eqs (4.3)-(4.4).
    """
    total = 0.5 * (1 / R1 + 1 / R2)
    difference = 0.5 * np.sqrt(R1**-2 + R2**-2 + 2 * np.cos(2 * angle) / (R1 * R2))
    return 0.5 * (total - difference), 0.5 * (total + difference)


def elliptic_contact(delta, A, B, E):
    """Contact of surfaces with the gap A x² + B y², 0 < A <= B.

        p = p0 √(1 - x²/a² - y²/b²),  e² = 1 - b²/a²
        A = p0 b (K - E)/(E* e² a²),  B = p0 b (E a²/b² - K)/(E* e² a²),  δ = p0 b K/E*

    with the complete elliptic integrals K(e) and E(e).

    Args:
        delta: Approach of distant points [m].
        A, B: [1/m].
        E: Effective modulus [Pa].

    Returns:
        force [N], semi-axes a >= b [m], p0 [Pa].

    Source: Johnson 1985, eqs (4.25)-(4.32).
    """

    def ratio(m):  # B/A, grows from 1 with m = e²
        if m < 1e-6:
            return 1 + 0.75 * m
        K, L = ellipk(m), ellipe(m)
        return (L / (1 - m) - K) / (K - L)

    m = brentq(lambda m: ratio(m) - B / A, 0.0, 1 - 1e-12, xtol=1e-14) if B > A else 0.0
    K = ellipk(m)
    # (K - E)/e² tends to π/4.
    shape = (K - ellipe(m)) / m if m > 1e-6 else np.pi / 4
    # p0 b/E* = δ/K and A = (p0 b/E*) shape/a².
    a = np.sqrt(delta / K * shape / A)
    b = a * np.sqrt(1 - m)
    p0 = E * delta / (K * b)
    return 2 / 3 * np.pi * a * b * p0, a, b, p0
