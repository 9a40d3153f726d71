"""Friction up to 2: a sliding block that flutters, and energy that stays accounted for."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.walls import Wall
from ...geometry.shapes import box
from ...materials.elastic import Elastic
from ...scene import Contact
from ...simulation import Simulation
from ..build import distribute, drive
from ..case import case, compare
from .limits import NEVER, NU, RHO, SIZE, E, dense_stiffness, message_of

COEFFICIENTS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
#: Of the plane below the block [m/s]: the stick springs turn far more slowly than modes swing.
DRAW = 0.004


def sliding_block(comm, friction, divisions=(2, 2, 2), strain=1e-4):
    """A block glued to a platen above and pressed on a plane that is drawn away steadily."""
    material, up = Elastic(E, NU, RHO), np.eye(3)[2]
    mesh = distribute(comm, [box((SIZE,) * 3, divisions)])
    walls = [
        Wall("plane", np.zeros(3), up, friction=friction),
        Wall("platen", SIZE * up, -up, bonded=True),
    ]
    transit = SIZE / material.wave_speed
    s = Simulation(mesh, [material], walls, points="nodes", element="p1", damping=2.0 / transit)
    drive(s, {"platen": -strain * SIZE * up}, 6 * transit)
    depth = 2 * friction * strain * SIZE  # the block's shear and the springs' at the limit
    s.walls.velocity[0] = [DRAW, 0.0, 0.0]
    # Pressures follow the relaxing stick springs: e-folds of them per depth drawn.
    end = s.state.t + 10 * depth / DRAW
    while s.state.t < end:
        s.step()
    for _ in range(3000):
        s.step()
    s.damping, s.refresh = 0.0, NEVER
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
    k = contact.points.area[pairs.node[on]] / contact.layer[pairs.node[on]]
    K[3 * nodes + 2, 3 * nodes + 2] += k
    K[3 * nodes, 3 * nodes + 2] += friction * k
    free = np.ones(s.mesh.num_nodes, dtype=bool)
    free[s.bonded.nodes] = False
    free = np.repeat(free, 3)
    mass = np.repeat(s.solid.mass, 3)
    n, m = free.sum(), on.size if friction > 0 else 0
    A = np.zeros((2 * n + m, 2 * n + m))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, :n] = -K[np.ix_(free, free)] / mass[free, None]
    if m:
        across = np.zeros((mass.size, m))
        across[3 * nodes + 1, np.arange(m)] = 1.0
        stick = k * contact.ratio[pairs.node[on]]
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


def flutter(comm, coefficients=COEFFICIENTS, num_steps=4000):
    """One row for each coefficient: rate of growth measured and by theory, and the energy."""
    rows, simulations = [], []
    for friction in coefficients:
        s = sliding_block(comm, friction)
        rate, highest, mode = flutter_theory(s, friction)
        before = s.energies()
        quiet = s.state.v.copy()
        s.state.v += 1e-4 * DRAW * mode  # noise would show it late, among all others
        free = np.ones(s.mesh.num_nodes, dtype=bool)
        free[s.bonded.nodes] = False
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
                residual=(e["residual"] - before["residual"])
                / (abs(e["work"] - before["work"]) + e["elastic"]),
                limit=s.dt * highest / 2.0,
            )
        )  # fmt: skip
        simulations.append(s)
    return rows, simulations


def critical(rows):
    """Friction at which growth begins: theory and measured, by the first clear rate."""
    found = []
    for rates in ([r.theory for r in rows], [r.measured for r in rows]):
        clear = [r.friction for r, rate in zip(rows, rates, strict=True) if rate > 1e-3 * r.highest]
        found.append(min(clear, default=math.inf))
    return found


def messages(_comm):
    """What the program says to a friction that cannot be."""
    return {"refused": message_of(Contact, friction=-0.1)}


@case("stability-friction", num_bodies=1)
def friction_limits(comm, num_steps=4000):
    """A block drawn over a plane with friction up to 2: flutter by theory, no energy from nowhere.

    Args:
        comm: MPI communicator.
        num_steps: Steps in which flutter may grow.
    """
    rows, simulations = flutter(comm, (0.5, 1.0, 2.0), num_steps)
    results = {}
    for row in rows:
        name = f"μ = {row.friction:g}"
        if abs(row.drag - row.friction) < 1e-5 * row.friction:  # all of the face slides
            # Of a state that still changes a little while noise grows.
            results[f"{name}: rate of growth [1/s]"] = compare(row.measured, row.theory, 0.05)
        results[f"{name}: energy residual over work and what is stored"] = compare(
            row.residual, 0.0, 1e-2, scale=1.0
        )
    return results, simulations
