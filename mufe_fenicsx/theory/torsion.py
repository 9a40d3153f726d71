"""Two elastic spheres pressed together and then twisted about their common normal.

β is the twist of one body of shear modulus G against the plane of contact; two like bodies
turn against each other by 2β. P normal force, μ friction, a contact radius.

Sources: J. L. Lubkin, J. Appl. Mech. 18, 1951, 183-187; H. Deresiewicz, J. Appl. Mech. 21,
1954, 52-56; K. L. Johnson, Contact Mechanics, 1985, sections 3.9 and 7.5.
"""

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import elliprd


def stick_moment(beta, a, G):
    """M = (16/3) G a³ β without slip [N m]; Johnson 1985, section 3.9."""
    return 16 / 3 * G * a**3 * beta


def sliding_moment(P, mu, a):
    """M = 3π μPa/16 where all slips: ∫ μ p r dA with Hertz's pressure [N m]."""
    return 3 * np.pi / 16 * mu * P * a


def _difference(ratio):
    """K(k) - E(k), k² = 1 - ratio²: k²/3 R_D(0, ratio², 1), to rounding at both ends.

    Source: B. C. Carlson, NIST Handbook, 2010, eq. (19.25.1).
    """
    ratio = np.asarray(ratio, float)
    return (1 - ratio) * (1 + ratio) / 3 * elliprd(0.0, ratio**2, 1.0)


def twist(ratio, P, mu, a, G):
    """β where the stick radius is c = ``ratio`` a.

        β = (3μP/4πGa²) [K(k) - E(k)],  k² = 1 - c²/a²

    with complete elliptic integrals of modulus k.

    Source: Lubkin 1951; derived again here. The traction is a sum of rigid discs of radii
    c to a, each turned by dβ and carrying (4G/π) r dβ/√(s² - r²); Abel's equation gives
    them from q = μp in the annulus that slips.
    """
    return 3 * mu * P / (4 * np.pi * G * a**2) * _difference(ratio)


def moment(ratio, P, mu, a):
    """M where the stick radius is c = ``ratio`` a: those discs, (16/3) G s³ dβ each [N m]."""

    def part(s):
        return s**2 * _difference(s) if s**2 > 0 else 0.0

    rest = quad(part, ratio, 1.0)[0]
    return 4 / np.pi * mu * P * a * (ratio * part(ratio) + 3 * rest)


def moment_of_twist(beta, P, mu, a, G):
    """M at the twist β on first loading [N m], odd in β."""
    size = abs(beta)
    if size == 0.0:
        return 0.0
    # β grows like ln(a/c), and what is missing to sliding falls like c³.
    if size >= twist(1e-6, P, mu, a, G):
        return float(np.sign(beta) * sliding_moment(P, mu, a))
    ratio = brentq(lambda c: twist(c, P, mu, a, G) - size, 1e-6, 1.0, xtol=1e-14)
    return float(np.sign(beta) * moment(ratio, P, mu, a))
