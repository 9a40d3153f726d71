"""What `mufe plan` predicts, beside what `mufe run` then takes.

Four samples are planned with an accuracy and run as planned: two balls, a lattice of balls, one
with loose balls in its voids, twenty angular grains; and folders of grains of your own. Predicted
and actual tetrahedra, steps, memory, disk and time stand beside each other. Each test is a process
of its own, so that its memory is that of it alone; times are of the processor, which on a machine
that does nothing else are those of the clock on the wall. Actual steps and times hold the seating,
planned ones do not: how long it takes is not known beforehand.

    python demos/plan_check.py FOLDER                              some minutes
    python demos/plan_check.py FOLDER --samples balls lattice      some of them
    python demos/plan_check.py FOLDER --grains DIR --accuracy 0.6  a sample that `mufe mesh` made
    python demos/plan_check.py FOLDER --ranks 2
"""

import argparse
import csv
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import numpy as np

from mufe_fenicsx.geometry.bodies.shapes import sphere
from mufe_fenicsx.geometry.grains import Grains, save_grains
from mufe_fenicsx.materials.sand import scene_table
from mufe_fenicsx.verification.fidelity import lattice
from mufe_fenicsx.verification.packing import RADIUS, angular_grains

SCENE = """accuracy = {accuracy:g}

{material}
[contact]
friction = 0.23

[oedometer]
strain = {strain:g}
speed = "1 m/s"
seating_stress = "10 kPa"
seating_speed = "{seating_speed:g} m/s"

[output]
fields = 5
history = 101
"""
#: Quantities that are compared: name, of the prediction, of the summary of a run, unit, factor.
ROWS = (
    ("tetrahedra", "num_cells", "num_cells", "", 1.0),
    ("steps", "num_steps", "num_steps", "", 1.0),
    ("memory", "memory_bytes", "peak_memory_bytes", "MB", 1e-6),
    ("disk", "disk_bytes", "size", "MB", 1e-6),
    ("time", "wall_s", "processor_s", "s", 1.0),
)


def balls(h=0.2):
    """Two balls on top of each other."""
    points, cells = sphere(RADIUS, h * RADIUS)
    return [(points + np.array([0, 0, 2 * RADIUS * k]), cells) for k in range(2)], h * RADIUS


def cubic(h=0.26):
    """A lattice of balls."""
    return lattice((2, 2, 3), h)[:12], h * RADIUS


def filled(h=0.23):
    """A lattice of balls with loose ones of half their size, as finely meshed, between."""
    return lattice((2, 2, 3), h), h * RADIUS


def angular(h=0.28):
    """Angular grains with flat faces, edges and corners."""
    return angular_grains((2, 2, 5), h, gap=0.0), h * RADIUS


#: Bodies, accuracy that their meshes allow, strain.
SAMPLES = {
    "balls": (balls, 0.3, 0.02),
    "lattice": (cubic, 0.6, 0.02),
    "filled": (filled, 0.6, 0.02),
    "angular": (angular, 0.6, 0.02),
}


def run(name, grains, folder, accuracy, strain, ranks=1, seating_speed=5.0):
    """Plan and run a sample; rows (quantity, unit, predicted, actual) and what run.json holds."""
    scene, answer = folder / f"{name}.toml", folder / f"{name}.json"
    scene.write_text(
        SCENE.format(
            material=scene_table(), accuracy=accuracy, strain=strain, seating_speed=seating_speed
        ),
        encoding="utf-8",
    )
    out = folder / f"{name}-run"
    command = [sys.executable, __file__, "--test", scene, grains, out, answer]
    if ranks > 1:
        command = [shutil.which("mpirun") or "mpirun", "-n", str(ranks), *command]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{name}: {done.stderr.strip()[-400:]}")
    summary = json.loads(answer.read_text())
    predicted = summary["plan"]["predicted"]
    size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    actual = summary | {"size": size}
    rows = [(label, unit, factor * predicted[key], factor * actual[other])
            for label, key, other, unit, factor in ROWS]  # fmt: skip
    return rows, summary


def test(scene, grains, out, answer):
    """One test in a process of its own. Times are of the processor, predicted and actual."""
    from mpi4py import MPI

    from mufe_fenicsx.planning.run import planned_scene
    from mufe_fenicsx.run.run import run_scene
    from mufe_fenicsx.run.scene_file import read_scene

    comm = MPI.COMM_WORLD
    given = read_scene(comm, Path(scene))
    # Kernels are compiled or read at their first use, which is no part of what a test costs.
    planned_scene(given, grains, comm)
    planned, after = planned_scene(given, grains, comm, clock=time.process_time)
    begin = time.process_time()
    done = run_scene(planned, grains, out, comm, overwrite=True, quiet=True, after=after)
    done["processor_s"] = comm.allreduce(time.process_time() - begin, op=MPI.MAX)
    if comm.rank == 0:
        Path(answer).write_text(json.dumps(done))


def main():
    if sys.argv[1:2] == ["--test"]:
        test(*sys.argv[2:])
        return
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--samples", nargs="*", choices=list(SAMPLES))
    parser.add_argument("--grains", type=Path, nargs="*", default=[], metavar="DIR")
    parser.add_argument("--accuracy", type=float, default=0.6, help="of --grains")
    parser.add_argument("--strain", type=float, default=0.02, help="of --grains")
    parser.add_argument("--ranks", type=int, default=1)
    given = parser.parse_args()
    folder = given.folder
    folder.mkdir(parents=True, exist_ok=True)
    names = given.samples if given.samples is not None else ([] if given.grains else SAMPLES)
    tests = []
    for name in names:
        make, accuracy, strain = SAMPLES[name]
        bodies, h = make()
        grains = folder / f"{name}-grains"
        shutil.rmtree(grains, ignore_errors=True)
        save_grains(grains, Grains.from_list(np.arange(1, len(bodies) + 1), bodies, h))
        tests.append((name, grains, accuracy, strain))
    tests += [(g.parent.name or g.name, g, given.accuracy, given.strain) for g in given.grains]
    table = []
    for name, grains, accuracy, strain in tests:
        rows, _ = run(name, grains, folder, accuracy, strain, given.ranks)
        for label, unit, predicted, actual in rows:
            table.append((name, given.ranks, label, unit, predicted, actual, predicted / actual))
            print(
                f"{name:12} {label:12} predicted {predicted:10.4g} {unit:3} actual "
                f"{actual:10.4g} {unit:3} ratio {predicted / actual:5.2f}", flush=True,
            )  # fmt: skip
    with (folder / "plan_check.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["sample", "ranks", "quantity", "unit", "predicted", "actual", "ratio"])
        writer.writerows(table)


if __name__ == "__main__":
    main()
