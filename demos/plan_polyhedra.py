"""Does the plan of a whole sample keep its accuracy? Twenty polyhedra with a known answer.

The polyhedra of the case jammed-point are a scene here: `mufe plan` knows nothing of that case,
only of single contacts, and asks for edges, speed and added mass. The grains are meshed as the plan
asks, run as `mufe run` would, and the stress over strain is held against the stored reference.

    python demos/plan_polyhedra.py FOLDER                         10 %, some minutes
    python demos/plan_polyhedra.py FOLDER --accuracy 0.2 0.1 0.05     half an hour
"""

import argparse
import csv
import time
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import numpy as np
from mpi4py import MPI

from mufe_fenicsx.analysis.evidence import JAMMED, distance, read_curve
from mufe_fenicsx.geometry.grains import Grains, save_grains
from mufe_fenicsx.materials.sand import scene_table
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.planning.run import make_plan, planned_scene
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.run.scene_file import read_scene
from mufe_fenicsx.verification.charts.points import FRICTION, PARTS, STRAIN, jammed_column
from mufe_fenicsx.verification.polyhedra import polyhedral_grains

#: Half of the distance of grains [m], and edges of the mesh that the first plan is made with, over
#: that.
RADIUS, FIRST = 1e-3, 0.7
SCENE = """accuracy = {accuracy:g}

{material}
[contact]
friction = {friction:g}

[oedometer]
strain = {strain:g}
speed = "1 m/s"
seating_stress = "2 MPa"
seating_speed = "0.6 m/s"

[output]
fields = 5
history = 201
"""


def save(folder, size, inner=1.0):
    """The polyhedra with edges of ``size`` and, inside, ``inner`` times that [m]."""
    bodies = polyhedral_grains(size / RADIUS, radius=RADIUS, inner=inner)
    save_grains(folder, Grains.from_list(np.arange(1, len(bodies) + 1), bodies, size))


def follow(folder, accuracy):
    """Plan, mesh and run; a row of numbers."""
    comm, folder = MPI.COMM_SELF, folder / f"{accuracy:g}"
    folder.mkdir(parents=True, exist_ok=True)
    path, grains = folder / "scene.toml", folder / "grains"
    path.write_text(
        SCENE.format(accuracy=accuracy, material=scene_table(), friction=FRICTION, strain=STRAIN),
        encoding="utf-8",
    )
    scene = read_scene(comm, path)
    save(grains, FIRST * RADIUS)
    plan, _ = make_plan(scene, grains, comm, measure=False)
    if plan.mesh_again:
        save(grains, plan.size, max(plan.inner_size / plan.size, 1.0))
    planned, after = planned_scene(scene, grains, comm)
    began = time.process_time()
    summary = run_scene(
        planned, grains, folder / "run", comm, overwrite=True, quiet=True, after=after
    )
    seconds = time.process_time() - began
    history = read_history(folder / "run" / "history.csv")
    on = history["stage"] == "loading"
    force = (history["force_z_min"] + history["force_z_max"])[on]
    known, stress, _ = read_curve(JAMMED, jammed_column())
    at = PARTS * STRAIN
    found = np.interp(at, history["strain"][on], 0.5 * force / summary["area"])
    error = float(distance(found, np.interp(at, known, stress)))
    speed, line = plan.settings.get("oedometer.speed"), summary["predicted_and_actual"]
    n, cells = plan.elements_per_radius, summary["num_cells"]
    return accuracy, error, n, cells, summary["num_steps"], seconds, speed, line


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--accuracy", type=float, nargs="+", default=[0.1])
    given = parser.parse_args()
    table = []
    for accuracy in given.accuracy:
        table.append(follow(given.folder, accuracy))
        wanted, error, n, cells, steps, seconds, speed, line = table[-1]
        print(
            f"wanted {wanted:.0%}: error {error:.2%}, {n:.2g} elements per contact radius, {cells} "
            f"tets, {steps} steps at {speed} m/s, {seconds:.0f} s of a processor; {line}",
            flush=True,
        )
    with (given.folder / "plan_polyhedra.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["accuracy", "error", "elements_per_radius", "tetrahedra", "steps",
                         "seconds", "speed", "predicted and actual"])  # fmt: skip
        writer.writerows(table)
    assert all(row[1] <= row[0] for row in table), "a plan did not keep its accuracy"


if __name__ == "__main__":
    main()
