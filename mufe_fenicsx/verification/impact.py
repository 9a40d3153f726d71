"""An elastic ball that meets a rigid plane, and two that meet each other, head on."""

import math
import time
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..materials.elastic import Elastic
from ..materials.rigid import Rigid
from ..theory.ball_impact import ball_impact
from ..theory.impact import hertz_impact, part_above
from ..theory.sphere_modes import vibration_loss
from .case import case, compare
from .collide import Balls, Impacts

QUARTZ, RADIUS = Elastic(100e9, 0.15, 2650.0), 1e-3
SPEEDS = (10.0, 1.0, 0.1)
#: What meets what, in the order of the arrays below.
PARTNERS = ("plane", "ball")
#: Part of the largest force above which contact is timed.
LEVEL = 0.02


@dataclass(frozen=True)
class NormalImpact:
    """Course of the impacts on a plane and on a ball, the latter against the plane between."""

    time: np.ndarray  #: since the start [s], shape (num_samples,)
    force: np.ndarray  #: on the ball [N], shape (num_samples, 2)
    approach: np.ndarray  #: of its centre and the plane [m], shape (num_samples, 2)
    contact_time: np.ndarray  #: from the time above ``LEVEL`` [s], shape (2,)
    restitution: np.ndarray  #: speed after over speed before, shape (2,)
    gain: float  #: largest sum of all energies over the first kinetic one, less 1
    mass: float  #: of the ball's mesh [kg]
    processor_s: float  #: of the steps alone
    balls: Balls


def normal_impact(
    comm, speed, elements_per_radius=2.5, growth=0.3, material=QUARTZ, radius=RADIUS,
    increments=None, **options,
):  # fmt: skip
    """Let a ball fly against a plane, and two balls against each other at twice the speed.

    Collective, on at most 3 ranks.

    Args:
        comm: MPI communicator.
        speed: Against the plane [m/s].
        elements_per_radius: Contact radius over the length of edges there.
        growth: Growth of the element size with the distance from the contact.
        material, radius: Of the balls [m].
        increments: Number of implicit ones during the contact; None for time steps.
        options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`.

    Returns:
        :class:`NormalImpact`.
    """
    theory = hertz_impact(
        4 / 3 * math.pi * radius**3 * material.rho, radius, material.contact_modulus, speed
    )
    a = math.sqrt(theory.approach * radius)
    impacts = Impacts(
        radius, a, a / elements_per_radius, speed, on_plane=((0.0, 0.0),), on_ball=((0.0, 0.0),),
        growth=growth,
    )  # fmt: skip
    # Rigid balls take some twenty steps.
    records = {"every": 1 if isinstance(material, Rigid) else 2}
    if increments is not None:
        options |= {"increment": theory.time / increments, "spectral_radius": 0.8}
        records = {"every": 1, "check": 5}
    balls = Balls(comm, impacts, material, **options)
    began = time.process_time()
    t, velocity, energy = balls.run(1.05 * theory.time, **records)
    processor_s = time.process_time() - began
    # The ball on the plane, and the upper one of the pair.
    v = velocity[:, :2] @ balls.frame[0]
    mass = balls.rigid_motion().mass[:2]
    force = mass * np.gradient(v, t, axis=0)
    way = np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t)[:, None], axis=0)
    approach = -np.concatenate([np.zeros((1, 2)), way]) - balls.gap
    # Differences over one sample smear the course least.
    middle, means = 0.5 * (t[1:] + t[:-1]), mass * np.diff(v, axis=0) / np.diff(t)[:, None]
    times = [contact_time(middle, f) for f in means.T]
    return NormalImpact(
        time=t,
        force=force,
        approach=approach,
        contact_time=np.array(times),
        restitution=-v[-1] / v[0],
        gain=float(energy[:, 1].max() - 1),
        mass=float(mass[0]),
        processor_s=processor_s,
        balls=balls,
    )


def contact_time(time, force):
    """Time of contact [s]: that with a force above ``LEVEL``, over its part of Hertz's course.

    Below, single facets touch and leave again, and balls that ring touch once more in the end.

    Args:
        time: Increasing [s], shape (num_samples,).
        force: In any unit, compression positive, shape (num_samples,).
    """
    time, force = np.pad(time, 1, mode="edge"), np.pad(force, 1)
    level, peak = LEVEL * force.max(), force.argmax()
    below = np.flatnonzero(force <= level)
    before, after = below[below < peak][-1], below[below > peak][0]
    begin = np.interp(level, force[before : before + 2], time[before : before + 2])
    end = np.interp(level, force[after - 1 : after + 1][::-1], time[after - 1 : after + 1][::-1])
    return (end - begin) / part_above(LEVEL)


def impact_theory(mass, speed, material=QUARTZ, radius=RADIUS):
    """Hertz's impact, that of the whole ball, and the part of the energy left in vibrations."""
    modulus, nu = material.contact_modulus, material.nu
    return (
        hertz_impact(mass, radius, modulus, speed),
        ball_impact(mass, radius, modulus, nu, speed),
        vibration_loss(mass, radius, modulus, nu, material.rho, speed),
    )


@case("impact", num_bodies=3)
def impact(
    comm,
    elements_per_radius=2.5,
    growth=0.3,
    num_speeds=3,
    time_step_factor=0.9,
    integrator: Literal["explicit", "implicit"] = "explicit",
    increments=200,
):
    """A ball meets a rigid plane, and another ball, head on at 10, 1 and 0.1 m/s: Hertz's impact.

    Hertz takes the ball for a half-space with all of its mass far away; that of the whole ball
    (theory.ball_impact) leaves the error of the mesh. The mass is that of the
    mesh, whose facets cut off up to 3 % of the sphere. What the rebound loses to vibration
    comes from the ball's free modes (theory.sphere_modes).

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there.
        growth: Growth of the element size with the distance from the contact.
        num_speeds: How many of the three speeds; the last takes most of the time.
        time_step_factor: Time step over the limit of stability. Nodes meet the plane one
            by one, each slowly: up to 1 they gain 1e-6 of the energy at most, at 1.2 5e-4.
        integrator: Time steps, or increments of the generalised-α method.
        increments: How many of these during a contact.
    """
    implicit = {"increments": increments} if integrator == "implicit" else {}
    results, simulations = {}, []
    for speed in SPEEDS[:num_speeds]:
        found = normal_impact(
            comm, speed, elements_per_radius, growth, time_step_factor=time_step_factor, **implicit
        )
        simulations.append(found.balls.simulation)
        hertz, whole, loss = impact_theory(found.mass, speed)
        for k, partner in enumerate(PARTNERS):
            for name, value, of_hertz, theory in (
                ("contact time [s]", found.contact_time[k], hertz.time, whole.time),
                ("largest force [N]", found.force[:, k].max(), hertz.force, whole.force),
                (
                    "largest approach [m]",
                    found.approach[:, k].max(),
                    hertz.approach,
                    whole.approach,
                ),
            ):
                label = f"{speed:g} m/s on a {partner}: {name}"
                # The target of the method at this mesh.
                results[label] = compare(value, theory, 0.02)
                # Finite size is in this one: that of the theory for the whole ball is added.
                results[f"{label}, Hertz"] = compare(
                    value, of_hertz, 0.02 + abs(theory / of_hertz - 1)
                )
            # The target; vibration takes 1e-4 at most, and the mesh's own as much.
            results[f"{speed:g} m/s on a {partner}: restitution"] = compare(
                found.restitution[k], math.sqrt(1 - loss), 0.01
            )
        # The target of the method.
        results[f"{speed:g} m/s: energy gained"] = compare(
            max(found.gain, 0.0), 0.0, 1e-3, scale=1.0
        )
    return results, simulations
