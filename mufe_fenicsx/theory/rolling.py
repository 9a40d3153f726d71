"""Elastic spheres that roll on each other.

Without adhesion and with elastic bodies the pressure is even about the middle of the contact:
no moment resists rolling. A tangential force Q makes them creep: over the way rolled
they lose the part ξ of it. Like bodies of shear modulus G and Poisson's ratio ν, contact
radius a, normal force P, friction μ.
"""

import numpy as np

#: Poisson's ratios and coefficients C11 and C22 of a circular contact.
#: Source: J. J. Kalker, On the Rolling Contact of Two Elastic Bodies in the Presence of Dry
#: Friction, thesis, Delft 1967; to three figures.
KALKER = np.array([[0.0, 3.40, 3.40], [0.25, 4.12, 3.67], [0.5, 5.20, 3.98]])


def kalker_coefficient(nu, lateral=False):
    """C of Q = C G a² ξ, the limit of small creep; the parabola through Kalker's three values."""
    return float(np.polyval(np.polyfit(KALKER[:, 0], KALKER[:, 2 if lateral else 1], 2), nu))


def johnson_creep(Q, P, mu, a, G, nu):
    """Creep along the way of rolling.

        ξ = (3μP (4 - 3ν)/16Ga²) [1 - (1 - Q/μP)^⅓]

    Approximate: the stick area is taken as a circle that touches the leading edge, and slip
    is not everywhere against the traction. At small Q it has Q = 16/(4 - 3ν) G a² ξ, which
    is 19 % above Kalker's exact coefficient for ν = 0.25.

    Source: K. L. Johnson, J. Appl. Mech. 25, 1958, 339-346; Contact Mechanics, 1985, (8.46).
    """
    return 3 * mu * P * (4 - 3 * nu) / (16 * G * a**2) * (1 - np.cbrt(1 - Q / (mu * P)))


def creep_force(xi, P, mu, a, G, nu):
    """Q [N] at the creep ξ: Johnson's law with Kalker's coefficient.

        Q = μP [1 - (1 - τ/3)³],  τ = C11 G a² ξ/μP <= 3

    Exact to first order; at larger creep a few per cent from numerical solutions.

    Source: Z. Y. Shen, J. K. Hedrick, J. A. Elkins, Proc. 8th IAVSD Symposium, 1984, 591-605;
    P. J. Vermeulen, K. L. Johnson, J. Appl. Mech. 31, 1964, 338-340.
    """
    tau = np.clip(kalker_coefficient(nu) * G * a**2 * xi / (mu * P), -3.0, 3.0)
    return np.sign(tau) * mu * P * (1 - (1 - np.abs(tau) / 3) ** 3)
