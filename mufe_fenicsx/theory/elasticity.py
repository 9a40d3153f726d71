"""Elastic moduli of a laterally confined column, and the speed of waves on a surface."""

import numpy as np


def oedometric_modulus(E, nu):
    """Stiffness without lateral strain [Pa].

        M = E (1 - ν) / ((1 + ν) (1 - 2ν))

    Args:
        E: Young's modulus [Pa].
        nu: Poisson's ratio [-].

    Source: S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed. 1970, section 6
    (Hooke's law with two strains zero).
    """
    return E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))


def lateral_stress_ratio(nu):
    """Lateral over axial stress without lateral strain, ν / (1 - ν) [-].

    Source: as :func:`oedometric_modulus`.
    """
    return nu / (1 - nu)


def rayleigh_speed(E, nu, rho):
    """Speed of waves on a plane surface [m/s], which no crack in tension exceeds.

    c = √(r G/ρ) with the root r in ]0, 1[ of

        r³ - 8 r² + (24 - 16 κ) r - 16 (1 - κ) = 0,  κ = (1 - 2ν)/(2 - 2ν)

    Source: Lord Rayleigh, Proc. London Math. Soc. 17, 1885, 4-11.
    """
    kappa = (1 - 2 * nu) / (2 - 2 * nu)
    roots = np.roots([1.0, -8.0, 24.0 - 16.0 * kappa, -16.0 * (1.0 - kappa)])
    r = min(root.real for root in roots if abs(root.imag) < 1e-9 and root.real > 0.0)
    return np.sqrt(r * E / (2.0 * (1.0 + nu) * rho))
