"""Cost of the paper's sample and of smaller ones, and the paper's test from end to end."""

import json
import shutil
import statistics
import subprocess
import sys
import time

import numpy as np

from ...errors import InputError
from ...machine.mpi_launcher import environment_without_launcher, find_mpirun
from ..family import ADDED, KINETIC, MEMBERS, SIZE, member, scene_file
from .interleaved import COPIES, ratio
from .launch import case_of, launch, row

#: Members whose cost `family` compares.
FAMILY = "20,60,200,630"
#: Growth of the cost of an element-step from the least member to the largest; two ranks over one;
#: part of the box's rate that a loaded packing keeps; memory [bytes a tet].
TARGET_GROWTH, TARGET_SPEEDUP, TARGET_PART, TARGET_MEMORY = 1.15, 1.9, 0.7, 1000.0
#: The paper's test: wall time [s], start-up [s]; kinetic over internal energy, energy residual, and
#: difference of the platens, largest values in the loaded half: within the checks of the report.
TARGET_WALL, TARGET_SETUP = 3600.0, 60.0
TARGETS = {"kinetic": 0.04, "residual": 0.005, "platens": 0.04}


def _options(parameters):
    """Cache folder and size of the mesh, taken out of the parameters."""
    return str(parameters.pop("cache", "bench-cache")), float(parameters.pop("size", SIZE))


def _numbers(members):
    """Members by their numbers of grains: a list, one number, or text with commas.

    Raises:
        InputError: Something else.
    """
    members = members.split(",") if isinstance(members, str) else np.atleast_1d(members)
    try:
        return [int(number) for number in members]
    except ValueError:
        found = ",".join(members)
        raise InputError(f"members = {found}, expected numbers as {FAMILY}") from None


def _of_member(number, cache, size, more):
    folder = member(cache, number, size)
    scene = scene_file(folder, number)
    return {"kind": "demo", "grains": str(folder / "grains"), "scene": str(scene), **more}


def family(parameters):
    """Cost of an element-step on one rank, from the least member to the largest.

    Parameters: ``cache``, ``size`` (see `family.member`); others of `bench.demo`.
    """
    cache, size = _options(parameters)
    numbers = _numbers(parameters.pop("members", FAMILY))
    results, rates = {}, []
    for number in numbers:
        more = {"strain": 0.002, "steps": 40, **parameters}
        one = launch("alone", _of_member(number, cache, size, more), 1)
        rates.append(one["rate"])
        for name in ("num_cells", "rate", "bytes_per_tet", "setup_s", "contact_over_tets"):
            results[f"{name}_{number}_grains"] = {"computed": one[name]}
    growth = rates[0] / rates[-1]
    results["growth_of_cost"] = row(growth, TARGET_GROWTH, growth <= TARGET_GROWTH)
    return _case("family", parameters, results)


def packing(parameters):
    """The 200 grains at strain 0.05, beside the box of the same material; one rank and two.

    Parameters: ``cache``, ``size``; ``grains``, another member; ``strain`` and ``speed`` [m/s] of
    the test that brings it there, whose run is kept for the next time; ``steps`` and ``repeats``.
    """
    cache, size = _options(parameters)
    number, strain = int(parameters.pop("grains", 200)), float(parameters.pop("strain", 0.05))
    folder = member(cache, number, size)
    run = folder / f"run-to-{strain:g}"
    if not _finished(run):
        scene = scene_file(folder, number, strain, float(parameters.pop("speed", 4.0)))
        _run(scene, run, 2)
    repeats, steps = int(parameters.pop("repeats", 5)), int(parameters.pop("steps", 300))
    of_run = {"kind": "resumed", "run": str(run), "steps": steps, **parameters}
    cases = {
        "box": {"kind": "box", "model": "j2", "ranks": 1, "steps": max(1, steps // 2)},
    } | {name: choice | of_run for name, choice in COPIES.items()}
    found = launch("turns", {"cases": cases, "repeats": repeats}, 2)
    box, one, two, apart = (found[name]["rates"] for name in cases)
    part, faster = ratio(one, box), ratio(two, one)
    results = {
        "num_cells": {"computed": found["one"]["num_cells"]},
        "rate_box": {"computed": statistics.median(box)},
        "rate_1_rank": {"computed": statistics.median(one)},
        "rate_2_ranks": {"computed": statistics.median(two)},
        "part_of_box_rate": row(part, TARGET_PART, part >= TARGET_PART),
        "speedup_2_ranks": row(faster, TARGET_SPEEDUP, faster >= TARGET_SPEEDUP),
        # Two ranks wait for each other: what slows one for a moment slows both.
        "speedup_2_ranks_of_fastest": {"computed": max(two) / max(one)},
        "speedup_2_programs": {"computed": ratio(apart, one)},
        "contact_over_tets": {"computed": found["one"]["contact_over_tets"]},
        "num_contacts": {"computed": found["one"]["num_contacts"]},
    }
    return _case("packing", parameters, results)


def _finished(run):
    """Whether a run came to its end."""
    summary = run / "run.json"
    return summary.exists() and json.loads(summary.read_text(encoding="utf-8"))["finished"]


def paper(parameters):
    """The whole sample on two ranks: rate and memory, then the test itself by `mufe run`.

    Parameters: ``cache``, ``size``; ``grains``, a smaller member instead; ``strain`` and
    ``speed`` [m/s] of the test, strain 0 for none; ``ranks``; ``added`` mass and ``kinetic`` energy
    of its scene (`family.scene_file`).
    """
    cache, size = _options(parameters)
    number = int(parameters.pop("grains", max(MEMBERS)))
    strain, speed = float(parameters.pop("strain", 0.1)), float(parameters.pop("speed", 2.0))
    ranks = int(parameters.pop("ranks", 2))
    folder = member(cache, number, size)
    added, kinetic = (
        float(parameters.pop("added", ADDED)),
        float(parameters.pop("kinetic", KINETIC)),
    )
    scene = scene_file(folder, number, strain or 0.1, speed, added, kinetic)
    more = {"grains": str(folder / "grains"), "scene": str(scene), "strain": 1e-3, "steps": 20}
    rate = launch("alone", {"kind": "demo", **more}, ranks)
    results = {
        "num_cells": {"computed": rate["num_cells"]},
        "rate": {"computed": rate["rate"]},
        "bytes_per_tet": row(
            rate["bytes_per_tet"], TARGET_MEMORY, rate["bytes_per_tet"] <= TARGET_MEMORY
        ),
        # The libraries' code counted once for each rank.
        "peak_bytes_per_tet": {"computed": rate["peak_bytes_per_tet"]},
        "setup_s": row(rate["setup_s"], TARGET_SETUP, rate["setup_s"] <= TARGET_SETUP),
    }
    if strain:
        results |= _test(folder, scene, ranks)
    return _case("paper", parameters, results)


def _test(folder, scene, ranks):
    """The test from its meshes to its end, and whether it was quasi-static."""
    from ...analysis import energy_check, quasi_static
    from ...analysis.rows import loaded_rows
    from ...output.history import read_history

    run = folder / "run"
    wall = _run(scene, run, ranks)
    summary = json.loads((run / "run.json").read_text(encoding="utf-8"))
    history = read_history(run / "history.csv")
    loaded = loaded_rows(history)
    values = {
        "kinetic": quasi_static.kinetic_ratio(history)[loaded],
        "residual": energy_check.residual_ratio(history)[loaded],
        "platens": quasi_static.force_difference(history)[loaded],
    }
    results = {
        "num_steps": {"computed": summary["num_steps"]},
        "stress_at_end": {"computed": summary["stress"]},
        "wall_s": row(wall, TARGET_WALL, wall <= TARGET_WALL),
        "peak_bytes_per_tet_of_test": {
            "computed": summary["peak_memory_bytes"] / summary["num_cells"]
        },
    }
    for name in ("tenth", "half", "nine_tenths"):
        found = summary["contact_resolution"][name]
        results[f"elements_per_radius_{name}"] = {"computed": found}
    for name, target in TARGETS.items():
        worst = float(np.nanmax(values[name]))
        results[f"{name}_largest"] = row(worst, target, worst <= target)
        results[f"{name}_mean"] = {"computed": float(np.nanmean(values[name]))}
    return results


def _run(scene, run, ranks):
    """`mufe run` of a scene into a new folder; its wall time [s].

    Raises:
        InputError: It failed.
    """
    shutil.rmtree(run, ignore_errors=True)
    environment = environment_without_launcher()
    command = [find_mpirun(), "-n", str(ranks), sys.executable, "-m", "mufe_fenicsx", "run"]
    start = time.perf_counter()
    done = subprocess.run(  # noqa: S603  words of our own, no shell
        [*command, str(scene), "-o", str(run), "--quiet"],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise InputError(f"the test failed: {done.stderr.strip()[-500:]}")
    return time.perf_counter() - start


def _case(name, parameters, results):
    return case_of(name, parameters, results)
