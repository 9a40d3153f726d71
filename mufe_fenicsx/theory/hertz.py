"""Frictionless contact of elastic spheres, contact radius much smaller than the bodies.

1/R = 1/R₁ + 1/R₂ and 1/E* = (1 - ν₁²)/E₁ + (1 - ν₂²)/E₂; a plane has 1/R = 0, a
rigid body 1/E = 0.

Source: K. L. Johnson, Contact Mechanics, 1985, section 4.2.
"""

import numpy as np


def effective_modulus(*bodies):
    """E* [Pa] of deformable bodies, each a pair (E [Pa], ν)."""
    return 1 / sum((1 - nu**2) / E for E, nu in bodies)


def effective_radius(*radii):
    """R [m] of spheres of the given radii [m]."""
    return 1 / sum(1 / R for R in radii)


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


def largest_pressure(force, a):
    """p0 = 3 F / (2 π a²) [Pa].

    Source: Johnson 1985, eq. (4.24).
    """
    return 1.5 * force / (np.pi * a**2)


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
