"""Rigid tools pressed on an elastic half-space without friction, and its motion far from them."""

import numpy as np


def cone_force(depth, slope, E):
    """Force on a rigid cone [N].

        F = 2/π E* δ² tan α,  tan α = 1/slope

    Linear elasticity: the slope of the cone is small.

    Args:
        depth: δ of the tip below the plane [m].
        slope: Rise of the cone over its radius, cot α with the semi-angle α [-].
        E: E/(1 - ν²) of the half-space [Pa].

    Source: I. N. Sneddon, Int. J. Eng. Sci. 3, 1965, 47-57, section 5; K. L. Johnson, Contact
    Mechanics, 1985, eqs (5.10)-(5.11).
    """
    return 2.0 / np.pi * E * np.maximum(depth, 0.0) ** 2 / slope


def point_force_displacement(x, force, E, nu):
    """Displacements of the half-space z < 0 by a force at the origin that points down [m].

    With ρ = |x|, r its distance to the z axis and ζ = -z the depth,

        u_r = P/4πG (r ζ/ρ³ - (1 - 2ν) r/(ρ (ρ + ζ))),  u_z = -P/4πG (ζ²/ρ³ + 2 (1 - ν)/ρ).

    Args:
        x: Places, none of them the origin [m], shape (num, 3).
        force: P [N].
        E, nu: Young's modulus [Pa] and Poisson's ratio.

    Returns:
        Shape (num, 3).

    Source: J. Boussinesq 1885; K. L. Johnson, Contact Mechanics, 1985, eqs (3.18).
    """
    G = E / (2.0 * (1.0 + nu))
    rho = np.linalg.norm(x, axis=1)
    depth = -x[:, 2]
    across = depth / rho**3 - (1.0 - 2.0 * nu) / (rho * (rho + depth))
    down = depth**2 / rho**3 + 2.0 * (1.0 - nu) / rho
    u = np.column_stack([across * x[:, 0], across * x[:, 1], -down])
    return force / (4.0 * np.pi * G) * u
