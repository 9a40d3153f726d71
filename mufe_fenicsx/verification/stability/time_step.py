"""Time step: free, in contact, flattened, and a mass that meets a spring."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.walls import Wall
from ...explicit.simulation import Simulation
from ...geometry.bodies.shapes import box, cylinder, tetrahedron
from ...materials.elastic import Elastic
from ...materials.j2 import J2
from ...run.from_bodies import build, distribute, drive
from ...scene import Solver
from ...theory.stability import growth_per_step, rebound_speed
from ..case import case, compare
from .limits import (
    NEVER,
    NU,
    RHO,
    SIZE,
    E,
    Snapshot,
    bisect,
    dense_stiffness,
    fastest_mode,
    free_block,
    growth,
    highest_frequency,
    message_of,
    pressed_block,
    set_step,
    settle,
    steps_to_notice,
    tangent_stiffness,
)

#: Speeds after a blow over those before that count as a gain without bound: more than what a
#: mass can gain where (ω Δt)² < 2.
UNBOUND = 1.26


def flattened_block(comm, strain=0.5, divisions=3):
    """A soft plastic cube pressed to half its height between rough platens, then let go."""
    material = J2(E, NU, RHO, ((0.0, 5e-3 * E), (0.5, 2e-2 * E)))
    bodies = [box((SIZE,) * 3, (divisions,) * 3)]
    s = build(
        comm, bodies, material, np.zeros(3), np.full(3, SIZE), axes="z", refresh=50,
        wall_friction={"z_min": 0.5, "z_max": 0.5}, damping=0.1 * material.wave_speed / SIZE,
    )  # fmt: skip
    s.first_limit = s.dt / s.time_step_factor
    transit = SIZE / material.wave_speed
    drive(s, {"z_max": (0, 0, -strain * SIZE)}, 60 * transit)
    away = 0.5 * strain * SIZE
    drive(s, {"z_max": (0, 0, away), "z_min": (0, 0, -away)}, 20 * transit)
    s.damping = 5.0 * material.wave_speed / SIZE
    for _ in range(1500):
        s.step()
    s.damping, s.limit.schedule.steps = 0.0, NEVER
    s.state.v[:] = 0.0
    return s


def pressed_cylinder(comm, strain=1e-3, friction=1.0):
    """A cylinder at rest between platens, which press it out against a ring; it sticks to all."""
    material, radius, up = Elastic(E, 0.3, RHO), 0.5 * SIZE, np.eye(3)[2]
    walls = [
        Wall("bottom", np.zeros(3), up, friction),
        Wall("top", SIZE * up, -up, friction),
        Wall("ring", np.zeros(3), up, friction, radius=radius),
    ]
    s = build(
        comm, [cylinder(radius, SIZE, 0.4 * SIZE)], material, [-radius, -radius, 0.0],
        [radius, radius, SIZE], axes="", walls=walls, element="p1",
        damping=math.pi * material.wave_speed / SIZE,
    )  # fmt: skip
    drive(s, {"top": (0.0, 0.0, -strain * SIZE)}, 4 * SIZE / material.wave_speed)
    settle(s, 1e-18)
    s.damping, s.limit.schedule.steps = 0.0, NEVER
    s.state.v[:] = 0.0
    return s


def time_step_map(comm, factors=(), trials=14):
    """Limits of five bodies, and growth at ``factors`` times 2/ω.

    Returns:
        By name: exact 2/ω [s] with the springs and stresses that there are, the same of a body
        without stresses (``unstressed``), what the program estimates of that (Lanczos), √2/ω of
        springs, the bound of single elements, the measured limit, rates of growth of the fastest
        mode.
    """
    bodies = {
        "free, p1": free_block(comm),
        "free, averaged": free_block(comm, "averaged"),
        "in contact": pressed_block(comm),
        "in contact with a ring": pressed_cylinder(comm),
        "flattened": flattened_block(comm),
    }
    found = {}
    for name, s in bodies.items():
        contact = name.startswith("in contact")
        K = dense_stiffness(s, springs=contact)
        unstressed = 2.0 / fastest_mode(s, K)[0]
        omega, mode = fastest_mode(s, tangent_stiffness(s) if name == "flattened" else K)
        exact = 2.0 / omega
        start = Snapshot(s)
        s.update_time_step()
        lanczos = 2.0 / s.stable.highest()
        rates = [growth(s, start, factor * exact, mode=mode)[0] for factor in factors]
        measured = bisect(lambda f, s=s, a=start, e=exact: growth(s, a, f * e)[1], 0.5, 1.5, trials)
        springs = math.sqrt(2.0) / highest_frequency(s, bulk=False) if contact else math.inf
        found[name] = SimpleNamespace(
            simulation=s, exact=exact, unstressed=unstressed, lanczos=lanczos,
            element=s.dt_element, springs=springs,
            measured=measured * exact, rates=rates, first=getattr(s, "first_limit", None),
        )  # fmt: skip
    return found


def rebounds(comm, omega_dt, phases=16, compliance=1e-5):
    """Speeds of the tips of tetrahedra after they met a plane, over those before.

    The tip alone meets the plane, and its spring is so stiff that the tetrahedron does not feel
    it while that lasts: the tip is a mass on a spring.

    Args:
        comm: MPI communicator of one rank.
        omega_dt: √(k/m) Δt, shape (n,).
        phases: Tips that are found 1/phases, 2/phases, … 1 ways of a step deep.
        compliance: Of the layer of contact.

    Returns:
        Shape (n, phases), and the simulations.
    """
    points, cells = tetrahedron(SIZE)
    tip = points[0] / np.linalg.norm(points[0])
    down = _turn(tip, np.array([0.0, 0.0, -1.0]))
    points = points @ down.T
    points -= [0.0, 0.0, points[:, 2].min()]
    way, phase = 1e-6 * SIZE, (1 + np.arange(phases)) / phases
    bodies = [
        (points + np.array([3 * SIZE * k, 0.0, (2.0 - p) * way]), cells)
        for k, p in enumerate(phase)
    ]
    mesh = distribute(comm, bodies)
    material, up = Elastic(E, NU, RHO), np.eye(3)[2]
    lowest = mesh.x[:, 2] < 3 * way
    order = np.argsort(mesh.x[lowest, 0])
    tips = np.flatnonzero(lowest)[order]
    speeds, simulations = [], []
    for value in omega_dt:
        options = {"points": "nodes", "compliance": compliance, "refresh": NEVER, "element": "p1"}
        s = Simulation(mesh, [material] * phases, [Wall("floor", np.zeros(3), up)], **options)
        own, points = np.searchsorted(s.contact.own.nodes, tips), s.contact.points
        omega = np.sqrt(points.area[own] / points.layer[own] / s.solid.mass[tips])
        dt = float(value / omega.mean())
        s.state.v[:, 2] = -way / dt
        set_step(s, dt)
        speed = np.full(phases, np.nan)
        before = s.state.x[tips, 2].copy()
        for _ in range(4 + math.ceil(2 * math.pi / value)):
            s.step()
            now = s.state.x[tips, 2].copy()
            out = np.isnan(speed) & (now > 0) & (now > before)
            speed[out] = (now - before)[out] / way
            before = now
        speeds.append(speed)
        simulations.append(s)
    return np.array(speeds), simulations


def _turn(a, b):
    """Rotation that takes the unit vector ``a`` to ``b``."""
    v = np.cross(a, b)
    K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + K + K @ K / (1 + a @ b)


def rebound_limit(comm, trials=12):
    """ω Δt beyond which blows gain without bound: measured, and the simulations."""
    simulations = []

    def gains(value):
        speed, more = rebounds(comm, [value], 8)
        simulations.extend(more)
        return np.nanmax(speed) > UNBOUND

    return bisect(gains, 1.3, 1.8, trials), simulations


def rebound_limit_theory():
    """The same by :func:`~mufe_fenicsx.theory.stability.rebound_speed`: (ω Δt)² - 1 = UNBOUND."""
    return math.sqrt(1.0 + UNBOUND)


def messages(comm):
    """What the program says to steps beyond the limit."""
    refused = message_of(Solver, time_step_factor=1.0)
    s = free_block(comm, velocity=lambda x, _: 1e-3 * np.sin(5e3 * x))
    s.time_step_factor = 1.05  # which cannot be given
    s.update_time_step()
    steps, stopped = steps_to_notice(s)
    return {"refused": refused, "stopped": stopped, "steps": steps, "simulation": s}


@case("stability-time-step", num_bodies=1)
def time_step(comm, trials=10):
    """Central differences are stable up to 2/ω of the assembled system, in whatever state.

    Single elements bound it from below; a node that meets a spring asks for √2/ω of springs.

    Args:
        comm: MPI communicator.
        trials: Bisections.
    """
    results, simulations = {}, []
    found = time_step_map(comm, (1.2,), trials)
    for name, one in found.items():
        simulations.append(one.simulation)
        # Bisection between 0.5 and 1.5; noise has 600 steps to grow, for which 1e-4 more is enough.
        resolution = 1.5 * 2.0**-trials + 5e-3
        results[f"{name}: measured limit over 2/ω"] = compare(
            one.measured / one.exact, 1.0, resolution
        )
        # A Ritz value with its residual of 2 %: the limit errs by 1 %, to the safe side.
        results[f"{name}: Lanczos over 2/ω without stresses"] = compare(
            one.lanczos / one.unstressed, 1.0, 0.02
        )
        results[f"{name}: bound of elements over 2/ω, at most 1"] = compare(
            max(one.element / one.exact, 1.0), 1.0, 0.0
        )
        # One mode of a linear system; its plastic strains, if it has any, do not change.
        results[f"{name}: growth in a step at 1.2 times 2/ω"] = compare(
            one.rates[0], growth_per_step(2.4), 0.02
        )
    flat = found["flattened"]
    # What the program leaves out of K: stresses of up to 0.02 E, less than its factor of 0.9.
    results["flattened: 2/ω over that without stresses"] = compare(
        flat.exact / flat.unstressed, 1.0, 0.05
    )
    value = np.array([0.5, 1.0, math.sqrt(1.5), math.sqrt(2.0), 1.6])
    speed, more = rebounds(comm, value)
    theory = rebound_speed(value[:, None], (1 + np.arange(16)) / 16)
    # The tetrahedron behind the tip pulls a little: √(compliance) beside 1.
    results["largest difference of rebound speeds from theory"] = compare(
        np.abs(speed - theory).max(), 0.0, 0.02, scale=1.0
    )
    measured, others = rebound_limit(comm, trials)
    results["ω Δt beyond which blows gain without bound"] = compare(
        measured, rebound_limit_theory(), 0.01
    )
    said = messages(comm)
    results["steps until 1.05 times 2/ω is noticed"] = compare(said["steps"], 0.0, 600, scale=1.0)
    return results, [*simulations, *more, *others, said["simulation"]]
