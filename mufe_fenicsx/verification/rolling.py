"""Two elastic balls that roll on each other, freely and with creep."""

import math
from dataclasses import dataclass

import numpy as np

from ..materials.elastic import Elastic
from ..run.from_bodies import drive
from ..theory import hertz
from ..theory import rolling as theory
from .case import case, compare
from .half_balls import ACROSS, FRAME, UP, HalfBalls

E, RHO, RADIUS = 100e9, 2650.0, 1e-3


@case("rolling", num_bodies=2)
def rolling(
    comm,
    elements_per_radius=3.0,
    a_over_R=0.05,
    nu=0.25,
    friction=0.5,
    creep_over_sliding=0.3,
    way=8.0,
    growth=0.4,
    periods=24.0,
):
    """Elastic ball on elastic ball, rolling freely and with creep: moment, traction, Kalker.

    Two half balls turn about their centres, which stay, like gears: the contact stays too
    and its facets come and go. Rolling freely nothing resists in theory, so the moment is the
    error of the mesh. With one ball faster by the creep ξ the traction tends to Kalker's
    over a length of C11 G a² S, about 1.8 a of the way for the compliance S of two
    half-spaces, and is read in the last quarter of the way.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there.
        a_over_R: Contact radius over that of the balls.
        nu: Poisson's ratio.
        friction: Coefficient of friction.
        creep_over_sliding: C11 G a² ξ/μP, traction without slip over that of sliding.
        way: Way rolled over the contact radius.
        growth: Growth of the element size with the distance from the contact.
        periods: Duration of the way over the period of a half ball on its base.
    """
    options = a_over_R, elements_per_radius, growth, way, periods
    material = Elastic(E, nu, RHO)
    free = roll_balls(comm, material, friction, 0.0, *options)
    later = slice(free.traction.size // 4, None)  # after the start
    P = free.normal[later].mean()
    limit, G = friction * P, material.shear_modulus
    creep = creep_over_sliding * limit / (theory.kalker_coefficient(nu) * G * free.a**2)
    creeping = roll_balls(comm, material, friction, creep, *options)
    last = slice(3 * creeping.traction.size // 4, None)
    traction, contact = creeping.traction[last].mean(), creeping.normal[last].mean()
    contact = contact, friction, creeping.a, G, nu
    expected = theory.creep_force(creep, *contact)
    johnson = _johnson_force(creep, *contact)
    moment, along = free.moment[later] / (P * free.a), free.traction[later] / limit
    coarse = max(3.0 / elements_per_radius, 1.0)
    results = {
        # What a mesh adds: its facets tilt the pressure to and fro as they pass.
        "free rolling: mean moment over Pa": compare(moment.mean(), 0.0, 0.05 * coarse, scale=1.0),
        "free rolling: largest moment over Pa": compare(
            np.abs(moment).max(), 0.0, 0.05 * coarse, scale=1.0
        ),
        "free rolling: mean traction over μP": compare(along.mean(), 0.0, 0.05 * coarse, scale=1.0),
        "creep: traction, Kalker [N]": compare(abs(traction), expected, 0.05 * coarse),
        # Johnson's circle of stick overestimates the traction by a fifth at small creep.
        "creep: Johnson 1958 over Kalker": compare(johnson / expected, 1.0, 0.2),
    }
    return results, [free.simulation, creeping.simulation]


@dataclass(frozen=True)
class Rolled:
    """The course of two balls that roll on each other; arrays of shape (num_records,)."""

    way: np.ndarray  #: rolled so far [m]
    normal: np.ndarray  #: normal force [N]
    traction: np.ndarray  #: force along the way on the lower ball [N]
    moment: np.ndarray  #: about the axis of rolling through the middle of the contact [N m]
    a: float  #: contact radius by Hertz at the mean normal force [m]
    simulation: object


def roll_balls(
    comm, material, friction, creep, a_over_R, elements_per_radius, growth, way, periods
):
    """Press and roll, as the case does, whose parameters these are. Collective.

    Returns:
        :class:`Rolled`.
    """
    a, radius = a_over_R * RADIUS, 0.5 * RADIUS
    angle = way * a_over_R
    # Fine as far as the contact comes: half the way and its own radius.
    reach = (0.5 * way + 1.2) / 1.5 * a
    balls = HalfBalls(RADIUS, RADIUS, reach, a / elements_per_radius, growth, rolled=-0.5 * angle)
    omega = balls.frequency(material)
    s = balls.simulation(comm, material, friction, damping=0.3 * omega, time_step_factor=0.8)
    duration = periods * 2 * math.pi / omega
    drive(s, {"top": -(a**2) / radius * UP}, 0.3 * duration)
    drive(s, {"top": 0 * UP}, 0.2 * duration)

    # Damping resists the turning bodies, and the contact would carry a part of that.
    s.damping = 0.03 * omega
    rows, every, start = [], max(int(duration / s.dt / 400), 1), s.state.t

    def record():
        if s.state.num_steps % every == 0:
            rows.append((s.state.t, *_contact_load(s)))

    turns = {
        "top": (1 + 0.5 * creep) * angle * ACROSS,
        "low": -(1 - 0.5 * creep) * angle * ACROSS,
    }
    drive(s, {}, duration, at_step=record, turns=turns)
    time, normal, traction, moment = np.array(rows).T
    part = (time - start) / duration
    modulus = hertz.effective_modulus((E, material.nu), (E, material.nu))
    return Rolled(
        way=angle * RADIUS * (part - np.sin(2 * math.pi * part) / (2 * math.pi)),
        normal=normal,
        traction=traction,
        moment=moment,
        a=(0.75 * normal.mean() * radius / modulus) ** (1 / 3),
        simulation=s,
    )


def _contact_load(s):
    """What the lower ball receives at the contact. Collective.

    Normal force [N], force along the way [N] and moment about the axis of rolling through
    the middle of the contact [N m], from the contact forces themselves: without the
    inertia of the bodies that turn.
    """
    s.contact.ghosts.place_points()
    p = s.contact.pairs
    on = np.flatnonzero(p.closed)
    point = p.node[on]
    force = p.normal_force[on, None] * p.normal[on] + p.shear[on]
    # On the lower ball's points, and the opposite of that on the upper one's.
    force *= np.where(s.contact.points.grain_of_point[point] == 0, 1.0, -1.0)[:, None]
    # The couple of gap and friction included, both sides have the same moment about any point.
    moment = np.cross(s.contact.ghosts.positions.array[point], force)
    total, turning = s.comm.allreduce(np.array([force.sum(axis=0), moment.sum(axis=0)]))
    middle = 0.5 * (s.walls.point[0] + s.walls.point[1])
    turning = turning - np.cross(middle, total)
    return -(FRAME @ total)[2], (FRAME @ total)[0], (FRAME @ turning)[1]


def _johnson_force(creep, P, mu, a, G, nu):
    """Traction at which Johnson's creep is ``creep`` [N]."""
    largest = theory.johnson_creep(mu * P, P, mu, a, G, nu)
    return mu * P * (1 - (1 - min(creep / largest, 1.0)) ** 3)
