"""Throughput: element-steps per second of whole time steps, on one and on two ranks.

The machines this runs on are shared: a measurement is repeated and its median
given, and ranks are compared by taking turns within one run.
"""

import json
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from .bench_elements import elements
from .bench_exchange import exchange
from .bench_family import family, packing, paper, resumed
from .bench_hertz import hertz_cost
from .bench_launch import launch, row
from .bench_linear import linear
from .bench_overhead import overhead, small
from .bench_search import search, share_of_contact

#: Whole step on one core [element-steps/s], two ranks over one, and memory [bytes a tet].
TARGET_RATE, TARGET_SPEEDUP, TARGET_MEMORY = 10e6, 1.6, 2000.0
#: The same of the box: rates of its materials, and two ranks over one.
BOX_RATES, BOX_SPEEDUP = {"j2": 30e6, "elastic": 45e6}, 1.95


def box(comm, *, divisions=40, model="j2", steps=30, repeats=5):
    """The unit box of 40³ cubes of six tets, no contact, one grain a rank. Collective.

    Args:
        divisions: Cubes along an edge.
        model: "j2" (all of it yields) or "elastic".
        steps, repeats: Steps of one measurement, and measurements.
    """
    from ..geometry.shapes import box as box_shape
    from ..materials.elastic import Elastic
    from ..materials.j2 import J2
    from ..mesh import create_grain_mesh
    from ..simulation import Simulation

    divisions = int(divisions)
    # One block a rank, side by side with a gap: the same work in all.
    thickness = max(1, round(divisions / comm.size))
    points, cells = box_shape((1.0, 1.0, thickness / divisions), (divisions, divisions, thickness))
    points = points + np.array([0.0, 0.0, 1.5 * comm.rank])
    ranks = np.arange(comm.size)
    cell_grain = np.full(len(cells), comm.rank)
    mesh = create_grain_mesh(comm, points, cells, cell_grain, ranks + 1, ranks)
    if model == "j2":
        material = J2(1e9, 0.15, 2650.0, ((0.0, 1e3), (0.05, 1e6)))
    elif model == "elastic":
        material = Elastic(1e9, 0.15, 2650.0)
    else:
        raise InputError(f'model = "{model}", expected "j2" or "elastic"')
    # A strain of about 1e-5 in each step, ten times that of first yield.
    velocity = 1.0 * mesh.x[:, [1, 2, 0]]
    simulation = Simulation(mesh, [material], velocity=velocity)
    result = measure(comm, simulation, steps, repeats)
    yielded = np.count_nonzero(simulation.state.plastic_strain)
    result["yielded"] = comm.allreduce(yielded) / result["num_cells"]
    return result


def blocks(comm, *, divisions=32, steps=30, repeats=5):
    """Two unlike J2 boxes pressed face to face, one a rank where there are two. Collective.

    Args:
        divisions: Cubes along an edge of the lower one; the upper one has one more.
        steps, repeats: Steps of one measurement, and measurements.
    """
    return measure(comm, pressed_blocks(comm, int(divisions)), steps, repeats)


def pressed_blocks(comm, divisions):
    """The simulation of :func:`blocks` when they have been pressed together. Collective."""
    from ..geometry.shapes import box as box_shape
    from ..materials.j2 import J2
    from .build import build

    bodies = [
        box_shape((1.0, 1.0, 1.0), (m,) * 3, (0.0, 0.0, z))
        for m, z in ((divisions, 0.0), (divisions + 1, 1.0))
    ]
    material = J2(100e9, 0.15, 2650.0, ((0.0, 10e6), (0.05, 110e6)))
    simulation = build(
        comm, bodies, material, np.zeros(3), np.array([1.0, 1.0, 2.0]), friction=0.23
    )
    simulation.walls.velocity[5, 2] = -10.0
    while simulation.state.t * 10.0 < 2e-3:
        simulation.step()
    return simulation


def demo(comm, *, grains, scene=None, strain=0.01, speed=20.0, steps=100, repeats=5):
    """A sample between its walls, loaded; by default the demonstration's. Collective.

    Args:
        grains: Folder that `mufe mesh` wrote.
        scene: Scene file of its material and contact.
        strain: Approach of the platens over the height before measuring.
        speed: Speed of the top platen meanwhile [m/s].
        steps, repeats: Steps of one measurement, and measurements.
    """
    from ..contact.separation import separate
    from ..demo import demo_scene
    from ..preparation import load_mesh, make_walls, read_scene
    from ..simulation import Simulation

    start = time.perf_counter()
    scene = read_scene(comm, scene or demo_scene())
    mesh = load_mesh(comm, grains)
    separate(mesh, scene.sample.max_shift)
    low = comm.allgather(mesh.x.min(axis=0))
    high = comm.allgather(mesh.x.max(axis=0))
    low, high = np.min(low, axis=0), np.max(high, axis=0)
    simulation = Simulation(
        mesh,
        [scene.material] * mesh.num_grains,
        make_walls(scene, low, high),
        friction=scene.contact.friction,
        friction_kinetic=scene.contact.friction_kinetic,
        compliance=scene.contact.compliance,
        points=scene.contact.points,
        law=scene.contact.law,
        self_contact=scene.contact.self_contact,
    )
    setup = time.perf_counter() - start
    simulation.walls.velocity[5, 2] = -speed
    while simulation.state.t < strain * (high - low)[2] / speed:
        simulation.step()
    result = measure(comm, simulation, steps, repeats)
    result["num_contacts"] = simulation.num_contacts
    result["setup_s"] = setup
    result |= share_of_contact(simulation, int(steps) * int(repeats))
    return result


def measure(comm, simulation, steps, repeats):
    """Step and time; the median over the repeats, and the memory at the end. Collective."""
    from ..memory import memory_in_use, peak_memory

    steps, repeats = int(steps), int(repeats)
    for _ in range(5):
        simulation.step()
    rates = []
    num_cells = comm.allreduce(simulation.mesh.num_cells)
    for _ in range(repeats):
        comm.Barrier()
        start = time.perf_counter()
        for _ in range(steps):
            simulation.step(everywhere=False)
        comm.Barrier()
        rates.append(num_cells * steps / (time.perf_counter() - start))
    simulation.energies()
    memory = memory_in_use(comm)
    return {
        "num_ranks": comm.size,
        "num_cells": num_cells,
        "rate": statistics.median(rates),
        "slowest": min(rates),
        "fastest": max(rates),
        "bytes_per_tet": memory / num_cells,
        "peak_bytes_per_tet": peak_memory(comm) / num_cells,
    }


def compare_box(parameters):
    """`box` of J2 and elastic material, on one and on two ranks."""
    models = [parameters.pop("model")] if "model" in parameters else list(BOX_RATES)
    results = {}
    for model in models:
        target = BOX_RATES.get(model, TARGET_RATE)
        found = _compare("box", {"model": model, **parameters}, target, BOX_SPEEDUP)
        results |= {f"{model}_{name}": row for name, row in found["results"].items()}
    passed = all(row.get("passed", True) for row in results.values())
    return {"case": "box", "parameters": parameters, "results": results, "passed": passed}


def compare_blocks(parameters):
    """`blocks` on one and on two ranks."""
    return _compare("blocks", parameters)


def compare_demo(parameters):
    """`demo` on one and on two ranks, on the demonstration's image with a finer mesh.

    Parameters beside those of `demo`: ``cache``, the folder where labels and meshes
    are kept for the next time, and ``size``, the wanted edge of the mesh [m].
    """
    cache = Path(str(parameters.pop("cache", "bench-cache")))
    size = float(parameters.pop("size", 20e-6))
    return _compare("demo", {**parameters, "grains": str(_refined_demo(cache, size))})


def _refined_demo(cache, size):
    """Meshes of the demonstration's image with edges of ``size`` [m], made where absent."""
    from ..demo import demo_scene
    from ..geometry.pipeline import mesh_labels, segment_image
    from ..scene import load_scene

    scene = load_scene(demo_scene())
    folder = cache / f"demo-{size * 1e6:g}um"
    if not folder.exists():
        cache.mkdir(parents=True, exist_ok=True)
        labels = cache / "demo-labels.tif"
        segment_image(scene.image.path, scene.image, labels, overwrite=True)
        mesh_labels(labels, replace(scene.mesh, size=size), folder)
    return folder.resolve()


def _compare(name, parameters, target=TARGET_RATE, speedup=TARGET_SPEEDUP, turns=3):
    """Measure on one and on two ranks by turns, each in a program of its own; medians of rates."""
    turned = [[launch(name, parameters, n) for n in (1, 2)] for _ in range(turns)]
    first, second = (_median(rows) for rows in zip(*turned, strict=True))
    results = {
        "num_cells": {"computed": first["num_cells"]},
        "rate_1_rank": row(first["rate"], target, first["rate"] >= target),
        "rate_1_rank_slowest": {"computed": first["slowest"]},
        "rate_1_rank_fastest": {"computed": first["fastest"]},
        "rate_2_ranks": {"computed": second["rate"]},
        "speedup_2_ranks": row(
            second["rate"] / first["rate"], speedup, second["rate"] >= speedup * first["rate"]
        ),
        # Two ranks wait for each other: what slows one for a moment slows both.
        "speedup_2_ranks_of_fastest": {"computed": second["fastest"] / first["fastest"]},
        "bytes_per_tet_1_rank": {"computed": first["bytes_per_tet"]},
        "peak_bytes_per_tet_1_rank": {"computed": first["peak_bytes_per_tet"]},
        "bytes_per_tet_2_ranks": row(
            second["bytes_per_tet"], TARGET_MEMORY, second["bytes_per_tet"] <= TARGET_MEMORY
        ),
        # The libraries' code, which two ranks share, counted twice.
        "peak_bytes_per_tet_2_ranks": {"computed": second["peak_bytes_per_tet"]},
    }
    if "yielded" in first:
        results["yielded"] = {"computed": first["yielded"]}
    if "num_contacts" in first:
        results["num_contacts"] = {"computed": first["num_contacts"]}
        # Contact shall cost no more than the tets.
        share = first["contact_over_tets"]
        results["contact_over_tets_1_rank"] = row(share, 1.0, share <= 1.0)
        results["steps_per_search_1_rank"] = {"computed": first["steps_per_search"]}
    passed = all(row.get("passed", True) for row in results.values())
    return {"case": name, "parameters": parameters, "results": results, "passed": passed}


def _median(rows):
    """Several measurements as one: median rate, the slowest and fastest of all."""
    return rows[0] | {
        "rate": statistics.median(one["rate"] for one in rows),
        "slowest": min(one["slowest"] for one in rows),
        "fastest": max(one["fastest"] for one in rows),
    }


BENCHMARKS = {
    "box": compare_box,
    "blocks": compare_blocks,
    "demo": compare_demo,
    "packing": packing,
    "family": family,
    "paper": paper,
    "hertz": hertz_cost,
    "linear": linear,
    "search": search,
    "exchange": exchange,
    "elements": elements,
    "overhead": overhead,
}
#: What `mufe bench` runs without a name: the others take an hour or more.
USUAL = ("box", "blocks", "demo", "search", "elements", "overhead", "hertz")
MEASUREMENTS = {"box": box, "blocks": blocks, "demo": demo, "small": small, "resumed": resumed}


def run_benchmarks(names, parameters, comm):
    """Run benchmarks by name; a list of dicts in the form of `mufe verify`.

    Args:
        names: Names out of ``BENCHMARKS``.
        parameters: Changes of their parameters.
        comm: One rank: the benchmarks start their own.

    Raises:
        InputError: More than one rank.
    """
    if comm.size > 1:
        raise InputError(
            f"number of ranks = {comm.size}, expected 1: the benchmarks start ranks themselves"
        )
    return [BENCHMARKS[name](dict(parameters)) for name in names]


if __name__ == "__main__":
    from mpi4py import MPI

    from mufe_fenicsx.memory import return_freed_arrays

    return_freed_arrays()
    outcome = MEASUREMENTS[sys.argv[1]](MPI.COMM_WORLD, **json.loads(sys.argv[2]))
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(outcome))
