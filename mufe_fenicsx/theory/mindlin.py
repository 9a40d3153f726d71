"""Two elastic spheres pressed together and then sheared, with partial slip.

Notation: P normal force, Q tangential force, μ friction, a contact radius, and the
tangential compliance of both bodies S = Σ (2 - ν)/G [1/Pa]. A rigid body adds 0.

Assumed: small contact in half-spaces; friction acts against Q everywhere, although slip
has a small component across (Johnson 1985, section 7.2); tangential traction does not
change the pressure, which is exact for like materials, or where Σ ± (1 - 2ν)/G = 0.

Sources: R. D. Mindlin, J. Appl. Mech. 16, 1949, 259-268; R. D. Mindlin, H. Deresiewicz,
J. Appl. Mech. 20, 1953, 327-344; K. L. Johnson, Contact Mechanics, 1985, sections 7.2-7.4.
"""

import numpy as np


def tangential_compliance(*bodies):
    """S = Σ (2 - ν)/G [1/Pa] of deformable bodies, each a pair (E [Pa], ν)."""
    return sum((2 - nu) * 2 * (1 + nu) / E for E, nu in bodies)


def stick_stiffness(a, S):
    """dQ/dδ = 8a/S without slip [N/m]; Johnson 1985, section 7.2."""
    return 8 * a / S


def displacement(Q, P, mu, a, S):
    """First loading: δ = (3μP/16a) S [1 - (1 - Q/μP)^⅔] [m]; Johnson, section 7.2."""
    return 3 * mu * P / (16 * a) * S * (1 - (1 - Q / (mu * P)) ** (2 / 3))


def stick_radius(Q, P, mu, a):
    """c = a (1 - Q/μP)^⅓ [m] on first loading; Johnson, section 7.2."""
    return a * np.cbrt(1 - Q / (mu * P))


def unloading(Q, largest, P, mu, a, S):
    """Displacement [m] on the way back from Q* = ``largest``.

        δ = (3μP/16a) S [2(1 - (Q* - Q)/2μP)^⅔ - (1 - Q*/μP)^⅔ - 1]

    Loading again from -Q* is the same curve turned about the origin.

    Source: Johnson 1985, section 7.4: the change of traction is that of first loading
    under twice the friction.
    """
    back = displacement(0.5 * (largest - Q), P, mu, a, S)
    return displacement(largest, P, mu, a, S) - 2 * back


def energy_per_cycle(largest, P, mu, a, S):
    """Work lost in a closed cycle between ±Q*, q = Q*/μP [J].

        ΔW = (9μ²P²/10a) S {1 - (1-q)^{5/3} - (5q/6)[1 + (1-q)^⅔]}

    It tends to μ²P² S q³/36a for small q.

    Source: Johnson 1985, section 7.4; it is the area between the two curves of
    :func:`unloading`.
    """
    q = largest / (mu * P)
    bracket = 1 - (1 - q) ** (5 / 3) - 5 * q / 6 * (1 + (1 - q) ** (2 / 3))
    return 9 * (mu * P) ** 2 / (10 * a) * S * bracket


def history(approach, shift, R, E, S, mu, num_springs=2000):
    """Forces along any path of the approach and of the tangential displacement.

    The tangential tractions of these contacts are μ times differences of two normal
    contacts, of the present radius and of smaller ones (J. Jäger, Arch. Appl. Mech. 65,
    1995, 478-487; M. Ciavarella, Int. J. Solids Struct. 35, 1998, 2349-2362). A bed of
    independent springs obeys the same rule, whatever the path: at the distance x from
    the middle of a line, stiffness E* dx and (4/S) dx, gap x²/R, Coulomb's law in each (V. L.
    Popov, M. Heß, Method of Dimensionality Reduction, 2015, chapter 5).

    Args:
        approach: Normal approach at the points of the path [m], shape (n,), from contact 0.
        shift: Tangential displacement [m], shape (n,).
        R: Effective radius [m].
        E: Effective modulus E* [Pa].
        S: Tangential compliance [1/Pa].
        mu: Coefficient of friction.
        num_springs: Springs on half the line.

    Returns:
        P and Q [N], shape (n,), and the work that friction took up to there [J], shape (n,).
    """
    approach, shift = np.asarray(approach, float), np.asarray(shift, float)
    half = np.sqrt(R * approach.max())
    # Springs of even load rather than even distance: the edge matters most.
    edges = half * np.sin(0.5 * np.pi * np.linspace(0, 1, num_springs + 1))
    x, dx = 0.5 * (edges[1:] + edges[:-1]), 2 * np.diff(edges)
    kt = 4 / S * dx
    stretch = np.zeros(num_springs)
    P, Q, lost = np.zeros_like(approach), np.zeros_like(approach), np.zeros_like(approach)
    before = 0.0
    for i in range(approach.size):
        normal = E * dx * np.maximum(approach[i] - x**2 / R, 0.0)
        trial = stretch + (shift[i] - before if i else 0.0)
        limit = mu * normal / kt
        after = np.clip(trial, -limit, limit)
        # Mean force over the step times the slip.
        lost[i] = (lost[i - 1] if i else 0.0) + (
            0.5 * kt * (stretch + after) * (trial - after)
        ).sum()
        stretch, before = after, shift[i]
        P[i], Q[i] = normal.sum(), (kt * stretch).sum()
    return P, Q, lost
