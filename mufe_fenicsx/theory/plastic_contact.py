"""Spheres that yield in contact with a rigid plane: onset, force, area, pressure.

R is the radius, E* = E/(1 - ν²), Y the yield stress of von Mises; δ the approach of the
plane to the centre. All spheres are taken for half-spaces but for the mean pressure, which
falls as the contact grows into the sphere.

Onset: the largest von Mises stress below a Hertz contact reaches Y. Beyond it there is no
closed form; the formulas here are fits to axisymmetric finite elements:

- perfectly plastic: R. L. Jackson, I. Green, J. Tribol. 127, 2005, 343-354. Fitted to steels:
  E = 200 GPa, Y from 0.21 to 1.62 GPa (E/Y from 124 to 952), ν = 0.32, a/R <= 0.41.
- linear hardening: H. Ghaednia, M. R. W. Brake, M. Berryhill, R. L. Jackson, J. Tribol. 141,
  2019, 031402, the exponent U as corrected by its authors. At Et = 0 its force is that of
  Jackson and Green with another fit of the mean pressure, 1 to 3 % from it.
"""

import math

import numpy as np

#: Over δ/δc of onset: up to here Jackson and Green take the contact for elastic.
ELASTIC_UP_TO = 1.9


def onset_factor(nu, num_points=20001):
    """C: the pressure p0 of Hertz over Y at which the first point yields.

    The inverse of the largest von Mises stress over p0 on the axis (where it is largest),
    from the stresses of Hertz. Jackson and Green fit C = 1.295 exp(0.736 ν) to the same.

    Source: K. L. Johnson, Contact Mechanics, 1985, eqs (3.45) and section 6.1.
    """
    zeta = np.linspace(0.0, 2.0, num_points)
    axial = -1 / (1 + zeta**2)
    radial = -(1 + nu) * (1 - zeta * np.arctan2(1.0, zeta)) - 0.5 * axial
    return 1 / float(np.abs(axial - radial).max())


def fitted_onset_factor(nu):
    """C = 1.295 exp(0.736 ν), Jackson and Green 2005."""
    return 1.295 * np.exp(0.736 * nu)


def onset(R, E, Y, C):
    """Approach [m], force [N] and contact radius [m] where the first point yields, p0 = C Y.

        δ = (π C Y/2E*)² R,  F = (π C Y)³ R²/6E*²,  a = π C Y R/2E*

    Args:
        R: Radius [m].
        E: Effective modulus E* [Pa].
        Y: Yield stress [Pa].
        C: From one of the functions above.

    Source: Johnson 1985, eqs (4.24) and (6.9).
    """
    ratio = np.pi * C * Y / (2 * E)
    return ratio**2 * R, 4 / 3 * E * R**2 * ratio**3, ratio * R


def plateau(a_over_R):
    """Mean pressure over Y of full plasticity, 2.84 [1 - exp(-0.82 (a/R)^-0.7)].

    Source: Jackson and Green 2005.
    """
    a = np.maximum(np.asarray(a_over_R, dtype=float), 1e-12)
    return 2.84 * (1 - np.exp(-0.82 * a**-0.7))


def jackson_green(delta, R, E, Y, nu):
    """Force [N] and contact radius [m] of a perfectly plastic sphere on a rigid plane.

        F/Fc = exp(-¼ d^(5/12)) d^(3/2) + 4H/(C Y) [1 - exp(-d^(5/9)/25)] d
        a/R = ½π C Y/E* √(d (d/1.9)^B),  B = 0.14 exp(23 Y/E*),  d = δ/δc >= 1.9

    with H of :func:`plateau`, and Hertz before.

    Args:
        delta: Approach [m].
        R: Radius [m].
        E: Effective modulus E* [Pa].
        Y: Yield stress [Pa].
        nu: Poisson's ratio [-].

    Source: Jackson and Green 2005.
    """
    d, C, critical_force, a = _plastic_radius(delta, R, E, Y, nu)
    force = _plastic_force(d, C, plateau(a / R))
    hertz = np.sqrt(d) ** 3
    elastic = d <= ELASTIC_UP_TO
    return critical_force * np.where(elastic, hertz, force), np.where(
        elastic, np.sqrt(R * np.maximum(delta, 0.0)), a
    )


def ghaednia(delta, R, E_young, tangent, Y, nu):
    """Force [N] and contact radius [m] of a sphere with linear hardening on a rigid plane.

        F = Fp + (Fe - Fp) [1 - exp(-3.3 Et/E)],  a = ae + (ap - ae) exp U
        U = -2 √(E/Y) (Et/E)^(1 - (δ - δc)/R) / {[4 - 3 exp(-2 √(E/Y) Et/E)] (1 - Et/E)}

    between Hertz (ae, Fe) and the perfectly plastic sphere: ap of :func:`jackson_green`, and
    Fp the same but for H/Y = 2.84 - 0.92 (1 - cos πa/R). Elastic up to 1.9 δc.

    Args:
        delta: Approach [m].
        R: Radius [m].
        E_young: Young's modulus [Pa].
        tangent: Et, slope of stress against total strain beyond yield [Pa], 0 <= Et < E.
        Y: First yield stress [Pa].
        nu: Poisson's ratio [-].

    Source: Ghaednia et al. 2019.
    """
    E = E_young / (1 - nu**2)
    d, C, critical_force, ap = _plastic_radius(delta, R, E, Y, nu)
    delta_c = onset(R, E, Y, C)[0]
    approach = np.maximum(np.asarray(delta, dtype=float), 0.0)
    ae, ratio, root = np.sqrt(R * approach), tangent / E_young, np.sqrt(E_young / Y)
    power = ratio ** (1 - (approach - delta_c) / R) if ratio > 0 else 0.0
    U = -2 * root * power / (4 - 3 * np.exp(-2 * root * ratio)) / (1 - ratio)
    a = ae + (ap - ae) * np.exp(U)
    Fe = d**1.5
    Fp = _plastic_force(d, C, 2.84 - 0.92 * (1 - np.cos(np.pi * a / R)))
    force = Fp + (Fe - Fp) * (1 - np.exp(-3.3 * ratio))
    elastic = d <= ELASTIC_UP_TO
    return critical_force * np.where(elastic, Fe, force), np.where(elastic, ae, a)


def _plastic_radius(delta, R, E, Y, nu):
    """δ/δc, C, force of onset [N] and contact radius of full plasticity [m]."""
    C = fitted_onset_factor(nu)
    delta_c, critical_force, critical_radius = onset(R, E, Y, C)
    d = np.maximum(np.asarray(delta, dtype=float), 0.0) / delta_c
    B = 0.14 * np.exp(23 * Y / E)
    return d, C, critical_force, critical_radius * np.sqrt(d * (d / ELASTIC_UP_TO) ** B)


def _plastic_force(d, C, H):
    """Force over that of onset; H is the mean pressure of full plasticity over Y."""
    elastic = np.exp(-0.25 * d ** (5 / 12)) * d**1.5
    return elastic + 4 * H / C * (1 - np.exp(-(d ** (5 / 9)) / 25)) * d


def forged_disc(volume, friction):
    """Mean pressure on a thin, perfectly plastic disc between rough platens, over its yield stress.

    Equilibrium of a ring, dp/dr = -2 τ/h, with p = Y at the rim and the friction τ = μ p, at most
    the shear strength Y/√3 (E. Siebel, Stahl und Eisen 43, 1923, 1295-1298).

    Args:
        volume: Of the disc over its height cubed [-].
        friction: μ of the platens [-].
    """
    radius = math.sqrt(volume / math.pi)
    r = np.linspace(0.0, radius, 2001)
    sticks = 1.0 / math.sqrt(3.0)
    # Where friction slips, within x of the rim, p grows as an exponential, and then as a line.
    x = radius - r
    slips = math.log(max(sticks / friction, 1.0)) / (2.0 * friction) if friction else math.inf
    p = np.exp(2.0 * friction * np.minimum(x, slips)) + 2.0 * sticks * np.maximum(x - slips, 0.0)
    return float(2.0 * np.trapezoid(p * r, r) / radius**2)
