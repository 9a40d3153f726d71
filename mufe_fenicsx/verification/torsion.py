"""Two elastic balls pressed together and twisted about their normal, with partial slip."""

import math

import numpy as np

from ..materials.elastic import Elastic
from ..theory import hertz
from ..theory import torsion as theory
from .build import drive
from .case import case, compare
from .half_balls import FRAME, UP, HalfBalls, low_load

E, RHO, RADIUS = 100e9, 2650.0, 1e-3
HEIGHT = 0.3


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
    """
    material = Elastic(E, nu, RHO)
    G, radius = material.shear_modulus, 0.5 * RADIUS
    a = a_over_R * RADIUS
    balls = HalfBalls(RADIUS, HEIGHT * RADIUS, a, a / elements_per_radius, growth)
    omega = balls.frequency(material)
    s = balls.simulation(comm, material, friction, damping=0.5 * omega, time_step_factor=0.8)
    half_cycle = periods * 2 * math.pi / omega

    approach = a**2 / radius
    drive(s, {"top": -approach * UP}, 0.3 * half_cycle)
    drive(s, {"top": 0 * UP}, 0.3 * half_cycle)
    force = -low_load(s)[2]
    modulus = hertz.effective_modulus((E, nu), (E, nu))
    a = (0.75 * force * radius / modulus) ** (1 / 3)
    sliding = theory.sliding_moment(force, friction, a)
    start = _moment(s)

    # Nearly stuck, and at rest.
    small = 0.05 * sliding / theory.stick_moment(1.0, a, G)
    drive(s, {}, 0.4 * half_cycle, turns={"top": 2 * small * UP})
    drive(s, {"top": 0 * UP}, 0.3 * half_cycle)
    stuck = (_moment(s) - start) / theory.moment_of_twist(small, force, friction, a, G)

    every = max(int(half_cycle / s.dt / 60), 1)
    angle, rows, turns = small, [], [0]
    largest = _twist_of_moment(ratio * sliding, force, friction, a, G)
    end = theory.twist(0.05, force, friction, a, G)

    def record():
        if s.state.num_steps % every == 0:
            lost = comm.allreduce(s.contact.dissipated)
            rows.append((_angle(s), _moment(s), -low_load(s)[2], lost))

    for target in (largest, -largest, largest, end):
        way = 2 * (target - angle)
        drive(s, {}, half_cycle, turns={"top": way * UP}, at_step=record)
        angle = target
        turns.append(len(rows) - 1)

    beta, M, N, lost = np.array(rows).T
    _, first, back, again, last = turns
    force = N[first : again + 1].mean()
    a = (0.75 * force * radius / modulus) ** (1 / 3)
    sliding = theory.sliding_moment(force, friction, a)

    def loading(beta):
        return np.array([theory.moment_of_twist(b, force, friction, a, G) for b in beta])

    top = loading(beta[[first]])[0]
    expected = np.concatenate(
        [
            loading(beta[: first + 1]),
            top - 2 * loading(0.5 * (beta[first] - beta[first + 1 : back + 1])),
            -top + 2 * loading(0.5 * (beta[back + 1 : again + 1] - beta[back])),
            loading(beta[again + 1 :]),
        ]
    )
    error = np.abs(M - expected) / (2 * top)
    # The moment that is reached, not the twist, is what the energy of a cycle hangs on.
    reached = 0.25 * (M[first] - 2 * M[back] + M[again])
    cycle = _energy_per_cycle(_twist_of_moment(reached, force, friction, a, G), loading)
    coarse = max(5.0 / elements_per_radius, 1.0)
    results = {
        "stuck: moment over theory at 5 % of sliding": compare(stuck, 1.0, 0.05 * coarse),
        "moment of sliding [N m]": compare(M[last], sliding, 0.05 * coarse),
        "curve, error over full range": compare(
            error[: again + 1].max(), 0.0, 0.05 * coarse, scale=1.0
        ),
        "friction per cycle [J]": compare(lost[again] - lost[first], cycle, 0.05 * coarse),
        "normal force, change over the cycle": compare(
            np.ptp(N[first : again + 1]) / force, 0.0, 0.01, scale=1.0
        ),
    }
    return results, [s]


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


def _energy_per_cycle(largest, loading):
    """Area of the closed loop of both balls between ± ``largest`` [J], each turned by β."""
    beta = largest * np.cos(np.linspace(0, math.pi, 201))  # dense at the turns
    back = loading([largest])[0] - 2 * loading(0.5 * (largest - beta))
    # Moment against the twist 2β of both; the way back and the way forth.
    return 2 * abs(np.trapezoid(back - (-back[::-1]), beta))
