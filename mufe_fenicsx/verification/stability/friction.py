"""Friction up to 2: a sliding block that flutters, and energy that stays accounted for."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.walls import Wall
from ...explicit.simulation import Simulation
from ...geometry.bodies.shapes import box
from ...implicit.simulation import ImplicitSimulation
from ...materials.elastic import Elastic
from ...run.from_bodies import distribute, drive
from ..case import case, compare
from .limits import NEVER, NU, RHO, SIZE, E, dense_stiffness

COEFFICIENTS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
#: Of the plane below the block [m/s]: the stick springs turn far more slowly than modes swing.
DRAW = 0.004
#: Height over width of a block that slides with all of its face at 1.5 and 2 too: friction at its
#: foot tilts it by a moment that grows with its height.
FLAT = 0.5


def block(comm, friction, height, divisions, strain):
    """Mesh, material, walls: a plane below, a glued platen above; what has to be drawn [m]."""
    material, up = Elastic(E, NU, RHO), np.eye(3)[2]
    mesh = distribute(comm, [box((SIZE, SIZE, height * SIZE), divisions)])
    walls = [
        Wall("plane", np.zeros(3), up, friction=friction),
        Wall("platen", height * SIZE * up, -up, bonded=True),
    ]
    # The block's shear and the springs' at the limit.
    return mesh, material, walls, 2 * friction * strain * SIZE


def sliding_block(comm, friction, divisions=(2, 2, 2), strain=1e-4, height=1.0):
    """A block glued to a platen above and pressed on a plane that is drawn away steadily.

    Args:
        comm: MPI communicator of one rank.
        friction: Of the plane.
        divisions: Bricks along each edge.
        strain: What the platen comes down by over the width of the block.
        height: Of the block over its width.
    """
    mesh, material, walls, depth = block(comm, friction, height, divisions, strain)
    transit = SIZE / material.wave_speed
    s = Simulation(mesh, [material], walls, points="nodes", element="p1", damping=2.0 / transit)
    drive(s, {"platen": -strain * SIZE * np.eye(3)[2]}, 6 * transit)
    s.walls.velocity[0] = [DRAW, 0.0, 0.0]
    # Pressures follow the relaxing stick springs: e-folds of them per depth drawn.
    end = s.state.t + 10 * depth / DRAW
    while s.state.t < end:
        s.step()
    for _ in range(3000):
        s.step()
    s.damping, s.limit.schedule.steps = 0.0, NEVER
    return s


def sliding_statically(comm, friction, divisions=(2, 2, 2), strain=1e-4, height=FLAT, number=20):
    """The same in static increments: pressed in one, drawn in ``number`` of them."""
    mesh, material, walls, depth = block(comm, friction, height, divisions, strain)
    s = ImplicitSimulation(
        mesh, [material], walls, first_step=1.0, largest_step=1.0, points="nodes", element="p1"
    )
    s.walls.velocity[1, 2] = -strain * SIZE
    s.step()
    s.walls.velocity[1, 2] = 0.0
    s.walls.velocity[0, 0] = 10 * depth / number
    while s.state.t < 1.0 + number - 1e-9:
        s.step()
    return s


def flutter_theory(s, friction):
    """Growth rate of the fastest mode [1/s] of the block that slides, the highest frequency, mode.

        M ü + (K + Σ k (n + μ t) nᵀ) u = Σ f b,   ḟ = -k_t (b·u̇ + V f/(μ N)),

    n the normal of the plane, t the way that it is drawn with the speed V, b across both, at the
    pressed nodes with normal forces N. A stick spring across the slip relaxes while that lasts:
    friction turns to where the slip goes. Growth is that of central differences, 2/Δt
    asinh(λ Δt/2) for a mode λ.
    """
    pairs, contact = s.contact.walls.pairs, s.contact
    K = dense_stiffness(s, springs=False)
    on = np.flatnonzero(pairs.closed & (pairs.wall == 0))
    nodes = contact.own.nodes[pairs.node[on]]
    k = contact.points.area[pairs.node[on]] / contact.points.layer[pairs.node[on]]
    K[3 * nodes + 2, 3 * nodes + 2] += k
    K[3 * nodes, 3 * nodes + 2] += friction * k
    free = np.ones(s.mesh.num_nodes, dtype=bool)
    free[s.specimen.glued.nodes] = False
    free = np.repeat(free, 3)
    mass = np.repeat(s.solid.mass, 3)
    n, m = free.sum(), on.size if friction > 0 else 0
    A = np.zeros((2 * n + m, 2 * n + m))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, :n] = -K[np.ix_(free, free)] / mass[free, None]
    if m:
        across = np.zeros((mass.size, m))
        across[3 * nodes + 1, np.arange(m)] = 1.0
        stick = k * contact.layers.ratio[pairs.node[on]]
        normal = k * (pairs.offset - pairs.gap)[on]
        A[n : 2 * n, 2 * n :] = (across / mass[:, None])[free]
        A[2 * n :, n : 2 * n] = -(across * stick).T[:, free]
        A[2 * n :, 2 * n :] = -np.diag(stick * DRAW / (friction * normal))
    modes, vectors = np.linalg.eig(A)
    growth = (2 / s.dt * np.arcsinh(0.5 * s.dt * modes)).real
    mode = np.zeros(mass.size)
    mode[free] = vectors[n : 2 * n, growth.argmax()].real
    mode = (mode / np.abs(mode).max()).reshape(-1, 3)
    return float(growth.max()), float(np.abs(modes.imag).max()), mode


def flutter(comm, coefficients=COEFFICIENTS, num_steps=4000, height=1.0):
    """One row for each coefficient: rate of growth measured and by theory, and the energy."""
    rows, simulations = [], []
    for friction in coefficients:
        s = sliding_block(comm, friction, height=height)
        at_rest, pairs = s.walls.force[0].copy(), s.contact.walls.pairs
        num_pressed = int((pairs.closed & (pairs.wall == 0)).sum())
        rate, highest, mode = flutter_theory(s, friction)
        before = s.energies()
        quiet = s.state.v.copy()
        s.state.v += 1e-4 * DRAW * mode  # noise would show it late, among all others
        free = np.ones(s.mesh.num_nodes, dtype=bool)
        free[s.specimen.glued.nodes] = False
        course, times = [], []
        for k in range(num_steps):
            s.step()
            if k % 10 == 0:
                v = s.state.v[free] - quiet[free]
                course.append(float((s.solid.mass[free, None] * v**2).sum()))
                times.append(s.state.t)
            if np.abs(s.state.v[free]).max() > 0.3 * DRAW:  # it would stick and slip
                break
        course, times = np.log(course), np.array(times)
        half = len(course) // 2
        # A face that has not let go moves too fast at once for a rate.
        measured = 0.5 * np.polyfit(times[half:], course[half:], 1)[0] if half > 5 else math.nan
        e = s.energies()
        forces = s.walls.force[0]
        rows.append(
            SimpleNamespace(
                friction=friction, measured=float(measured), theory=rate, highest=highest,
                drag=float(forces[0] / forces[2]) if forces[2] else math.nan,
                normal=float(-at_rest[2]), pulled=float(-at_rest[0]),
                pressed=num_pressed,
                residual=(e["residual"] - before["residual"])
                / (abs(e["work"] - before["work"]) + e["elastic"]),
                limit=s.dt * highest / 2.0,
            )
        )  # fmt: skip
        simulations.append(s)
    return rows, simulations


def static_rows(comm, rows, height):
    """The blocks of :func:`flutter` in static increments: their forces beside those of time steps.

    Returns:
        One row for each: friction, distance of normal force and drag over the normal force, drag
        over normal force, Newton iterations.
    """
    found = []
    for row in rows:
        s = sliding_statically(comm, row.friction, height=height)
        pulled, normal = -s.walls.force[0][[0, 2]]
        away = math.hypot(pulled - row.pulled, normal - row.normal) / row.normal
        found.append(
            SimpleNamespace(
                friction=row.friction, away=float(away), drag=float(pulled / normal),
                iterations=sum(entry[2] for entry in s.report),
            )
        )  # fmt: skip
    return found


@case("stability-friction", num_bodies=1)
def friction_limits(comm, num_steps=4000):
    """A block drawn over a plane with friction up to 2: flutter by theory, no energy from nowhere.

    Half as high as it is wide, it slides with all of its face; static increments lead to the
    same forces.

    Args:
        comm: MPI communicator.
        num_steps: Steps in which flutter may grow.
    """
    rows, simulations = flutter(comm, (0.5, 1.0, 1.5, 2.0), num_steps, FLAT)
    results = {}
    for row, static in zip(rows, static_rows(comm, rows, FLAT), strict=True):
        name = f"μ = {row.friction:g}"
        # Of a state that still changes a little while the mode grows.
        results[f"{name}: rate of growth [1/s]"] = compare(row.measured, row.theory, 0.05)
        results[f"{name}: drag over normal force"] = compare(row.drag, row.friction, 1e-5)
        results[f"{name}: energy residual over work and what is stored"] = compare(
            row.residual, 0.0, 1e-2, scale=1.0
        )
        # At 2, where pressures settle slowest, five more e-folds change forces by 1.3e-4, and twice
        # as many increments by 0.7e-4.
        results[f"{name}: forces of static increments, difference"] = compare(
            static.away, 0.0, 5e-4, scale=1.0
        )
    return results, simulations
