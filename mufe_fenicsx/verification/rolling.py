"""Two elastic balls that roll on each other, freely and with creep."""

import math

import numpy as np

from ..materials.elastic import Elastic
from ..theory import hertz
from ..theory import rolling as theory
from .build import drive
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
    material = Elastic(E, nu, RHO)
    s_free, (force, along, moment, a) = _roll(
        comm, material, friction, 0.0, way, a_over_R, elements_per_radius, growth, periods
    )
    # Read after the start.
    later = slice(along.size // 4, None)
    Pa = force[later].mean() * a
    G = material.shear_modulus
    limit = friction * force[later].mean()
    creep = creep_over_sliding * limit / (theory.kalker_coefficient(nu) * G * a**2)
    s_creep, (force, traction, _, a) = _roll(
        comm, material, friction, creep, way, a_over_R, elements_per_radius, growth, periods
    )
    last = slice(3 * traction.size // 4, None)
    P = force[last].mean()
    expected = theory.creep_force(creep, P, friction, a, G, nu)
    johnson = _johnson_force(creep, P, friction, a, G, nu)
    coarse = max(3.0 / elements_per_radius, 1.0)
    results = {
        # What a mesh adds: its facets tilt the pressure to and fro as they pass.
        "free rolling: mean moment over Pa": compare(
            moment[later].mean() / Pa, 0.0, 0.05 * coarse, scale=1.0
        ),
        "free rolling: largest moment over Pa": compare(
            np.abs(moment[later]).max() / Pa, 0.0, 0.05 * coarse, scale=1.0
        ),
        "free rolling: mean traction over μP": compare(
            along[later].mean() / limit, 0.0, 0.05 * coarse, scale=1.0
        ),
        "creep: traction, Kalker [N]": compare(abs(traction[last].mean()), expected, 0.05 * coarse),
        # Johnson's circle of stick overestimates the traction by a fifth at small creep.
        "creep: Johnson 1958 over Kalker": compare(johnson / expected, 1.0, 0.2),
    }
    return results, [s_free, s_creep]


def _roll(comm, material, friction, creep, way, a_over_R, elements_per_radius, growth, periods):
    """Press and roll.

    Returns:
        The simulation; normal force [N], traction [N], rolling moment [N m], each of
        shape (num_records,), and the contact radius by Hertz [m].
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
    rows, every = [], max(int(duration / s.dt / 400), 1)

    def record():
        if s.state.num_steps % every == 0:
            rows.append(_contact_load(s))

    turns = {
        "top": (1 + 0.5 * creep) * angle * ACROSS,
        "low": -(1 - 0.5 * creep) * angle * ACROSS,
    }
    drive(s, {}, duration, at_step=record, turns=turns)
    force, traction, moment = np.array(rows).T
    modulus = hertz.effective_modulus((E, material.nu), (E, material.nu))
    a = (0.75 * force.mean() * radius / modulus) ** (1 / 3)
    return s, (force, traction, moment, a)


def _contact_load(s):
    """What the lower ball receives at the contact. Collective.

    Normal force [N], force along the way [N] and moment about the axis of rolling through
    the middle of the contact [N m], from the contact forces themselves: without the
    inertia of the bodies that turn.
    """
    p = s.contact.pairs
    on = np.flatnonzero(p.closed)
    point = p.node[on]
    force = p.push[on, None] * p.normal[on] + p.shear[on]
    # On the lower ball's points, and the opposite of that on the upper one's.
    force *= np.where(s.contact.points.grain_of_point[point] == 0, 1.0, -1.0)[:, None]
    # The couple of gap and friction included, both sides have the same moment about any point.
    moment = np.cross(s.contact.positions.array[point], force)
    total, turning = s.comm.allreduce(np.array([force.sum(axis=0), moment.sum(axis=0)]))
    middle = 0.5 * (s.walls.point[0] + s.walls.point[1])
    turning = turning - np.cross(middle, total)
    return -(FRAME @ total)[2], (FRAME @ total)[0], (FRAME @ turning)[1]


def _johnson_force(creep, P, mu, a, G, nu):
    """Traction at which Johnson's creep is ``creep`` [N]."""
    largest = theory.johnson_creep(mu * P, P, mu, a, G, nu)
    return mu * P * (1 - (1 - min(creep / largest, 1.0)) ** 3)
