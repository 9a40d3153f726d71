"""Rigid grains: free turning, rolling, impact, and together with grains that deform."""

import math

import numpy as np
from mpi4py import MPI

from ..contact.walls import Wall
from ..geometry.bodies.bulge import bulged_ball
from ..geometry.bodies.shapes import box, sphere, sphere_near_contact
from ..materials.rigid import Rigid
from ..materials.sand import SAND
from ..run.from_bodies import build, drive, sum_over_nodes
from ..theory import rigid as theory
from .case import at_least, case, compare
from .shrinking_box import press_four_balls

RADIUS = 1e-3
ROCK = Rigid(SAND.E, SAND.nu, SAND.rho)


@case("rigid-top", num_bodies=1)
def rigid_top(comm, turns=1000.0, steps_per_turn=100):
    """A free brick of three different moments tumbles: angular momentum, energy, period.

    It turns mostly about the middle axis, which is unstable, so it tumbles. Angular momentum
    is also summed over the motion of the nodes, with the masses of linear elements.

    Args:
        comm: MPI communicator.
        turns: Time over that of a turn at the first rate.
        steps_per_turn: Sets that rate.
    """
    points, cells = box((1e-3, 2e-3, 3e-3), (2, 3, 4))
    s = build(comm, [(points, cells)], ROCK, (0, 0, 0), (0, 0, 0), axes="")
    rigid, dt = s.rigid, s.dt
    omega = 2 * math.pi / (steps_per_turn * dt)
    spin = omega * np.array([0.02, 1.0, 0.03])
    s.state.v[:] = np.cross(spin, s.mesh.x - rigid.centre[0])
    rigid.set_velocity(s.state.v)
    L0, E0 = rigid.momentum[0].copy(), rigid.kinetic_energy(0.0)
    start = rigid.axes[0].T @ spin
    period = theory.turning_period(rigid.inertia[0], start)

    energies, rates, largest = [], [], 0.0
    num_steps = round(turns * steps_per_turn)
    for k in range(num_steps):
        s.step()
        rates.append(rigid.axes[0, :, 1] @ rigid.spin[0])
        energies.append(rigid.kinetic_energy(dt))
        if k % 1000 == 0:
            largest = max(largest, np.linalg.norm(_nodal_momentum(s) - L0))
    energies, rates = np.array(energies) / E0, np.array(rates)
    tenth = num_steps // 10
    drift = energies[-tenth:].mean() - energies[:tenth].mean()
    flips = np.flatnonzero((rates[1:] > 0) & (rates[:-1] <= 0))
    part = rates[flips] / (rates[flips] - rates[flips + 1])
    crossings = (flips + part) * dt
    # Second order: of the rates times the time step, squared.
    order = (2 * math.pi / steps_per_turn) ** 2
    results = {
        # Rounding of nodal positions and velocities; the momentum itself is never touched.
        "angular momentum of the nodes over its start": compare(
            largest / np.linalg.norm(L0), 0.0, 1e-12, scale=1.0
        ),
        "largest change of the energy": compare(np.abs(energies - 1).max(), 0.0, order, scale=1.0),
        # Tumbling is sampled unevenly in a tenth of the time.
        "drift of the energy": compare(drift, 0.0, 0.02 * order, scale=1.0),
        "period of tumbling [s]": compare(np.diff(crossings).mean(), period, order),
    }
    return results, [s]


def _nodal_momentum(s):
    """Angular momentum about the centre from the motion of the nodes, linear in the cells."""
    x, v = s.state.x[s.mesh.cells], s.state.v[s.mesh.cells]
    volume = np.linalg.det(x[:, 1:] - x[:, :1]) / 6
    x = x - s.rigid.centre[0]
    turning = np.cross(x, v).sum(axis=1) + np.cross(x.sum(axis=1), v.sum(axis=1))
    return ROCK.rho * volume @ turning / 20


@case("rigid-rolling", num_bodies=1)
def rigid_rolling(comm, element_size=0.1, indentation=0.02, friction=0.3, way=1.0):
    """A ball slides on a plane without turning, and ends rolling at 5/7 of its speed.

    A smooth plate holds it down. Friction slows the ball and turns it; what it loses before
    it rolls depends on no force.

    Args:
        comm: MPI communicator.
        element_size: Edge of the elements over the radius.
        indentation: Of the ball by each plane, over the radius.
        friction: Coefficient of friction with the lower plane.
        way: Of sliding over the radius; it sets the speed.
    """
    points, cells = sphere(1.0, element_size)
    points = RADIUS * bulged_ball(points, cells)
    up = np.eye(3)[2]
    gap = 1.001 * RADIUS
    walls = [Wall("low", -gap * up, up, friction=friction), Wall("top", gap * up, -up)]
    s = build(comm, [(points, cells)], ROCK, (0, 0, 0), (0, 0, 0), axes="", walls=walls,
              time_step_factor=0.3)  # fmt: skip
    rigid = s.rigid
    k = 1 / ROCK.layer(rigid.radius[0])
    mass = rigid.mass[0]
    depth = indentation * RADIUS
    normal = math.pi * RADIUS * k * depth**2
    # Pressed slowly against the period of the ball between the plates, 2 dF/dδ in all.
    beat = 2 * math.pi * math.sqrt(mass / (4 * math.pi * RADIUS * k * depth))
    press = gap - RADIUS + depth
    drive(s, {"low": press * up, "top": -press * up}, 20 * beat)
    g = friction * normal / mass
    speed = math.sqrt(49 / 12 * g * way * RADIUS)
    along = np.array([math.cos(0.4), math.sin(0.4), 0.0])
    s.state.v[:] += speed * along - s.state.v
    rigid.set_velocity(s.state.v)
    before = s.energies()
    start = s.state.t
    slide = 2 * speed / (7 * g)
    rows = []
    while s.state.t < start + 3 * slide:
        s.step()
        rows.append((s.state.t - start, rigid.velocity[0] @ along,
                     rigid.spin[0] @ np.cross(up, along) * RADIUS, s.wall_forces()[0]))  # fmt: skip
    time, velocity, turning, force = np.array(rows).T
    after = s.energies()
    last = time > 2 * slide
    expected = theory.speed_of_rolling(speed, mass, 0.4 * mass * RADIUS**2, RADIUS)
    early = (time > 0.2 * slide) & (time < 0.8 * slide)
    slowing = -np.polyfit(time[early], velocity[early], 1)[0]
    lost = before["kinetic"] - 0.5 * mass * (velocity[last].mean() ** 2) * 1.4
    results = {
        # What facets add: the ball's edges stand up and let it tip.
        "speed of rolling over the first": compare(
            velocity[last].mean() / speed, expected / speed, 0.03
        ),
        "rolling: rate of turning times R over speed": compare(
            turning[last].mean() / velocity[last].mean(), 1.0, 0.03
        ),
        "sliding: deceleration over μN/m": compare(
            slowing * mass / (friction * force[early].mean()), 1.0, 0.01
        ),
        # The foundation's force on a ball that the mesh approximates, by (h/a)².
        "sliding: normal force [N]": compare(force[early].mean(), normal, 0.1),
        "friction work over loss of kinetic energy": compare(
            (after["friction"] - before["friction"]) / lost, 1.0, 0.05
        ),
        "energy residual over the first energy": compare(
            (after["residual"] - before["residual"]) / before["kinetic"], 0.0, 1e-3, scale=1.0
        ),
    }
    return results, [s]


@case("rigid-impact", num_bodies=2)
def rigid_impact(comm, elements_per_radius=4.0, contact_radius=0.14, time_step_factor=0.15):
    """Two rigid balls meet head on: the force of their layers, time, momentum and energy.

    Args:
        comm: MPI communicator.
        elements_per_radius: Largest contact radius over the edges there.
        contact_radius: That radius over the balls'.
        time_step_factor: Time step over the limit of stability.
    """
    a = contact_radius * RADIUS
    way = np.array([0.6, 0.0, 0.8])
    bodies = []
    for side in (-1, 1):
        points, cells = sphere_near_contact(
            RADIUS, a / elements_per_radius, 0.3, -side * way, a / 1.2
        )
        bodies.append((points + 1.001 * side * RADIUS * way, cells))
    k = 0.5 / ROCK.layer(RADIUS)
    mass = 2 / 3 * math.pi * RADIUS**3 * ROCK.rho  # effective
    depth = a**2 / RADIUS
    speed = math.sqrt(math.pi / 3 * RADIUS * k * depth**3 / mass)
    _, force, duration = theory.foundation_impact(mass, 0.5 * RADIUS, k, speed)

    s = build(
        comm, bodies, ROCK, (0, 0, 0), (0, 0, 0), axes="", time_step_factor=time_step_factor,
        velocity=lambda _x, grain: np.where(grain == 0, 0.5, -0.5)[:, None] * speed * way,
    )  # fmt: skip
    mass_of_node = s.solid.mass[:, None]
    scale = sum_over_nodes(s, mass_of_node)[0] * speed
    largest, touching, worst, momentum = 0.0, [], 0.0, 0.0
    first = sum_over_nodes(s, mass_of_node * s.state.v)
    energy0 = s.initial_kinetic
    while s.state.t < 0.004 * RADIUS / speed + 1.5 * duration:
        s.step()
        f = comm.allreduce(float(np.abs(s.rigid.force @ way).max(initial=0.0)), op=MPI.MAX)
        largest = max(largest, f)
        if f > 0:
            touching.append(s.state.t)
        worst = max(worst, abs(s.energies()["residual"]) / energy0)
        now = sum_over_nodes(s, mass_of_node * s.state.v)
        momentum = max(momentum, np.linalg.norm(now - first) / scale)
    relative = _approach(s, way)
    coarse = max(4.0 / elements_per_radius, 1.0)
    switching = s.energies()["switching"] / energy0
    results = {
        # A paraboloid stands for the sphere, and facets for both: some (h/a)².
        "largest force [N]": compare(largest, force, 0.03 * coarse),
        "time of contact [s]": compare(touching[-1] - touching[0], duration, 0.05 * coarse),
        # But for what springs gain where points pass to other facets: the report's limit for that.
        "restitution": compare(relative / speed, math.sqrt(1.0 - switching), 1e-3),
        "switching over the first energy": compare(switching, 0.0, 0.01, scale=1.0),
        # Every force has its opposite: rounding.
        "momentum": compare(momentum, 0.0, 1e-12, scale=1.0),
        "energy": compare(worst, 0.0, 1e-3, scale=1.0),
    }
    return results, [s]


def _approach(s, way):
    """Speed at which the two balls part [m/s]. Collective."""
    sign = np.where(s.mesh.grains[s.rigid.grains] == 0, -1.0, 1.0)
    return s.comm.allreduce(float(sign @ (s.rigid.velocity @ way)))


@case("rigid-mix", num_bodies=4)
def rigid_mix(comm, element_size=0.4, speed=1.0, strain=0.02, friction=0.23, factor=0.6):
    """Two rigid and two elasto-plastic balls collide, spin and are compressed: energies add up.

    Args:
        comm: MPI communicator.
        element_size: Edge of the elements over the radius.
        speed: Speed of the first collision and of the platen [m/s].
        strain: Compression of the box.
        friction: Coefficient of friction, everywhere.
        factor: Time step over the limit of stability.
    """
    s, worst = press_four_balls(
        comm, [ROCK, SAND, ROCK, SAND], element_size, speed, strain, friction, factor, spin=1.0
    )
    e = s.energies()
    total = s.initial_kinetic + e["work"]
    stressed = [np.abs(s.state.deviator[s.mesh.grain_of_cell == g]).max() for g in s.rigid.grains]
    stretched = comm.allreduce(_stretch(s), op=MPI.MAX)
    results = {
        # The target of the method: 0.1 % of what was put in, at all times.
        "largest residual over work": compare(worst, 0.0, 1e-3, scale=1.0),
        "plastic part of the work, at least": at_least(e["plastic"] / total, 0.005),
        "friction part of the work, at least": at_least(e["friction"] / total, 0.005),
        "stress in rigid grains [Pa]": compare(
            comm.allreduce(max(stressed, default=0.0), op=MPI.MAX), 0.0, 0.0, scale=1.0
        ),
        # Rounding of positions of some mm.
        "change of distances in rigid grains over R": compare(stretched, 0.0, 1e-14, scale=1.0),
    }
    return results, [s]


def _stretch(s):
    """Largest change of the distance of two nodes in a row of a rigid grain, over R. Local."""
    worst = 0.0
    for b in range(s.rigid.num_grains):
        nodes = s.rigid.lists.of(b)
        before, now = (np.linalg.norm(np.diff(x[nodes], axis=0), axis=1)
                       for x in (s.mesh.x, s.state.x))  # fmt: skip
        worst = max(worst, float(np.abs(now - before).max()) / RADIUS)
    return worst
