"""What the elements cost beside each other, and rigid grains beside those that deform.

All are timed in turns within one program, so that a machine that is shared slows all alike;
least times and their ratios: others only add to them.
"""

import time

import numpy as np
from mpi4py import MPI

from ...bulk.solid import ELEMENTS, Solid
from ...geometry.bodies.shapes import box, sphere
from ...materials.elastic import Elastic
from ...materials.j2 import J2
from ...materials.rigid import Rigid
from ...mesh import create_grain_mesh
from ...run.from_bodies import build, drive
from ...state import initial_state
from .launch import case_of

#: Averaged over plain tetrahedra; a step of J2 grains over one of rigid grains; and their steps.
TARGET_AVERAGED, TARGET_RIGID, TARGET_STEP = 1.35, 20.0, 5.0
QUARTZ = {"E": 100e9, "nu": 0.15, "rho": 2650.0}
YIELD = ((0.0, 100e6), (0.05, 200e6))
RADIUS = 1e-3
#: Gaps between the balls of a packing over their radius, without contact and with; a packing
#: that touches is then pressed by this part of its height, at this speed [m/s], and brought
#: almost to rest by this damping [1/s] for so long [s], as in a slow test.
GAPS = {"apart": 0.5, "pressed": 0.0}
STRAIN, SPEED, DAMPING, REST = 0.012, 4.0, 1e6, 5e-6


def elements(parameters):
    """Elements on one mesh, and rigid grains against J2 ones of one surface mesh, on one rank.

    Parameters: ``divisions``, cubes along the edge of a box; ``grains``, balls along the edge of a
    cubic packing; ``size``, length of their edges over their radius; ``repeats``.
    """
    divisions = int(parameters.get("divisions", 20))
    grains = int(parameters.get("grains", 3))
    size = float(parameters.get("size", 0.2))
    repeats = int(parameters.get("repeats", 30))
    results = _kernels(divisions, repeats)
    for name in GAPS:
        results |= _packings(name, grains, size, repeats)
    taken = {"divisions": divisions, "grains": grains, "size": size, "repeats": repeats}
    return case_of("elements", taken, results)


def _kernels(divisions, repeats):
    """Internal forces of each element and model on one mesh."""
    points, cells = box((1.0, 1.0, 1.0), (divisions,) * 3)
    one = np.array([1])
    mesh = create_grain_mesh(MPI.COMM_SELF, points, cells, np.zeros(len(cells), int), one, one - 1)
    velocity = 1e-2 * mesh.x[:, [1, 2, 0]]
    # All of the plastic one yields, in every step.
    models = {
        "elastic": Elastic(1e9, 0.15, 2650.0),
        "j2": J2(1e9, 0.15, 2650.0, ((0.0, 1e3), (0.05, 1e6))),
    }
    work = {}
    for model, material in models.items():
        for element in ELEMENTS:
            solid, state = Solid(mesh, [material], element), initial_state(mesh.x, mesh.num_cells)
            state.v[:] = velocity
            work[model, element] = _forces(solid, state)
    times = _in_turns(work, repeats, steps=3)
    results = {"num_cells": {"computed": mesh.num_cells}}
    for (model, element), seconds in times.items():
        results[f"Mtets_per_s_{element}_{model}"] = {"computed": 1e-6 * mesh.num_cells / seconds}
    for model in models:
        plain = times[model, "p1"]
        ratio = times[model, "averaged"] / plain
        results[f"averaged_over_p1_{model}"] = {
            "computed": ratio, "target": TARGET_AVERAGED, "passed": ratio <= TARGET_AVERAGED,
        }  # fmt: skip
    return results


def _forces(solid, state):
    force = np.zeros_like(state.x)
    return lambda: solid.add_internal_forces(force, state, 1e-4)


def _packings(name, grains, size, repeats):
    """Whole steps of a packing of rigid balls, and of the same ones that may yield."""
    simulations = {
        "rigid": packing(Rigid(**QUARTZ), grains, GAPS[name], size),
        "j2": packing(J2(**QUARTZ, yield_stress=YIELD), grains, GAPS[name], size),
    }
    if name == "pressed":
        for s in simulations.values():
            s.damping = DAMPING
            height = np.ptp(s.walls.point[:, 2])
            drive(s, {"z_max": (0, 0, -STRAIN * height)}, STRAIN * height / SPEED)
            end = s.state.t + REST
            while s.state.t < end:
                s.step()
    times = _in_turns({key: _stepper(s) for key, s in simulations.items()}, repeats, steps=10)
    mesh = simulations["j2"].mesh
    ratio = times["j2"] / times["rigid"]
    longer = simulations["rigid"].dt / simulations["j2"].dt
    results = {}
    for key, s in simulations.items():
        s.energies()
        results[f"{name}_{key}_us_per_step_and_grain"] = {
            "computed": 1e6 * times[key] / mesh.num_grains
        }
        results[f"{name}_{key}_step_s"] = {"computed": s.dt}
        results[f"{name}_{key}_contacts"] = {"computed": s.num_contacts}
    results[f"{name}_tets_per_grain"] = {"computed": mesh.num_cells / mesh.num_grains}
    results[f"{name}_j2_over_rigid"] = {
        "computed": ratio, "target": TARGET_RIGID, "passed": ratio >= TARGET_RIGID,
    }  # fmt: skip
    results[f"{name}_rigid_step_over_j2"] = {
        "computed": longer, "target": TARGET_STEP, "passed": longer >= TARGET_STEP,
    }  # fmt: skip
    results[f"{name}_cost_of_a_second_j2_over_rigid"] = {"computed": ratio * longer}
    return results


def _stepper(simulation):
    return lambda: simulation.step(everywhere=False)


def packing(material, grains, gap, size):
    """Balls on a cubic grid between walls, turned at random, all moving and turning. One rank.

    Args:
        material: Of all of them.
        grains: Balls along an edge.
        gap: Between neighbours over the radius; half of it to the walls.
        size: Length of edges over the radius.
    """
    points, cells = sphere(RADIUS, size * RADIUS)
    # The facets enclose the volume of the ball, so nodes are outside of it.
    pitch = (2 + gap) * np.linalg.norm(points, axis=1).max()
    rng = np.random.default_rng(1)
    bodies = []
    for place in np.ndindex(grains, grains, grains):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        bodies.append((points @ turn.T + pitch * (np.array(place) + 0.5), cells))
    # Slow: apart they stay so while they are timed.
    return build(
        MPI.COMM_SELF, bodies, material, np.zeros(3), np.full(3, grains * pitch), friction=0.3,
        velocity=lambda x, _grain: np.cross([0.3, -0.2, 0.5], x),
    )  # fmt: skip


def _in_turns(work, repeats, steps):
    """Least processor time [s] of each of some functions, by its key: others only add to it."""
    times = {key: [] for key in work}
    for function in work.values():
        for _ in range(5):
            function()
    for _ in range(repeats):
        for key, function in work.items():
            start = time.process_time()
            for _ in range(steps):
                function()
            times[key].append((time.process_time() - start) / steps)
    return {key: min(values) for key, values in times.items()}
