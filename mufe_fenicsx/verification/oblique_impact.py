"""Elastic balls that meet obliquely, with friction."""

import math
from dataclasses import dataclass, replace

import numpy as np

from ..materials.elastic import Elastic
from ..theory import oblique_impact as theory
from ..theory.ball_impact import ball_law
from ..theory.impact import DURATION
from .case import case, compare
from .collide import Balls, Impacts

QUARTZ, RADIUS = Elastic(100e9, 0.15, 2650.0), 1e-3
GRAZING = math.tan(math.radians(85.0))


@dataclass(frozen=True)
class Rebound:
    """Impacts on a plane first, then those of pairs; arrays of shape (num_impacts,)."""

    psi1: np.ndarray  #: angle of incidence κ v/(μ V) [-]
    psi2: np.ndarray  #: angle of rebound, the same velocity after [-]
    spin: np.ndarray  #: change of the rate of turning, R Δω/(μ V) [-]
    kinetic: np.ndarray  #: kinetic energy of the rigid motion after over before [-]
    gain: float  #: largest sum of all energies over the first kinetic one, less 1
    chi: float  #: inertia parameter of the ball's mesh
    gyration: float  #: its I/(m R²)
    balls: Balls


def rebound(
    comm, on_plane=(), on_ball=(), *, a_over_R=0.04, friction=0.2, elements_per_radius=2.0,
    growth=0.3, material=QUARTZ, radius=RADIUS, **options,
):  # fmt: skip
    """Throw balls at a plane, and at each other. Collective, on at most as many ranks as balls.

    Args:
        comm: MPI communicator.
        on_plane, on_ball: (ψ₁, part of it by spin) of each impact.
        a_over_R: Largest contact radius over that of the balls; it sets the normal speed.
        friction: Coefficient of friction.
        elements_per_radius: Contact radius over the length of edges there.
        growth: Growth of the element size with the distance from the contact.
        material, radius: Of the balls [m].
        options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`.

    Returns:
        :class:`Rebound`.
    """
    nu, modulus = material.nu, material.contact_modulus
    delta, mass = a_over_R**2 * radius, 4 / 3 * math.pi * radius**3 * material.rho
    # Hertz's impact with this approach.
    speed = math.sqrt(16 / 15 * math.sqrt(radius) * modulus * delta**2.5 / mass)
    unit = friction * speed / theory.tangential_ratio(nu)  # velocity at ψ = 1
    a = a_over_R * radius
    impacts = Impacts(
        radius, a, a / elements_per_radius, speed,
        on_plane=tuple((psi * unit, spun) for psi, spun in on_plane),
        on_ball=tuple((psi * unit, spun) for psi, spun in on_ball),
        friction=friction, growth=growth, h_max=0.25,
    )  # fmt: skip
    balls = Balls(comm, impacts, material, **options)
    before = balls.rigid_motion()
    gain = balls.run(1.05 * DURATION * delta / speed, every=10**9)[2][:, 1].max() - 1
    after = balls.rigid_motion()
    turned = (after.spin - before.spin) @ balls.frame[2]
    return Rebound(
        psi1=balls.contact_velocity(before) / unit,
        psi2=balls.contact_velocity(after) / unit,
        spin=balls.of_impacts(turned) * balls.arm / (friction * speed),
        kinetic=balls.of_impacts(after.kinetic()) / balls.of_impacts(before.kinetic()),
        gain=float(gain),
        chi=theory.inertia_parameter(nu, balls.gyration),
        gyration=balls.gyration,
        balls=balls,
    )


def rebound_theory(psi1, chi, nu=None, a_over_R=None):
    """ψ₂ of each ψ₁ by Maw, Barber and Fawcett; of whole balls where ν and a/R are given."""
    law = None if a_over_R is None else ball_law(nu, a_over_R)
    return np.array([theory.oblique_impact(p, chi, law=law).psi2 for p in np.atleast_1d(psi1)])


@case("oblique-impact", num_bodies=3)
def oblique_impact(
    comm, elements_per_radius=2.0, a_over_R=0.04, nu=0.15, plane_nu=0.45, friction=0.2,
    growth=0.3, num_angles=6, time_step_factor=0.9,
):  # fmt: skip
    """Balls meet obliquely, from stick to full slip and grazing: the rebound of Maw et al. 1976.

    That theory assumes that pressure moves nothing along the surface, as between two like
    balls. On a rigid plane it does, by Dundurs' β: at ν = 0.15 and friction 0.2, ψ₂
    is 0.2 lower at ψ₁ = 1 and 0.2 higher at ψ₁ = 5 on a plane than on a ball. So the balls that
    meet the plane have another ν, near 0.5, where β = 0.09. Angles and spin are of the
    rigid motion with the nodes' momenta; inertia and lever arm are the mesh's.

    Half-spaces take contacts for small: whole balls are softer along the surface, and
    stiffer across, by some a/R each (theory.ball_impact), which lowers ψ₂ by up to 0.1
    where they stick.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there.
        a_over_R: Largest contact radius over that of the balls; it sets the normal speed.
        nu: Poisson's ratio of the balls that meet each other.
        plane_nu: That of those that meet the plane.
        friction: Coefficient of friction. Above 0.3 the line of centres of two balls turns
            too far while they slip; below 0.1 the mesh's centre of mass, off by 1e-4 R, counts.
        growth: Growth of the element size with the distance from the contact.
        num_angles: How many of the six angles of balls, and of the three of the plane.
        time_step_factor: Time step over the limit of stability.
    """
    options = {
        "a_over_R": a_over_R,
        "friction": friction,
        "elements_per_radius": elements_per_radius,
        "growth": growth,
        "time_step_factor": time_step_factor,
    }
    angles = (3.0, 1.0, 5.0, 2.0, 4.0, 0.5)[:num_angles]
    grazing = GRAZING / friction * theory.tangential_ratio(nu)
    balls = rebound(
        comm, on_ball=(*((psi, 0.0) for psi in angles), (3.0, 1.0), (grazing, 0.0)),
        material=replace(QUARTZ, nu=nu), **options,
    )  # fmt: skip
    names = [f"psi1 = {psi:g}" for psi in angles] + ["psi1 = 3 by spin"]
    # Two balls that graze pass each other: there is no theory for their angle.
    results = _compare(balls, "balls", names, nu, a_over_R)

    angles = (2.0, 1.0, 3.0)[:num_angles]
    grazing = GRAZING / friction * theory.tangential_ratio(plane_nu)
    plane = rebound(
        comm, on_plane=(*((psi, 0.0) for psi in angles), (8.0, 0.0), (grazing, 0.0)),
        material=replace(QUARTZ, nu=plane_nu), **options,
    )  # fmt: skip
    names = [f"psi1 = {psi:g}" for psi in angles] + ["full slip", "grazing"]
    results |= _compare(plane, "plane", names, plane_nu, a_over_R)
    return results, [balls.balls.simulation, plane.balls.simulation]


def _compare(found, partner, names, nu, a_over_R):
    psi1 = found.psi1[: len(names)]
    half = rebound_theory(psi1, found.chi)
    whole = rebound_theory(psi1, found.chi, nu, a_over_R)
    # 5 % of the deepest reversal, and of the spin that full slip gives.
    reversal = -rebound_theory(np.linspace(2.0, 4 * found.chi - 1, 12), found.chi).min()
    slipped = theory.spin_change(4 * found.chi, 0.0, nu, found.gyration)
    results = {}
    for k, name in enumerate(names):
        label = f"{partner}, {name}"
        spin = theory.spin_change(psi1[k], whole[k], nu, found.gyration)
        results[f"{label}: rebound"] = compare(found.psi2[k], whole[k], 0.05, scale=reversal)
        # Finite size is in this one: that of the theory for whole balls is added.
        results[f"{label}: rebound, half-spaces"] = compare(
            found.psi2[k], half[k], 0.05 + abs(whole[k] - half[k]) / reversal, scale=reversal
        )
        results[f"{label}: spin"] = compare(found.spin[k], spin, 0.05, scale=slipped)
    # Friction only takes energy: all impacts, those that graze too. The target of the method.
    results[f"{partner}: kinetic energy gained by an impact"] = compare(
        max(found.kinetic.max() - 1, 0.0), 0.0, 1e-3, scale=1.0
    )
    results[f"{partner}: energy gained"] = compare(max(found.gain, 0.0), 0.0, 1e-3, scale=1.0)
    return results
