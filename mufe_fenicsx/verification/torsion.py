"""Two elastic balls pressed together and twisted about their normal, with partial slip."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..materials.elastic import Elastic
from ..run.from_bodies import drive
from ..theory import hertz
from ..theory import torsion as theory
from .case import case, compare
from .half_balls import FRAME, UP, HalfBalls, low_load

E, RHO, RADIUS = 100e9, 2650.0, 1e-3
HEIGHT = 0.3
#: Static increments of half a cycle.
INCREMENTS = 40


@case("torsion", num_bodies=2)
def torsion(
    comm,
    elements_per_radius=5.0,
    a_over_R=0.015,
    nu=0.15,
    friction=0.3,
    ratio=0.75,
    growth=0.3,
    periods=32.0,
    integrator: Literal["explicit", "static"] = "explicit",
):
    """Elastic ball on elastic ball, twisted to and fro and until it slides: Lubkin, Deresiewicz.

    Two caps on rigid platens; what the finite caps yield beyond half-spaces is of the order
    (a/R)³. At constant approach the upper one is turned to ``ratio`` of the moment of
    sliding, back to its opposite, and on until all slips.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there.
        a_over_R: Contact radius over that of the balls.
        nu: Poisson's ratio.
        friction: Coefficient of friction.
        ratio: Moment at the turns over that of sliding.
        growth: Growth of the element size with the distance from the contact.
        periods: Duration of half a cycle over the period of a cap on its base.
        integrator: Time steps, or ``INCREMENTS`` static ones in half a cycle.
    """
    t = twist_balls(
        comm, elements_per_radius, a_over_R, nu, friction, ratio, growth, periods, integrator
    )
    _, first, back, again, last = t.turns
    M, N = t.moment, t.normal
    error = np.abs(M - t.theory) / (2 * t.theory[first])
    # The moment that is reached, not the twist, is what the energy of a cycle hangs on.
    reached = 0.25 * (M[first] - 2 * M[back] + M[again])
    cycle = _energy_per_cycle(_twist_of_moment(reached, *t.contact), t.contact)
    coarse = max(5.0 / elements_per_radius, 1.0)
    results = {
        "stuck: moment over theory at 5 % of sliding": compare(t.stuck, 1.0, 0.05 * coarse),
        "moment of sliding [N m]": compare(
            M[last], theory.sliding_moment(*t.contact[:3]), 0.05 * coarse
        ),
        "curve, error over full range": compare(
            error[: again + 1].max(), 0.0, 0.05 * coarse, scale=1.0
        ),
        "friction per cycle [J]": compare(t.rubbed[again] - t.rubbed[first], cycle, 0.05 * coarse),
        "normal force, change over the cycle": compare(
            np.ptp(N[first : again + 1]) / t.contact[0], 0.0, 0.01, scale=1.0
        ),
    }
    return results, [t.simulation]


@dataclass(frozen=True)
class Twisted:
    """The course of two balls twisted to and fro; arrays of shape (num_records,)."""

    twist: np.ndarray  #: of one ball against the plane of contact [rad]
    moment: np.ndarray  #: about the normal [N m]
    theory: np.ndarray  #: moment at that twist [N m]
    normal: np.ndarray  #: normal force [N]
    rubbed: np.ndarray  #: friction work so far [J]
    turns: list  #: record at each turn of the path, and at its end
    stuck: float  #: moment over theory at 5 % of sliding
    contact: tuple  #: normal force [N], friction, contact radius [m], shear modulus [Pa]
    simulation: object


def twist_balls(
    comm, elements_per_radius, a_over_R, nu, friction, ratio, growth, periods,
    integrator="explicit",
):  # fmt: skip
    """Press and twist, as the case does, whose parameters these are. Collective.

    Returns:
        :class:`Twisted`.
    """
    material = Elastic(E, nu, RHO)
    G, radius = material.shear_modulus, 0.5 * RADIUS
    a = a_over_R * RADIUS
    balls = HalfBalls(RADIUS, HEIGHT * RADIUS, a, a / elements_per_radius, growth)
    omega = balls.frequency(material)
    half_cycle = periods * 2 * math.pi / omega
    s = balls.simulation(
        comm, material, friction, damping=0.5 * omega, time_step_factor=0.8,
        increment=half_cycle / INCREMENTS if integrator == "static" else None,
    )  # fmt: skip
    modulus = hertz.effective_modulus((E, nu), (E, nu))

    def contact(force):
        return force, friction, (0.75 * force * radius / modulus) ** (1 / 3), G

    approach = a**2 / radius
    drive(s, {"top": -approach * UP}, 0.3 * half_cycle)
    drive(s, {"top": 0 * UP}, 0.3 * half_cycle)
    pressed = contact(-low_load(s)[2])
    sliding = theory.sliding_moment(*pressed[:3])
    start = _moment(s)

    # Nearly stuck, and at rest.
    small = 0.05 * sliding / theory.stick_moment(1.0, pressed[2], G)
    drive(s, {}, 0.4 * half_cycle, turns={"top": 2 * small * UP})
    drive(s, {"top": 0 * UP}, 0.3 * half_cycle)
    stuck = (_moment(s) - start) / theory.moment_of_twist(small, *pressed)

    every = max(int(half_cycle / s.dt / 60), 1)
    angle, rows, turns = small, [], [0]
    largest, end = _twist_of_moment(ratio * sliding, *pressed), theory.twist(0.05, *pressed)

    def record():
        if s.state.num_steps % every == 0:
            lost = comm.allreduce(s.contact.dissipation.total)
            rows.append((_angle(s), _moment(s), -low_load(s)[2], lost))

    for target in (largest, -largest, largest, end):
        way = 2 * (target - angle)
        drive(s, {}, half_cycle, turns={"top": way * UP}, at_step=record)
        angle = target
        turns.append(len(rows) - 1)

    twist, moment, normal, rubbed = np.array(rows).T
    _, first, back, again, _ = turns
    meant = contact(normal[first : again + 1].mean())
    top = _loading(twist[[first]], meant)[0]
    expected = [
        _loading(twist[: first + 1], meant),
        top - 2 * _loading(0.5 * (twist[first] - twist[first + 1 : back + 1]), meant),
        -top + 2 * _loading(0.5 * (twist[back + 1 : again + 1] - twist[back]), meant),
        _loading(twist[again + 1 :], meant),
    ]
    return Twisted(
        twist=twist,
        moment=moment,
        theory=np.concatenate(expected),
        normal=normal,
        rubbed=rubbed,
        turns=turns,
        stuck=stuck,
        contact=meant,
        simulation=s,
    )


def _loading(twist, contact):
    """Moments on first loading [N m]."""
    return np.array([theory.moment_of_twist(b, *contact) for b in twist])


def _moment(s):
    """Moment about the normal that the lower platen receives [N m]. Collective."""
    _, torque = s.walls.loads(s.comm)
    return (FRAME @ torque[s.walls.names.index("low")])[2]


def _angle(s):
    """Twist of one ball [rad]: half of what the upper platen has turned about the normal."""
    turn = FRAME @ s.walls.rotation[s.walls.names.index("top")] @ FRAME.T
    return 0.5 * math.atan2(turn[1, 0], turn[0, 0])


def _twist_of_moment(M, force, friction, a, G):
    """Twist of one ball at the moment M on first loading [rad]."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if theory.moment(middle, force, friction, a) > M:
            low = middle
        else:
            high = middle
    return float(theory.twist(low, force, friction, a, G))


def _energy_per_cycle(largest, contact):
    """Area of the closed loop of both balls between ± ``largest`` [J], each turned by β."""
    beta = largest * np.cos(np.linspace(0, math.pi, 201))  # dense at the turns
    back = _loading([largest], contact)[0] - 2 * _loading(0.5 * (largest - beta), contact)
    # Moment against the twist 2β of both; the way back and the way forth.
    return 2 * abs(np.trapezoid(back - (-back[::-1]), beta))
