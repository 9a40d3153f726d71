"""The ball of the case hertz-point in another program: CalculiX, where `ccx` is installed.

The same half ball, mesh and approach, static, with surface-to-surface penalty contact against a
block that does not deform: linear tetrahedra (C3D4) and those of second order (C3D10). Error of the
force along the course and time, beside ours. Where `ccx` is not on the path (Debian: package
calculix-ccx) the decks are written, and nothing is run.

    python demos/peers.py FOLDER              a minute
"""

import argparse
import csv
import resource
import shutil
import subprocess
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import numpy as np
from mpi4py import MPI

from mufe_fenicsx.charts.cases import course_error, finite_size, hertz_point
from mufe_fenicsx.evidence import command_of
from mufe_fenicsx.geometry.half_ball import half_ball
from mufe_fenicsx.geometry.refine import EDGES
from mufe_fenicsx.theory import hertz

E, NU, RADIUS, A_OVER_R, GROWTH = 100e9, 0.15, 1e-3, 0.02, 0.3
SIZES, INCREMENTS = (1.5, 2.5, 4.0), 10
#: Stiffness of the penalty over E/h, h the length of edges in the contact.
PENALTY = 50.0
#: Processor time that CalculiX may take for one deck [s].
LIMIT_S = 600
#: Corners of the faces of a tetrahedron as CalculiX numbers them, S1 to S4.
FACES = ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3))
#: Edges whose middles are nodes 5 to 10 of C3D10, by their corners.
MIDDLES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))


def second_order(points, cells):
    """Nodes and the ten of each tetrahedron; middles of edges on the surface stay on facets."""
    ends = np.sort(cells[:, EDGES].reshape(-1, 2), axis=1)
    edges, inverse = np.unique(ends, axis=0, return_inverse=True)
    number = inverse.reshape(-1, 6) + len(points)
    column = {tuple(edge): k for k, edge in enumerate(EDGES.tolist())}
    middles = number[:, [column[edge] for edge in MIDDLES]]
    return np.vstack([points, points[edges].mean(axis=1)]), np.hstack([cells, middles])


def write_deck(path, elements_per_radius, order):
    """Write a deck for CalculiX; returns the number of elements."""
    a = A_OVER_R * RADIUS
    h = a / elements_per_radius
    slope = GROWTH * 2.5 / elements_per_radius
    points, cells = half_ball(RADIUS, h, slope, (0.0, 0.0, 1.0), a, 0.4 * RADIUS)
    corners = cells
    base = points[:, 2] < points[:, 2].min() + 1e-6 * RADIUS
    if order == 2:
        points, cells = second_order(points, cells)
        base = points[:, 2] < points[:, 2].min() + 1e-6 * RADIUS
    top, half = points[:, 2].max(), 4 * a
    first = len(points) + 1
    block = [(x, y, z) for z in (top, top + a) for x, y in
             ((-half, -half), (half, -half), (half, half), (-half, half))]  # fmt: skip
    # Facets near the pole: those that belong to one tetrahedron only.
    facets = np.sort(corners[:, FACES].reshape(-1, 3), axis=1)
    _, inverse, count = np.unique(facets, axis=0, return_inverse=True, return_counts=True)
    outer = (count[inverse.ravel()] == 1).reshape(-1, 4)
    middle = points[corners[:, FACES]].mean(axis=2)
    near = outer & (np.linalg.norm(middle - [0, 0, top], axis=2) < 3 * a)
    lines = ["*NODE, NSET=BALL"]
    lines += [f"{k + 1}, {x:.10e}, {y:.10e}, {z:.10e}" for k, (x, y, z) in enumerate(points)]
    lines += ["*NODE, NSET=BLOCK"]
    lines += [f"{first + k}, {x:.10e}, {y:.10e}, {z:.10e}" for k, (x, y, z) in enumerate(block)]
    lines += [f"*ELEMENT, TYPE=C3D{10 if order == 2 else 4}, ELSET=BALL"]
    lines += [", ".join(map(str, [k + 1, *(c + 1)])) for k, c in enumerate(cells)]
    last = len(cells) + 1
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=BLOCK",
              ", ".join(map(str, [last, *range(first, first + 8)]))]  # fmt: skip
    lines += ["*NSET, NSET=BASE", *(f"{k + 1}," for k in np.flatnonzero(base))]
    lines += ["*SURFACE, NAME=POLE, TYPE=ELEMENT"]
    lines += [f"{cell + 1}, S{face + 1}" for cell, face in np.argwhere(near)]
    lines += ["*SURFACE, NAME=PLANE, TYPE=ELEMENT", f"{last}, S1"]
    lines += ["*MATERIAL, NAME=ROCK", "*ELASTIC", f"{E:g}, {NU:g}",
              "*SOLID SECTION, ELSET=BALL, MATERIAL=ROCK",
              "*SOLID SECTION, ELSET=BLOCK, MATERIAL=ROCK",
              "*SURFACE INTERACTION, NAME=TOUCH",
              "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{PENALTY * E / h:g}",
              "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", "POLE, PLANE",
              "*BOUNDARY", "BASE, 1, 3", "*STEP, NLGEOM, INC=100", "*STATIC, DIRECT",
              f"{1 / INCREMENTS:g}, 1.",
              "*BOUNDARY", "BLOCK, 1, 2", f"BLOCK, 3, 3, {-(A_OVER_R**2) * RADIUS:g}",
              "*NODE PRINT, NSET=BASE, TOTALS=ONLY", "RF", "*END STEP"]  # fmt: skip
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return len(cells)


def run_deck(path):
    """Force on the base after each increment [N] and time of the processor [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run(
        ["ccx", path.stem], cwd=path.parent, capture_output=True, text=True,
        env={"OMP_NUM_THREADS": "1", "PATH": "/usr/bin:/bin"}, check=False,
        # Of the processor: on a busy machine clocks on the wall say nothing.
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S)),
    )  # fmt: skip
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    table = path.with_suffix(".dat")
    if done.returncode or not table.is_file():
        raise RuntimeError(f"ccx {path}: {(done.stdout + done.stderr)[-300:]}")
    rows = [line.split() for line in table.read_text().splitlines()]
    forces = [abs(float(row[2])) for row in rows if len(row) == 3 and _is_number(row[2])]
    return np.array(forces), seconds


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sizes", type=float, nargs="+", default=SIZES,
                        help="elements per contact radius")  # fmt: skip
    given = parser.parse_args()
    folder = given.folder
    folder.mkdir(parents=True, exist_ok=True)
    found = shutil.which("ccx")
    approach = A_OVER_R**2 * RADIUS * np.arange(1, INCREMENTS + 1) / INCREMENTS
    theory = hertz.hertz_force(approach, RADIUS, hertz.effective_modulus((E, NU)))
    theory *= finite_size(approach, NU)
    rows = []

    def keep(*row):
        rows.append(row)
        print(
            f"{row[0]:18} {row[1]:4g} per radius {row[2]:7d} elements  "
            f"error {100 * row[3]:6.2f} %  {row[4]:7.2f} s", flush=True,
        )  # fmt: skip

    for n in given.sizes:
        for order in (1, 2):
            path = folder / f"hertz_{n:g}_{order}.inp"
            number = write_deck(path, n, order)
            if not found:
                continue
            force, seconds = run_deck(path)
            error = course_error(approach, force, theory)
            keep("CalculiX C3D10" if order == 2 else "CalculiX C3D4", n, number, error, seconds,
                 f"ccx {path.stem}")  # fmt: skip
        for name, more in (("ours, time steps", {"added_mass": 0.05}),
                           ("ours, static", {"integrator": "static"})):  # fmt: skip
            parameters = {"elements_per_radius": n, **more}
            answer = hertz_point(MPI.COMM_SELF, **parameters)
            values = [
                answer["results"][k]["computed"] for k in ("error", "time of the processor [s]")
            ]
            keep(name, n, answer["num_cells"], *values, command_of("hertz", parameters))
    with (folder / "peers.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["program", "elements_per_radius", "elements", "error", "seconds", "command"]
        )
        writer.writerows(rows)
    if not found:
        print(f"ccx is not on the path: decks are in {folder}, CalculiX was not run")


if __name__ == "__main__":
    main()
