"""What does accuracy cost? Each choice of model charted, error against time.

For a plane on an elastic ball (hertz), two sheared balls (mindlin), impacts of balls (impact), a
ball that flows (plastic-sphere), twenty angular grains in an oedometer (oedometer), twenty
polyhedra that fill one (jammed), a ball in a cylinder (cylinder-wall) and under a tool (tool) and a
rubber tube (membrane), over

- the mesh;
- the element: plain linear, averaged pressure;
- the law of contact: layer matched to the mesh, stiff penalty, kinematic, at facets or nodes;
- the time step: of the assembled system or of single elements; mass added; increments;
- the speed of loading; rigid, elastic, elasto-plastic grains.

Each point is one command, `mufe verify CASE-point --set …`, which stands in the table beside its
error and its cost. Figures show the front of what no other choice beats, and the seed's method
(plain linear elements, the time step of single ones) as a line of its own.

    python demos/speed_accuracy.py FOLDER                 some twenty minutes of one processor
    python demos/speed_accuracy.py FOLDER --full          hours: finer, all lines on all meshes
    python demos/speed_accuracy.py FOLDER --store         keep the rows of these cases as what
                                                          `mufe plan` reads
    python demos/speed_accuracy.py FOLDER --reference     first the courses of stress that those of
                                                          the oedometers are compared with, an hour
    python demos/speed_accuracy.py FOLDER --minutes 5     stop then; the same command goes on
    python demos/speed_accuracy.py FOLDER --geometry      nothing else: how the twenty grains differ
                                                          before any load, from mesh to mesh
"""

import argparse
import csv
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import numpy as np
from mpi4py import MPI

from mufe_fenicsx.analysis.evidence import (
    JAMMED,
    REFERENCE,
    TABLE,
    columns_of,
    distance,
    read_curve,
    read_points,
    write_points,
)
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.materials.sand import SAND
from mufe_fenicsx.run.from_bodies import axis_planes, build
from mufe_fenicsx.verification.charts.grid import CHARTS
from mufe_fenicsx.verification.charts.make import make_charts
from mufe_fenicsx.verification.charts.points import (
    COUNTS,
    FRICTION,
    STRAIN,
    jammed_column,
    press_grains,
    press_polyhedra,
)
from mufe_fenicsx.verification.packing import angular_grains

#: Length of edges over half of the distance of grains, and loading, of the references; and of
#: others that tell how far they are converged.
FINE = {"oedometer": (0.2, 4.0), "jammed": (0.25, 8.0)}
CHECKS = {"oedometer": ((0.25, 4.0),), "jammed": ((0.35, 8.0), (0.25, 4.0), (0.25, 2.0))}
PATHS = {"oedometer": REFERENCE, "jammed": JAMMED}
#: Friction and sample of the tests of the polyhedra: that of the table first.
TESTS = {
    "oedometer": ((FRICTION, None),),
    "jammed": (
        (FRICTION, 3), (0.1, 3), (0.4, 3), (FRICTION, 5), (FRICTION, 6), (FRICTION, 9),
        (FRICTION, 12), (0.3, 2),
    ),
}  # fmt: skip
#: Strains at which references are stored.
GRID = np.linspace(0.0, STRAIN, 81)


def press(case, size, loading, friction, sample):
    """Stress at the strains of ``GRID`` [Pa]."""
    if case == "oedometer":
        course = press_grains(MPI.COMM_SELF, size, loading=loading)
    else:
        course = press_polyhedra(MPI.COMM_SELF, size, "j2", loading, friction, sample)
    s = course.simulation
    print(
        f"{case}, friction {friction:g}, sample {sample}, edges {size:g}, loading {loading:g}: "
        f"{s.mesh.num_cells} tets, {s.state.num_steps} steps, {course.processor_s:.0f} s",
        flush=True,
    )
    return np.interp(GRID, course.strain, course.stress)


def write_reference(case, jobs):
    """Press the twenty grains on the finest mesh, and on those that tell how far that is right.

    Columns that are there stay; to have them anew, remove the file.
    """
    size, loading = FINE[case]
    made = [
        "made by demos/speed_accuracy.py --reference: stress of 20 grains on a mesh of",
        f"edges {size:g} over half of their distance, loading = {loading:g}",
    ]
    names = {
        test: "stress" if case == "oedometer" else jammed_column(*test) for test in TESTS[case]
    }
    known, head = {}, []
    if PATHS[case].exists():
        head = read_curve(PATHS[case], names[TESTS[case][0]])[2]
        if head[:2] == made:
            known = {n: read_curve(PATHS[case], n)[1] for n in columns_of(PATHS[case])}
    first = names[TESTS[case][0]]
    wanted = [test for test in TESTS[case] if names[test] not in known]
    tests = [(case, *FINE[case], *test) for test in wanted]
    if first not in known:
        tests += [(case, *check, *TESTS[case][0]) for check in CHECKS[case]]
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        columns = list(pool.map(press, *zip(*tests, strict=True))) if tests else []
    known |= {names[test]: column for test, column in zip(wanted, columns, strict=False)}
    if first in [names[test] for test in wanted]:
        head = made
        for (size, loading), column in zip(CHECKS[case], columns[len(wanted) :], strict=True):
            off = distance(column[10::10], known[first][10::10])
            head.append(f"edges {size:g}, loading = {loading:g}: {off:.4f} from the first")
    with PATHS[case].open("w", encoding="utf-8", newline="") as file:
        file.writelines(f"# {line}\n" for line in head)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["strain", *names.values()])
        rows = zip(GRID, *(known[name] for name in names.values()), strict=True)
        writer.writerows([f"{value:.6g}" for value in row] for row in rows)
    print("\n".join([f"{PATHS[case]}:", *head]))


def print_geometry(sizes=(0.8, 0.5, 0.35, 0.25, 0.2)):
    """Of the oedometer's sample on each mesh: what is there before anything is loaded."""
    for size in sizes:
        bodies = angular_grains(COUNTS, size, gap=0.0)
        mesh = build(MPI.COMM_SELF, bodies, SAND, np.zeros(3), np.zeros(3), axes="").mesh
        low, high = mesh.x.min(axis=0), mesh.x.max(axis=0)
        walls = [Wall(name, *plane) for name, plane in axis_planes(low, high).items()]
        s = Simulation(mesh, [SAND] * mesh.num_grains, walls)
        solid = s.solid.volume0.sum() / np.prod(high - low)
        print(f"edges {size:4g}: {mesh.num_cells:6d} tets, {100 * solid:.1f} % solid", flush=True)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--store", action="store_true", help="keep the table in the package")
    parser.add_argument(
        "--reference", action="store_true", help="compute those of the oedometers first"
    )
    parser.add_argument("--geometry", action="store_true", help="of the oedometer's sample only")
    parser.add_argument("--jobs", type=int, default=1, help="references at a time")
    parser.add_argument("--minutes", type=float)
    parser.add_argument("--cases", nargs="*", default=list(CHARTS), choices=list(CHARTS))
    given = parser.parse_args()
    if given.geometry:
        print_geometry()
        return
    if given.reference:
        for case in FINE.keys() & given.cases:
            write_reference(case, given.jobs)
    made = make_charts(given.cases, given.folder, full=given.full, minutes=given.minutes)
    for case, rows in made["gains"].items():
        for error, ours, front in rows:
            print(f"{case:15} at {100 * error:.3g} %: the seed's method costs {ours:5.3g} times as "
                  f"much as the default, {front:5.3g} times as much as the best")  # fmt: skip
    if given.store:
        others = [point for point in read_points() if point.case not in given.cases]
        write_points(TABLE, [*others, *read_points(made["table"])])
        print(f"stored: {TABLE}")


if __name__ == "__main__":
    main()
