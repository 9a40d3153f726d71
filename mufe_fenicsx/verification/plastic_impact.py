"""A ball that yields meets a rigid plane: restitution."""

import math
from dataclasses import dataclass

import numpy as np

from ..materials.j2 import J2
from ..theory import plastic_contact, plastic_impact
from ..theory.impact import hertz_impact
from .case import case, compare
from .collide import Balls, Impacts

E, RHO, RADIUS = 100e9, 2650.0, 1e-3
#: Thornton's limiting pressure over Y: where a ball with ν = 0.3 first yields, and of full
#: plasticity.
LOW, HIGH = 1.6, 2.8
#: Speeds over that of first yield.
SPEEDS = (100.0, 20.0, 5.0)
#: Up to here full plasticity is not passed and the bracket holds.
THORNTON_UP_TO = 20.0


@dataclass(frozen=True)
class Rebound:
    """Computed and expected restitution of one impact."""

    restitution: float  #: computed
    thornton: tuple  #: with the limiting pressures ``LOW`` Y and ``HIGH`` Y
    curve: tuple  #: from the curve of Jackson & Green, with an even and with Hertz's pressure
    gain: float  #: largest sum of all energies over the first kinetic one, less 1
    balls: Balls


@case("plastic-impact", num_bodies=1)
def impact_of_plastic_ball(
    comm, elements_per_radius=2.5, nu=0.3, E_over_Y=300.0, num_speeds=3, time_step_factor=0.9
):
    """A perfectly plastic ball meets a plane at 100, 20, 5 times the speed of first yield.

    Thornton's theory has one parameter, the limiting pressure: the restitution has to lie
    between those for 1.6 Y, first yield, and 2.8 Y, full plasticity. At 100 times the speed it
    is higher than both: a contact that is fully plastic spreads beyond a² = Rδ, which Thornton
    keeps. With force and radius of Jackson & Green and elastic unloading it is met at all
    speeds; pressure at the end lies between that of Hertz and an even one.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there, if all were elastic.
        nu: Poisson's ratio.
        E_over_Y: Young's modulus over yield stress.
        num_speeds: How many of the speeds; the last, slowest one takes most of the time.
        time_step_factor: Time step over the limit of stability.
    """
    results, simulations = {}, []
    for ratio in SPEEDS[:num_speeds]:
        found = rebound(
            comm, ratio, elements_per_radius, nu, E_over_Y, time_step_factor=time_step_factor
        )
        simulations.append(found.balls.simulation)
        name = f"{ratio:g} times the speed of yield: "
        if ratio <= THORNTON_UP_TO:
            nearest = float(np.clip(found.restitution, *found.thornton))
            # The target of the method's forces.
            results[name + "restitution, nearest of Thornton's"] = compare(
                found.restitution, nearest, 0.05
            )
        # The fit of force and radius is one to some percent; the two pressures are 5 % apart.
        results[name + "restitution, by the curve of Jackson & Green"] = compare(
            found.restitution, float(np.mean(found.curve)), 0.05
        )
        # The target of the method.
        results[name + "energy gained"] = compare(max(found.gain, 0.0), 0.0, 1e-3, 1.0)
    return results, simulations


def rebound(comm, ratio, elements_per_radius=2.5, nu=0.3, E_over_Y=300.0, **options):
    """Let a plastic ball fly against a plane. Collective, one rank.

    Args:
        comm: MPI communicator of one rank.
        ratio: Speed over V_y of Thornton with the limiting pressure ``LOW`` Y.
        elements_per_radius, nu, E_over_Y: As of the case.
        options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`.

    Returns:
        :class:`Rebound`.
    """
    Y = E / E_over_Y
    material = J2(E, nu, RHO, ((0.0, Y),))
    modulus = material.contact_modulus
    mass = 4 / 3 * math.pi * RADIUS**3 * RHO
    speed = ratio * plastic_impact.yield_speed(LOW * Y, modulus, mass, RADIUS)
    elastic = hertz_impact(mass, RADIUS, modulus, speed)
    a = math.sqrt(elastic.approach * RADIUS)
    # A plastic contact is wider; the fine region reaches 1.5 of this.
    impacts = Impacts(
        RADIUS, 1.15 * a, a / elements_per_radius, speed, on_plane=((0.0, 0.0),)
    )  # fmt: skip
    balls = Balls(comm, impacts, material, **options)
    # Loading takes longer than the elastic half, unloading less: 0.95 in all.
    _, velocity, energy = balls.run(1.3 * elastic.time, every=4)
    v = velocity[:, 0] @ balls.frame[0]
    # The mesh encloses the volume of the sphere but for its facets.
    mass = float(balls.rigid_motion().mass[0])
    return Rebound(
        restitution=float(-v[-1] / v[0]),
        thornton=tuple(
            float(plastic_impact.restitution(
                speed, plastic_impact.yield_speed(p * Y, modulus, mass, RADIUS)
            ))
            for p in (LOW, HIGH)
        ),
        curve=by_curve(0.5 * mass * speed**2, modulus, Y, nu),
        gain=float(energy[:, 1].max() - 1),
        balls=balls,
    )  # fmt: skip


def by_curve(energy, modulus, Y, nu):
    """Restitution by the curve of Jackson & Green, with an even and with Hertz's pressure."""
    delta = np.linspace(0, 1, 20001) ** 2 * 0.3 * RADIUS
    force, radius = plastic_contact.jackson_green(delta, RADIUS, modulus, Y, nu)
    return tuple(
        plastic_impact.restitution_by_curve(energy, delta, force, radius, modulus, profile)
        for profile in (plastic_impact.EVEN_PROFILE, plastic_impact.HERTZ_PROFILE)
    )
