"""How far explicit and static increments go: limits in closed form, each with its source."""

import numpy as np
from scipy.optimize import brentq


def growth_per_step(omega_dt):
    """Largest factor by which central differences multiply an oscillation in a step.

    The characteristic equation z² - (2 - (ω Δt)²) z + 1 = 0 has roots of modulus 1 up to
    ω Δt = 2; beyond, the larger one is

        |z| = (w + √(w² - 1))²,  w = ω Δt/2.

    Source: T. J. R. Hughes, The Finite Element Method, 1987, section 9.1.

    Args:
        omega_dt: Angular frequency times time step [-].
    """
    w = np.maximum(0.5 * np.asarray(omega_dt, dtype=float), 1.0)
    return (w + np.sqrt(w**2 - 1.0)) ** 2


def rebound_speed(omega_dt, phase):
    """Speed of a mass after it met a spring, over that before, by central differences.

    The spring acts while its length is negative; the first position behind it is
    ``phase`` times the way of a step deep. Each step then is v ← v - (ω Δt)² x, x ← x + v
    (x in ways of a step, v in first speeds). Beyond (ω Δt)² = 2 a mass that is found
    a whole way deep leaves at (ω Δt)² - 1, faster than it came, without bound; below it gains
    no more than :func:`rebound_bound` allows.

    Args:
        omega_dt: √(k/m) Δt [-].
        phase: In ]0, 1], broadcast with ``omega_dt``.
    """
    q, x = np.broadcast_arrays(np.asarray(omega_dt, dtype=float) ** 2, phase)
    x = x.astype(float)
    v, inside = np.ones_like(x), np.ones(x.shape, dtype=bool)
    while inside.any():
        v = np.where(inside, v - q * x, v)
        x = np.where(inside, x + v, x)
        inside &= x > 0.0
    return np.abs(v)


def cap_step(altitude, area, modulus, apex_mass, base_mass):
    """Stable step of a flat tetrahedron of one apex above its base, in a mesh of thick ones [s].

    The apex swings against the base along its altitude a, strain u/a over the volume A a/3:

        k = M A/(3 a),  1/m = 1/m_apex + Σ 1/(9 m_b),  Δt = 2 √(m/k),

    which falls as √a, for the masses are those of the mesh around. The bound by single elements
    takes the mass of this one alone and falls as a.

    Args:
        altitude: a [m].
        area: Of the base, A [m²].
        modulus: Stiffness without lateral strain, M [Pa].
        apex_mass: Of the node above the base [kg].
        base_mass: Of the nodes of the base [kg], shape (3,).
    """
    mass = 1.0 / (1.0 / apex_mass + (1.0 / (9.0 * np.asarray(base_mass))).sum())
    return 2.0 * np.sqrt(3.0 * mass * altitude / (modulus * area))


def inversion_speed(bulk_modulus, rho):
    """Speed at which the apex of a free, soft tetrahedron has to be shot to reach its base [m/s].

    Without a deviator all that resists is p = K ln J, of the energy K (J ln J - J + 1) a volume:
    K at J = 0, a finite one. Apex and base have a quarter and three quarters of the mass ρ V:

        ½ (3/16) ρ V v² = K V.

    Args:
        bulk_modulus: K [Pa].
        rho: Density [kg/m³].

    Source: the stored energy of J. Bonet, A. J. Burton, Commun. Numer. Methods Eng. 14, 1998.
    """
    return np.sqrt(32.0 / 3.0 * bulk_modulus / rho)


def self_locking_friction(stiffness, spring, normal, slip):
    """Coefficient of friction beyond which a dragged point never slips, inf if there is none.

    A point held by the elastic stiffness C⁻¹ presses on a plane by a spring k along n; the plane
    is drawn along t. While it slips, its force N (n + μ t) moves it by N C (n + μ t), and

        N = k d / (1 + k n·C n + μ k n·C t):

    infinite at μ = -(1/k + n·C n)/(n·C t), where friction draws the point in as fast as the
    pressure lifts it.

    Args:
        stiffness: Of the point against all else [N/m], shape (3, 3).
        spring: k [N/m].
        normal: n, from the plane to the point, shape (3,).
        slip: t, the way of the plane, shape (3,).

    Source: A. Klarbring, Ingenieur-Archiv 60, 1990, 529-541, for a point with its own spring.
    """
    C = np.linalg.inv(stiffness)
    across = normal @ C @ slip
    return -(1.0 / spring + normal @ C @ normal) / across if across < 0.0 else np.inf


def necking_strain(first_yield, hardening):
    """Logarithmic strain at which a bar in tension carries the most: dσ/dε = σ.

    With σ = Y + H ε: ε = 1 - Y/H, none below H = Y, where the bar necks as it yields.

    Args:
        first_yield: Y [Pa].
        hardening: H [Pa].

    Source: A. Considère, Annales des Ponts et Chaussées 9, 1885, 574-775.
    """
    return max(1.0 - first_yield / hardening, 0.0) if hardening > 0 else 0.0


def shared_volume(flow_stress, shear_modulus):
    """|1 - 1/J| of an element that shares its volume with neighbours, as far as flow can drive it.

    Its own mean stress G (1 - 1/J)³/J resists (kernels.bulk.solid); stresses that drive it are of
    the order of the flow stress Y: (Y/G)^(1/3).
    """
    return (flow_stress / shear_modulus) ** (1 / 3)


def uniaxial_strain(stretch):
    """Pressure over E of a body with ν = 0 squeezed to λ of its length, by the program's law [-].

    Cauchy's mean stress is K ln J and Kirchhoff's deviator 2G dev(ln λ); with ν = 0, K = E/3,
    2G = E and J = λ

        p/E = -ln λ (1/3 + 2/(3λ)).

    Args:
        stretch: λ [-].
    """
    stretch = np.asarray(stretch, dtype=float)
    return -np.log(stretch) * (1.0 / 3.0 + 2.0 / (3.0 * stretch))


def sealed_speed(relative_pressure):
    """Speed of approach beyond which two equal bars with ν = 0 press no harder, over √(E/ρ) [-].

    A front that stops a bar of speed u = v/2 by the stretch λ carries the pressure p:

        p = ρ U u,  u = U (1 - λ)   →   v/c = 2 √((1 - λ) p/E),

    U the speed of the front in the bar before. Small ones: v = 2 p/(ρ c).

    Args:
        relative_pressure: The largest pressure of the contact, p/E. Two layers of c h/E* whose
            force grows no more beyond the depth d carry d/h/(2 c) E*.

    Source: the Rankine-Hugoniot conditions, K. F. Graff, Wave Motion in Elastic Solids, 1975.
    """
    low, high = 0.01, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if uniaxial_strain(middle) > relative_pressure else (low, middle)
    return 2.0 * np.sqrt((1.0 - low) * relative_pressure)


def sinking_speed(sealed, compliance, full, allowed, length):
    """Speed of approach at which long bars sink as deep as is allowed while they meet [-].

    Springs of two layers fill up to their largest depth d in the time that a mass of waves takes,
    beyond which the bars sink at the excess over v₀ until fronts are back from their far ends,

        t = -τ ln(1 - v₀/v),  τ = c h/(c_wave),   (v - v₀) (2 L/c_wave - t) = D - d.

    Args:
        sealed: v₀ over the speed of waves, :func:`sealed_speed`.
        compliance: c of the layers [-].
        full: d over the edge of facets h.
        allowed: D over h.
        length: Of a bar over h.
    """
    low, high = sealed * (1 + 1e-9), 10.0 * sealed
    for _ in range(80):
        v = 0.5 * (low + high)
        left = 2 * length + compliance * np.log(1 - sealed / v)
        low, high = (low, v) if (v - sealed) * left > allowed - full else (v, high)
    return v


def swallowed_ratio(relative_pressure, compliance, part):
    """Size of facets over that of a smaller grain's at which this one is ``part`` h deep.

    Layers of both sides add: d = c (h + H) p/E*, so H/h = part E*/(c p) - 1.

    Args:
        relative_pressure: p/E* [-].
        compliance: c [-].
        part: d/h [-].
    """
    return part / (compliance * relative_pressure) - 1.0


def drag_error(stabilisation, contact_modulus, modulus, increments):
    """Force of the drag on a cube in static increments over the force that it carries.

    The platen above a cube of edge L, at rest below, moves by δ/n in each of n even increments,
    the cube by half of that in the mean; the drag s E* L (δ/2n) is what the platens' forces
    M L² δ/L differ by:

        s E*/(2 n M).

    Args:
        stabilisation: s [-].
        contact_modulus: E* [Pa].
        modulus: M [Pa].
        increments: n [-].
    """
    return 0.5 * stabilisation * contact_modulus / (increments * modulus)


def force_of_three(apart, share=1.0):
    """Force of one of three like contacts over that of one alone at the same approach.

    A half-space moves by P/(π E* r) at the distance r of a force P (Boussinesq). With Hertz's
    approach of one contact, two others at the distance s move it by

        p^(2/3) + g 8/(3π) (a/s) p = 1,   p = P/P₁ .

    Args:
        apart: s over the radius a of a contact alone.
        share: g, of the motion that a mesh has.

    Source: K. L. Johnson, Contact Mechanics, 1985, eqs (3.22a) and (4.22)-(4.23).
    """
    by_others = share * 8 / (3 * np.pi * apart)
    return float(brentq(lambda p: p ** (2 / 3) + by_others * p - 1, 0.0, 1.0))


def apart_for(error, apart, reach):
    """Distance over the edge h at which three contacts carry too much by the part ``error``.

    The mesh of a facet moves as one: others on it move a contact no more than it moves itself,
    P/(π E* s₀), so that g = s/s₀ below s₀.

    Args:
        error: Of the force.
        apart: As of :func:`force_of_three`.
        reach: s₀/h.
    """
    p = (1 + error) * force_of_three(apart)
    share = (1 - p ** (2 / 3)) / p * 3 * np.pi * apart / 8
    return reach * share


def force_by_edge(from_edge):
    """Force of a ball on a like quarter-space over that on a half-space, at the same approach.

    A second load beyond the side at the same distance x leaves no shear on it. It moves the contact
    by P/(π E'* 2x), with E'* = 2 E* of one body. The pressure that both leave on the side is not
    taken off, which makes the quarter-space too stiff.

        p^(2/3) + a/(3π x) p = 1

    Args:
        from_edge: x over the radius a of the contact on a half-space.
    """
    by_image = 1 / (3 * np.pi * from_edge)
    return float(brentq(lambda p: p ** (2 / 3) + by_image * p - 1, 0.0, 1.0))


def from_edge_for(error):
    """x/a at which the part ``error`` of the force of :func:`force_by_edge` is missing."""
    p = 1 - error
    return p / (3 * np.pi * (1 - p ** (2 / 3)))


def scatter_of_rough_force(unevenness, elements_per_radius, conformity):
    """Scatter of the force of a contact on surfaces that are uneven by points, over the force.

    Each of N points of the contact has a gap that is off by s by chance. Of P ∝ d^(3/2), d = a²/R',
    that leaves

        (3/2) s/(d √N_e),   N_e = N (mean p)²/(mean p²) = 8/9 N

    by the ellipsoid of pressures. Facets of the edge h and the area √3 h²/4 on both sides have
    N = 2 π a²/(√3 h²/4) points. All is the first order in s: no point opens.

    Args:
        unevenness: s R/h² of the gap, R the radius of the surfaces [-].
        elements_per_radius: a/h [-].
        conformity: R'/R, 1/R' being the curvature of the gap [-].
    """
    points = 8 / 9 * 8 * np.pi / np.sqrt(3) * elements_per_radius**2
    off = unevenness * conformity / elements_per_radius**2
    return 1.5 * off / np.sqrt(points)


def conformity_for(error, unevenness, elements_per_radius):
    """R'/R at which :func:`scatter_of_rough_force` is ``error``."""
    return error / scatter_of_rough_force(unevenness, elements_per_radius, 1.0)
