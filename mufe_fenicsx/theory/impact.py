"""Hertz impact: elastic bodies meet along the normal, without waves.

1/m = 1/m₁ + 1/m₂, R and E* as in :mod:`~mufe_fenicsx.theory.hertz`; a rigid body at rest has
1/m = 0. The approach δ of the centres follows m δ'' = -4/3 E* √R δ^(3/2), as long as
the contact lasts much longer than a period of the bodies' vibrations;
:mod:`~mufe_fenicsx.theory.ball_impact` says what this leaves out.

Source: K. L. Johnson, Contact Mechanics, 1985, section 11.4(a).
"""

import math
from dataclasses import dataclass

import numpy as np

#: v t_c/δ of the impact: ∫ 2 dz/√(1 - z^(5/2)) = 4/5 √π Γ(2/5)/Γ(9/10) = 2.9433.
DURATION = 0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9)


@dataclass(frozen=True)
class Impact:
    """An impact along the normal."""

    approach: float  #: largest approach of the centres δ [m]
    force: float  #: largest force [N]
    time: float  #: time of contact [s]


def hertz_impact(m, R, E, v):
    """Largest approach, largest force and time of contact.

        δ = (15 m v²/(16 √R E*))^(2/5),  F = 4/3 E* √R δ^(3/2),  t_c = 2.9433 δ/v

    so t_c = 2.868 (m²/(R E*² v))^(1/5), where 2.868 = 2.9433 (15/16)^(2/5).

    Args:
        m: Effective mass [kg].
        R: Effective radius [m].
        E: Effective modulus E* [Pa].
        v: Speed of approach [m/s].

    Source: Johnson 1985, eqs (11.21)-(11.24), which give 2.87.
    """
    delta = (15 * m * v**2 / (16 * math.sqrt(R) * E)) ** 0.4
    return Impact(delta, 4 / 3 * E * math.sqrt(R) * delta**1.5, DURATION * delta / v)


def part_above(level):
    """Part of the time of contact in which the force exceeds a part of its largest value.

    With the approach x over the largest one, the speed is √(1 - x^(5/2)) and the force x^(3/2), so

        1 - 2/2.9433 ∫₀^d dx/√(1 - x^(5/2)),  d = level^(2/3).

    Args:
        level: That part, at most 0.1, where the series has an error of 1e-6.

    Source: Johnson 1985, eq. (11.22).
    """
    d = level ** (2 / 3)
    return 1.0 - 2.0 * (d + d**3.5 / 7 + d**6 / 16) / DURATION


def loading(approach, force, num_steps=20000):
    """A mass runs into a spring and comes to rest, when the contact has the radius r = 1.

    In even steps of the angle sin⁻¹ r, which are even steps of time near the end.

    Args:
        approach, force: Functions of r; the approach from 0.
        num_steps: The error falls as its inverse, 3e-5 at 20000.

    Returns:
        r, approach and force by step, shape (num_steps + 1,); the work of the force; and the
        times ∫ dδ/√(1 - W/W_end), those of a start with unit speed.
    """
    r = np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, num_steps + 1))
    delta, F = approach(r), force(r)
    step = np.diff(delta)
    work = 0.5 * (F[1:] + F[:-1]) * step
    left = np.cumsum(work[::-1])[::-1]  # summed from the end, where little is left
    time = np.append(0.0, np.cumsum(step / np.sqrt((left - 0.5 * work) / left[0])))
    return r, delta, F, float(left[0]), time


def hertz_pulse(num_points=101):
    """Force over its largest value against time over the time of contact.

    With the approach z^(5/4) = sin s over its largest value:
    v t/δ = 4/5 ∫ sin(s)^(-1/5) ds and F = sin(s)^(6/5).

    Returns:
        time and force, shape (num_points,) each, symmetric, the points close at both ends.
    """
    y = np.linspace(0.0, (0.5 * np.pi) ** 0.8, (num_points + 1) // 2)
    time, force = _rise(y)
    time /= DURATION
    return np.append(time, 1 - time[-2::-1]), np.append(force, force[-2::-1])


def pulse_spectrum(phase):
    """∫ F cos ω(t - t_c/2) dt over F t_c of the Hertz pulse, ``phase`` = ω t_c.

    The size of its Fourier transform, since the pulse is even about its middle. It starts
    as t^(3/2), so the spectrum falls as phase^(-5/2), with zeros where start and end cancel.
    """
    x, weight = np.polynomial.legendre.leggauss(600)
    end = (0.5 * np.pi) ** 0.8
    # y = end z² takes the root out of the start.
    z = 0.5 * (x + 1)
    y = end * z**2
    time, force = _rise(y)
    s = y**1.25
    rate = _sinc_root(s) * end * z  # dt/dz times half of the interval of x
    phase = np.asarray(phase, dtype=float)
    cos = np.cos(np.multiply.outer(phase, time / DURATION - 0.5))
    return 2 * (cos @ (weight * force * rate)) / DURATION


def _rise(y):
    """v t/δ and F over its largest value while the force rises; y = s^(4/5)."""
    x, weight = np.polynomial.legendre.leggauss(40)
    y = np.asarray(y, dtype=float)
    inner = 0.5 * np.multiply.outer(y, x + 1)
    time = 0.5 * y * (_sinc_root(inner**1.25) @ weight)
    return time, np.sin(y**1.25) ** 1.2


def _sinc_root(s):
    """(s / sin s)^(1/5), 1 at zero."""
    return np.sinc(s / np.pi) ** -0.2
