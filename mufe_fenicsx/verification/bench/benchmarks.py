"""Throughput: element-steps per second of whole time steps, on one and on two ranks.

The machines this runs on are shared: a measurement is repeated and its median
given, and what is compared takes turns within one program (`bench_turns`).
"""

import json
import statistics
import sys
import time
import traceback

from ...errors import InputError
from .cracks import cracks, whole_and_growing
from .elements import elements
from .exchange import exchange
from .family import family, packing, paper
from .hertz import hertz_cost
from .interleaved import COPIES, ratio, turns
from .launch import case_of, launch, row
from .linear import linear
from .membrane import in_membrane, membrane
from .overhead import overhead, small
from .scenes import prepare
from .search import search, share_of_contact

#: Whole step on one core [element-steps/s], two ranks over one, and memory [bytes a tet].
TARGET_RATE, TARGET_SPEEDUP, TARGET_MEMORY = 10e6, 1.6, 2000.0
#: The same of the box: rates of its materials, and two ranks over one.
BOX_RATES, BOX_SPEEDUP = {"j2": 30e6, "elastic": 45e6}, 1.95


def alone(comm, *, steps=30, repeats=5, **parameters):
    """One simulation that has its program for itself: rate and memory. Collective.

    Args:
        steps, repeats: Steps of one measurement, and measurements.
        parameters: Of `bench_scenes.prepare`.
    """
    from ...machine.memory import memory_in_use, peak_memory

    simulation, setup = prepare(comm, **parameters)
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
        "num_cells": num_cells,
        "rate": statistics.median(rates),
        "bytes_per_tet": memory / num_cells,
        "peak_bytes_per_tet": peak_memory(comm) / num_cells,
        "setup_s": setup,
    } | share_of_contact(simulation, steps * repeats)


def compare_box(parameters):
    """`box` of J2 and elastic material, on one and on two ranks."""
    models = [parameters.pop("model")] if "model" in parameters else list(BOX_RATES)
    results = {}
    for model in models:
        target = BOX_RATES.get(model, TARGET_RATE)
        found = _compare("box", {"model": model, **parameters}, target, BOX_SPEEDUP)
        results |= {f"{model}_{name}": row for name, row in found["results"].items()}
    return case_of("box", parameters, results)


def _compare(name, parameters, target=TARGET_RATE, speedup=TARGET_SPEEDUP):
    """Rates on one and on two ranks by turns, and memory in programs of their own."""
    repeats, steps = int(parameters.pop("repeats", 5)), int(parameters.pop("steps", 60))
    case = {"kind": name, "steps": steps, **parameters}
    cases = {name: choice | case for name, choice in COPIES.items()}
    found = launch("turns", {"cases": cases, "repeats": repeats}, 2)
    first, second, apart = (found[name]["rates"] for name in COPIES)
    rate, faster = statistics.median(first), ratio(second, first)
    alones = [launch("alone", {**case, "repeats": 1}, n) for n in (1, 2)]
    memory = alones[1]["bytes_per_tet"]
    results = {
        "num_cells": {"computed": found["one"]["num_cells"]},
        "rate_1_rank": row(rate, target, rate >= target),
        "rate_1_rank_slowest": {"computed": min(first)},
        "rate_1_rank_fastest": {"computed": max(first)},
        "rate_2_ranks": {"computed": statistics.median(second)},
        "speedup_2_ranks": row(faster, speedup, faster >= speedup),
        # Two ranks wait for each other: what slows one for a moment slows both.
        "speedup_2_ranks_of_fastest": {"computed": max(second) / max(first)},
        "speedup_2_programs": {"computed": ratio(apart, first)},
        "bytes_per_tet_1_rank": {"computed": alones[0]["bytes_per_tet"]},
        "peak_bytes_per_tet_1_rank": {"computed": alones[0]["peak_bytes_per_tet"]},
        "bytes_per_tet_2_ranks": row(memory, TARGET_MEMORY, memory <= TARGET_MEMORY),
        # The libraries' code, which two ranks share, counted twice.
        "peak_bytes_per_tet_2_ranks": {"computed": alones[1]["peak_bytes_per_tet"]},
        "yielded": {"computed": found["one"]["yielded"]},
    }
    if "num_contacts" in found["one"]:
        results["num_contacts"] = {"computed": found["one"]["num_contacts"]}
        # Contact shall cost no more than the tets.
        share = found["one"]["contact_over_tets"]
        results["contact_over_tets_1_rank"] = row(share, 1.0, share <= 1.0)
        results["steps_per_search_1_rank"] = {"computed": found["one"]["steps_per_search"]}
    return case_of(name, parameters, results)


BENCHMARKS = {
    "box": compare_box,
    "packing": packing,
    "family": family,
    "paper": paper,
    "hertz": hertz_cost,
    "linear": linear,
    "search": search,
    "exchange": exchange,
    "elements": elements,
    "overhead": overhead,
    "membrane": membrane,
    "cracks": cracks,
}
#: What `mufe bench` runs without a name: the others take an hour or more.
USUAL = ("box", "search", "elements", "overhead", "hertz")
MEASUREMENTS = {
    "alone": alone,
    "turns": turns,
    "small": small,
    "in_membrane": in_membrane,
    "whole_and_growing": whole_and_growing,
}


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

    from mufe_fenicsx.machine.memory import return_freed_arrays

    return_freed_arrays()
    try:
        outcome = MEASUREMENTS[sys.argv[1]](MPI.COMM_WORLD, **json.loads(sys.argv[2]))
    except Exception:
        # What fails on one rank leaves no other waiting.
        traceback.print_exc()
        MPI.COMM_WORLD.Abort(1)
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(outcome))
