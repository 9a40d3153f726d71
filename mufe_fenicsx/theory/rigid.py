"""Rigid bodies: free turning, impact on an elastic foundation, and the ball that starts to roll."""

import math

from scipy.special import ellipk

#: Duration of an impact over δ/v: 2 ∫ dz/√(1 - z³) = 2 √π Γ(4/3)/Γ(5/6).
DURATION = 2 * math.sqrt(math.pi) * math.gamma(4 / 3) / math.gamma(5 / 6)


def turning_period(inertia, spin):
    """Period after which a free body's rates about its principal axes return [s].

    With J₁ < J₂ < J₃, 2E = Σ J ω², L² = Σ J² ω², and 1, 3 exchanged where L² < 2 E J₂:

        T = 4 K(m)/p,  p² = (J₃ - J₂)(L² - 2 E J₁)/(J₁J₂J₃),
        m = (J₂ - J₁)(2 E J₃ - L²)/((J₃ - J₂)(L² - 2 E J₁))

    Args:
        inertia: Principal moments in increasing order [kg m²], three different ones.
        spin: Rates about the principal axes at some time [rad/s].

    Source: L. D. Landau, E. M. Lifshitz, Mechanics, 3rd ed. 1976, section 37.
    """
    J1, J2, J3 = inertia
    twice_energy = sum(J * w**2 for J, w in zip(inertia, spin, strict=True))
    square = sum((J * w) ** 2 for J, w in zip(inertia, spin, strict=True))
    if square < twice_energy * J2:
        J1, J3 = J3, J1
    a, b = (J3 - J2) * (square - twice_energy * J1), (J2 - J1) * (twice_energy * J3 - square)
    return 4 * ellipk(b / a) / math.sqrt(a / (J1 * J2 * J3))


def foundation_impact(m, R, K, v):
    """Largest approach [m], largest force [N] and time [s] of an impact on an elastic foundation.

    Pressure K g at the depth g gives F = π R K δ² on a ball; m δ'' = -F.

        δ³ = 3 m v²/(2 π R K),  t_c = 2.804 δ/v

    Args:
        m: Effective mass [kg].
        R: Effective radius [m].
        K: Pressure over depth, 1/K the sum of both layers [Pa/m].
        v: Speed of approach [m/s].

    Source: K. L. Johnson, Contact Mechanics, 1985, eq. (4.48) for the force; energy.
    """
    delta = (1.5 * m * v**2 / (math.pi * R * K)) ** (1 / 3)
    return delta, math.pi * R * K * delta**2, DURATION * delta / v


def speed_of_rolling(v, mass, inertia, radius):
    """Speed at which a ball that slides with ``v`` without turning starts to roll [m/s].

    Angular momentum about any point of the plane is kept, whatever the friction:
    m v R = m V R + J V/R, 5/7 v for a solid ball.

    Args:
        v: Speed at the start [m/s].
        mass, inertia: [kg], and about the centre [kg m²].
        radius: [m].

    Source: L. D. Landau, E. M. Lifshitz, Mechanics, 3rd ed. 1976, sections 9 and 32.
    """
    return v / (1 + inertia / (mass * radius**2))
