"""Sheets of rubber: balloons, and what a membrane adds to the axial stress of a sample."""

import numpy as np


def thin_balloon(stretch, thickness_over_radius, G):
    """Pressure in a thin sphere of incompressible neo-Hookean rubber [Pa].

        p = 2 G (t/R) (1/λ - 1/λ⁷)

    Args:
        stretch: λ, radius over its first value.
        thickness_over_radius: t/R at the start.
        G: Shear modulus [Pa].

    Source: R. W. Ogden, Non-Linear Elastic Deformations, 1984, section 5.3.2.
    """
    stretch = np.asarray(stretch, dtype=float)
    return 2.0 * G * thickness_over_radius * (1.0 / stretch - stretch**-7.0)


def thick_balloon(stretch, inner, outer, G, K):
    """Pressure in a sphere of neo-Hookean rubber of any thickness and compressibility [Pa].

    With the principal stretches λr = dr/dR and λ = r/R and W of
    :class:`~mufe_fenicsx.materials.neo_hookean.NeoHookean`, the nominal stresses are P = ∂W/∂λ, and

        dP_r/dR = 2 (P_θ - P_r)/R,  r(inner) = stretch·inner,  P_r(outer) = 0,

    solved by collocation.

    Args:
        stretch: Of the inner surface.
        inner, outer: Radii at the start [m].
        G, K: Shear and bulk modulus [Pa].
    """
    from scipy.integrate import solve_bvp  # runs do without it

    def stresses(along, around):
        J = along * around**2
        third = (along**2 + 2.0 * around**2) / 3.0
        shear, mean = G * J ** (-2.0 / 3.0), K * np.log(J)
        radial = shear * (along - third / along) + mean * around**2
        hoop = shear * (around - third / around) + mean * along * around
        return radial, hoop

    def slopes(R, y):
        r, along = y
        around, h = r / R, 1e-30
        radial, hoop = stresses(along, around)
        # Derivatives by complex steps, exact to rounding.
        by_along = stresses(along + 1j * h, around)[0].imag / h
        by_around = stresses(along, around + 1j * h)[0].imag / h
        change = 2.0 * (hoop - radial) / R - by_around * (along - around) / R
        return np.stack([along, change / by_along])

    def ends(first, last):
        return np.array([first[0] / inner - stretch, stresses(last[1], last[0] / outer)[0] / G])

    R = np.linspace(inner, outer, 21)
    # Without a change of volume at the start of the search.
    r = np.cbrt(R**3 + (stretch**3 - 1.0) * inner**3)
    found = solve_bvp(slopes, ends, R, np.stack([r, R**2 / r**2]), tol=1e-8)
    if not found.success:
        raise RuntimeError(f"balloon of stretch {stretch:g}: {found.message}")
    r, along = found.sol(inner)
    return float(-stresses(along, r / inner)[0] * (inner / r) ** 2)


def membrane_correction(strain, extension_modulus, diameter):
    """Axial stress that a membrane carries in the compression of a sample [Pa].

        Δσ_a = 4 M ε_a / D

    It shortens with the sample and is free to widen: what a sheet carries per width, M ε_a, around
    the sample over the sample's area.

    Args:
        strain: ε_a, axial, compression positive.
        extension_modulus: M [N/m], of a sheet E t.
        diameter: D of the sample at the start [m].

    Source: D. J. Henkel, G. D. Gilbert, The effect of the rubber membrane on the measured triaxial
    compression strength of clay samples, Géotechnique 3, 1952, 20-29.
    """
    return 4.0 * extension_modulus * np.asarray(strain, dtype=float) / diameter


def ring_buckling_pressure(radius, thickness, E, nu):
    """Outer pressure at which a long thin tube becomes oval [Pa].

        p = E t³/(4 (1 - ν²) R³)

    The pressure follows the surface; the tube keeps its length, and no end holds it.

    Args:
        radius: R of the middle of the wall [m].
        thickness: t, far less [m].
        E, nu: Young's modulus [Pa] and Poisson's ratio.

    Source: M. Lévy 1884; S. P. Timoshenko, J. M. Gere, Theory of Elastic Stability, 1961, sections
    7.3 to 7.5.
    """
    return E * thickness**3 / (4.0 * (1.0 - nu**2) * radius**3)
