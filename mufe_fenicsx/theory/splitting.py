"""Stress in a disc and in a sphere that are squeezed across a diameter, and split in tension.

Linear elasticity of the whole body, small strain, without friction or body forces. The load is
given as a pressure on two opposite spots, not found from contact. There are two kinds: "hertz",
that of flat platens, along the loaded axis and spread as Hertz's pressure; and "uniform", along
the radii, of the classical solutions (Hondros; Hiramatsu & Oka). Away from the spots only the
force counts (St Venant). For a/R = 0.05 and ν = 0.15 the tension across the axis of the sphere
differs between the kinds by 0.04 % in the middle, 1 % at six, 3 % at four and 17 % at two
contact radii below the platen; that in the middle from point forces by (a/R)², 0.3 %. Lengths
are in radii; tension is positive.
"""

import numpy as np

KINDS = ("hertz", "uniform")
#: Forces that stand for the pressure on a spot of the disc.
NUM_FORCES = 200


# --- disc -------------------------------------------------------------------------------------


def disc_stress(x, y, a):
    """Stress in a disc between flat platens that press by p = 2P/(πat) √(1 - x²/a²).

    A sum over :func:`chord_stress`, right but for places less than a/20 below the spot. In the
    plane the stress is the same for plane stress and plane strain, whatever the elastic
    constants: the body has no holes and its load is in balance.

    Args:
        x, y: Place over R, y along the load; any shape.
        a: Half of the width of contact over R.

    Returns:
        σx, σy, τxy in units of P/(πRt), stacked along the first axis.
    """
    s = np.pi * ((np.arange(NUM_FORCES) + 0.5) / NUM_FORCES - 0.5)
    weight = 2 * np.cos(s) ** 2 / NUM_FORCES
    return sum(w * chord_stress(x, y, p) for w, p in zip(weight, a * np.sin(s), strict=True))


def chord_stress(x, y, place):
    """Stress in a disc under two opposite forces P along a chord parallel to y.

    Each makes the radial stress of a half-plane, -(2P/πt) cos θ/r with the distance r and the
    angle θ from the chord. Together they leave on the circle the even pressure
    (P/πRt) cos φ, sin φ = ``place``, which is taken away.

    Args:
        x, y: Place over R; any shape.
        place: Distance of the chord from the middle over R.

    Returns:
        σx, σy, τxy in units of P/(πRt), stacked along the first axis.

    Source: S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed. 1970, section 41.
    """
    x, y = np.broadcast_arrays(np.asarray(x, float) - place, np.asarray(y, float))
    half = np.sqrt(1 - place**2)
    stress = np.stack([np.full(x.shape, half), np.full(x.shape, half), np.zeros(x.shape)])
    for h, sign in ((half - y, 1.0), (half + y, -1.0)):
        r4 = (x**2 + h**2) ** 2
        stress -= 2 * np.stack([x**2 * h, h**3, -sign * x * h**2]) / r4
    return stress


def arc_stress(y, a):
    """Stress on the loaded diameter under an even radial pressure on two arcs.

        σx = (P/πRt sin α) [A - B],  σy = -(P/πRt sin α) [A + B],  sin α = a/R
        A = (1 - y²) sin 2α/(1 - 2y² cos 2α + y⁴),  B = atan[(1 + y²)/(1 - y²) tan α]

    Args:
        y: Distance from the middle over R, below 1; any shape.
        a: Half of the chord of the arc over R.

    Returns:
        σx, σy in units of P/(πRt), stacked along the first axis.

    Source: G. Hondros, Aust. J. Appl. Sci. 10, 1959, 243-268.
    """
    alpha, y2 = np.arcsin(a), np.asarray(y, float) ** 2
    A = (1 - y2) * np.sin(2 * alpha) / (1 - 2 * y2 * np.cos(2 * alpha) + y2**2)
    B = np.arctan2((1 + y2) * np.tan(alpha), 1 - y2)
    return np.stack([A - B, -A - B]) / a


def line_contact(force, R, E):
    """Half width [m] and largest pressure [Pa] of a cylinder on a plane.

        a² = 4 P'R/(πE*),  p0 = 2 P'/(πa)

    Args:
        force: P', per length [N/m].
        R: Radius [m].
        E: Effective modulus E* [Pa].

    Source: K. L. Johnson, Contact Mechanics, 1985, section 4.2(c).
    """
    a = np.sqrt(4 * force * R / (np.pi * E))
    return a, 2 * force / (np.pi * a)


def disc_approach(force, R, E):
    """Approach of a platen to the middle of a cylinder in plane strain [m].

        δ = P'/(πE*) [2 ln(4R/a) - 1]

    Args:
        force, R, E: As of :func:`line_contact`.

    Source: K. L. Johnson, Contact Mechanics, 1985, section 5.6.
    """
    a, _ = line_contact(force, R, E)
    return force / (np.pi * E) * (2 * np.log(4 * R / a) - 1)


# --- sphere -----------------------------------------------------------------------------------


def sphere_stress(r, theta, a, nu, kind="hertz", resolution=80.0):
    """Stress in a sphere loaded on two caps, by series of Legendre polynomials.

    The solution of order n, with the displacements u_r = U Pₙ(cos θ), u_θ = V dPₙ/dθ,

        U = A (n+1)(n-2+4ν) rⁿ⁺¹ + B n rⁿ⁻¹,  V = A (n+5-4ν) rⁿ⁺¹ + B rⁿ⁻¹

    (Lurie; theory.finite_sphere) has the dilatation -2 A (n+1)(2n+3)(1-2ν) rⁿ Pₙ, hence
    all stresses by Hooke's law. A and B make the traction on r = 1 that of the load. Hiramatsu and
    Oka solve the same, with kind "uniform", in other constants.

    Args:
        r: Distance from the middle over R, at most 1; any shape.
        theta: Angle from the loaded axis [rad].
        a: sin of the half angle of the caps, contact radius over R.
        nu: Poisson's ratio [-].
        kind: One of :data:`KINDS`: p ~ √(1 - ρ²/a²) along the axis, or p along the radii.
        resolution: Highest order of the series times a.

    Returns:
        σr, σθ, σφ, τrθ in units of F/d², d = 2R, stacked along the first axis.

    Source: Y. Hiramatsu, Y. Oka, Int. J. Rock Mech. Min. Sci. 3, 1966, 89-99; A. I. Lurie,
    Three-Dimensional Problems of the Theory of Elasticity, 1964, chapter 8.
    """
    r, theta = np.broadcast_arrays(np.asarray(r, float), np.asarray(theta, float))
    cos, sin = np.cos(theta), np.sin(theta)
    orders = np.arange(0, int(resolution / a) + 1, 2)  # both caps are loaded alike
    radial, shear = _load(orders, a, kind)
    A, B = _constants(orders, radial, shear, nu)
    A[0], B[0] = radial[0] / (-2 - 2 * nu), 0.0  # no traction but the pressure, no dPₙ/dθ
    stress = np.zeros((4, *r.shape))
    for (n, P, D), a_n, b_n in zip(_even_legendre(cos, orders), A, B, strict=True):
        high = a_n * r**n
        low = b_n * r ** (n - 2) if n else 0.0 * r
        V = (n + 5 - 4 * nu) * high + low
        along = (n + 1) * (n - 2 - 2 * nu - 4 * nu * n) * high + n * low
        stress[0] += ((n + 1) * (n**2 - n - 2 - 2 * nu) * high + n * (n - 1) * low) * P
        # d²P/dθ² = -n(n+1) P + cos θ D and cot θ dP/dθ = -cos θ D, with D = dP/d cos θ.
        stress[1] += along * P + V * (cos * D - n * (n + 1) * P)
        stress[2] += along * P - V * cos * D
        stress[3] -= ((n**2 + 2 * n - 1 + 2 * nu) * high + (n - 1) * low) * sin * D
    return 4 * stress


def _load(orders, a, kind):
    """Factors of Pₙ in σr and of dPₙ/dθ in τ on r = 1, of the force 1 on each cap."""
    # The highest order has orders[-1] a / 2π waves on the spot.
    s, weight = np.polynomial.legendre.leggauss(100 + int(orders[-1] * a))
    s, weight = 0.25 * np.pi * (s + 1), 0.25 * np.pi * weight
    rho = a * np.sin(s)
    cos = np.sqrt(1 - rho**2)
    area = weight * a * np.cos(s) * rho / cos  # sin θ dθ
    if kind == "hertz":
        pressure = np.cos(s)
        sigma, tau = -pressure * cos, pressure * rho
    elif kind == "uniform":
        sigma, tau = -np.ones_like(rho), np.zeros_like(rho)
    else:
        raise ValueError(f"kind = {kind}, expected one of {', '.join(KINDS)}")
    force = -2 * np.pi * np.sum((sigma * cos - tau * rho) * area)
    radial, shear = np.zeros(orders.size), np.zeros(orders.size)
    for i, (n, P, D) in enumerate(_even_legendre(cos, orders)):
        radial[i] = (2 * n + 1) * np.sum(sigma * P * area)
        shear[i] = -(2 * n + 1) / max(n * (n + 1), 1) * np.sum(tau * rho * D * area)
    return radial / force, shear / force


def _constants(n, radial, shear, nu):
    """A and B of each order n >= 2, in units of 1/2G, from its traction on r = 1."""
    n = n.astype(float)
    sA, sB = (n + 1) * (n**2 - n - 2 - 2 * nu), n * (n - 1)
    qA, qB = n**2 + 2 * n - 1 + 2 * nu, n - 1
    det = sA * qB - sB * qA
    return (radial * qB - shear * sB) / det, (shear * sA - radial * qA) / det


def _even_legendre(x, orders):
    """Yield n, Pₙ(x) and dPₙ/dx for the even ``orders`` from 0 on."""
    P, D = np.ones_like(x), np.zeros_like(x)
    before, last = np.zeros_like(x), orders[-1]
    for n in range(last + 1):
        if n % 2 == 0:
            yield n, P, D
        before, P, D = P, ((2 * n + 1) * x * P - n * before) / (n + 1), x * D + (n + 1) * P
