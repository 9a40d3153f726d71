"""Impact of spheres that yield: restitution.

p is the contact pressure that is never exceeded, V_y the speed at which it is first reached.
Up to there the contact is Hertz's; beyond, the part of Hertz's pressure above p is cut off, so
force grows by π R p for each unit of approach; unloading is that of an elastic sphere
with the radius of the flattened contact. A limit that sets in at once is a simplification:
a real sphere starts to yield at p0 = 1.6 Y (ν = 0.3) and reaches a mean pressure of 2.8 Y only
some hundred times the approach later. So p between those two brackets it, and p is the only
parameter that the theory has.

It holds for quasi-static loading of contacts that are small beside the sphere: no
waves, a/R << 1. C.-Y. Wu, L.-Y. Li, C. Thornton (Int. J. Impact Eng. 28, 2003, 929-946) find by
finite elements that restitution falls faster, as V^(-1/2) instead of V^(-1/4), where the
contact is no longer small (finite plastic deformation).

Source: C. Thornton, J. Appl. Mech. 64, 1997, 383-386.
"""

import numpy as np


def yield_speed(p, E, m, R):
    """V_y [m/s]: that of an impact by Hertz with the largest pressure p.

        ½ m V_y² = 2/5 F δ at p0 = p:  V_y = (π/2E*)² (8π R³/15m)^(1/2) p^(5/2)

    Args:
        p: Limiting contact pressure [Pa].
        E: Effective modulus E* [Pa].
        m: Effective mass [kg].
        R: Effective radius [m].

    Source: Thornton 1997; K. L. Johnson, Contact Mechanics, 1985, section 11.5.
    """
    return (np.pi / (2 * E)) ** 2 * np.sqrt(8 * np.pi * R**3 / (15 * m)) * p**2.5


def restitution(v, v_yield):
    """Speed of rebound over that of impact.

        e = (6√3/5)^½ (1 - u²/6)^½ [u/(u + 2 √(6/5 - u²/5))]^¼,  u = V_y/V <= 1

    and 1 below V_y; e tends to 1.185 u^¼.

    Args:
        v: Speed of impact [m/s].
        v_yield: V_y [m/s].

    Source: Thornton 1997.
    """
    u = np.minimum(v_yield / np.asarray(v, dtype=float), 1.0)
    tail = u / (u + 2 * np.sqrt(1.2 - 0.2 * u**2))
    return np.sqrt(1.2 * np.sqrt(3) * (1 - u**2 / 6)) * tail**0.25


#: Elastic energy of a loaded circle of a half-space, times E* a/F²: with the pressure of
#: Hertz, p ~ (1 - r²/a²)^½, and with an even one. Johnson 1985, eqs (4.24), (3.29).
HERTZ_PROFILE, EVEN_PROFILE = 3 / 10, 8 / (3 * np.pi**2)


def restitution_by_curve(energy, delta, force, radius, E, profile=HERTZ_PROFILE):
    """Speed of rebound over that of impact, from force and contact radius over the approach.

        e² = c F²/(E* a W),  W = ∫ F dδ = ½ m V²

    Loading ends where its work W is the energy of the impact; unloading is elastic and
    recovers what the pressure at that moment stores in a half-space. A fully plastic
    contact has an even pressure, c = 8/3π²; one at the onset of yield that of Hertz, c = 3/10.
    With Thornton's law of force and a = √(Rδ) and the latter it is Thornton's restitution. But
    the contact of a plastic sphere is wider, a² up to 2.6 Rδ, and stiffer to load.

    Args:
        energy: Of the impact [J].
        delta, force, radius: The curve [m], [N], [m], shape (n,), from no approach on.
        E: Effective modulus E* [Pa].
        profile: c, one of the constants above.

    Raises:
        ValueError: The curve ends before its work is the energy.
    """
    work = np.append(0.0, np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(delta)))
    if not 0 < energy <= work[-1]:
        raise ValueError(f"energy = {energy} J, expected > 0 and at most {work[-1]} J")
    F, a = np.interp(energy, work, force), np.interp(energy, work, radius)
    return float(np.sqrt(min(profile * F**2 / (E * a * energy), 1.0)))
