"""The pressed ball as a deck of CalculiX: static, surface-to-surface penalty contact."""

import resource
import subprocess

import numpy as np

#: Stiffness of the penalty over E/h, h the length of edges in the contact.
PENALTY = 50.0
#: Edges whose middles are nodes 5 to 10 of C3D10, by their corners.
MIDDLES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))


def second_order(points, cells):
    """Nodes and the ten of each tetrahedron; middles of edges on the surface stay on facets."""
    ends = np.sort(cells[:, MIDDLES].reshape(-1, 2), axis=1)
    edges, inverse = np.unique(ends, axis=0, return_inverse=True)
    middles = inverse.reshape(-1, 6) + len(points)
    return np.vstack([points, points[edges].mean(axis=1)]), np.hstack([cells, middles])


def write_deck(path, ball, increments, order):
    """Write a deck for a :class:`~.ball.Ball`; elements of the first or second order."""
    points, cells, base = ball.points, ball.cells, ball.base
    if order == 2:
        points, cells = second_order(points, cells)
        base = np.flatnonzero(points[:, 2] < points[base, 2].max() + 1e-12)
    top, half = ball.top, ball.half
    first = len(points) + 1
    block = [(x, y, z) for z in (top, top + half) for x, y in
             ((-half, -half), (half, -half), (half, half), (-half, half))]  # fmt: skip
    lines = ["*NODE, NSET=BALL"]
    lines += [f"{k}, {x:.10e}, {y:.10e}, {z:.10e}" for k, (x, y, z) in enumerate(points, 1)]
    lines += ["*NODE, NSET=BLOCK"]
    lines += [f"{k}, {x:.10e}, {y:.10e}, {z:.10e}" for k, (x, y, z) in enumerate(block, first)]
    lines += [f"*ELEMENT, TYPE=C3D{10 if order == 2 else 4}, ELSET=BALL"]
    lines += [", ".join(map(str, [k, *(c + 1)])) for k, c in enumerate(cells, 1)]
    last = len(cells) + 1
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=BLOCK",
              ", ".join(map(str, [last, *range(first, first + 8)]))]  # fmt: skip
    lines += ["*NSET, NSET=BASE", *(f"{k + 1}," for k in base)]
    lines += ["*SURFACE, NAME=POLE, TYPE=ELEMENT"]
    lines += [f"{cell + 1}, S{face + 1}" for cell, face in ball.facets]
    lines += ["*SURFACE, NAME=PLANE, TYPE=ELEMENT", f"{last}, S1"]
    elastic = ["*ELASTIC", f"{ball.E:g}, {ball.nu:g}"]
    flow = ["*PLASTIC", f"{ball.yield_stress:g}, 0."] if np.isfinite(ball.yield_stress) else []
    lines += ["*MATERIAL, NAME=ROCK", *elastic, *flow, "*MATERIAL, NAME=STEEL", *elastic,
              "*SOLID SECTION, ELSET=BALL, MATERIAL=ROCK",
              "*SOLID SECTION, ELSET=BLOCK, MATERIAL=STEEL",
              "*SURFACE INTERACTION, NAME=TOUCH",
              "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{PENALTY * ball.E / ball.h:g}",
              "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", "POLE, PLANE",
              "*BOUNDARY", "BASE, 1, 3", f"*STEP, NLGEOM, INC={10 * increments}",
              "*STATIC, DIRECT", f"{1 / increments:g}, 1.",
              "*BOUNDARY", "BLOCK, 1, 2", f"BLOCK, 3, 3, {-ball.approach:.10g}",
              "*NODE PRINT, NSET=BASE, TOTALS=ONLY", "RF", "*END STEP"]  # fmt: skip
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def run_deck(path, limit_s):
    """Force on the base after each increment [N] and time of the processor [s].

    Raises:
        RuntimeError: CalculiX did not come to its end, or took longer than ``limit_s`` [s].
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run(
        ["ccx", path.stem], cwd=path.parent, capture_output=True, text=True,
        env={"OMP_NUM_THREADS": "1", "PATH": "/usr/bin:/bin"}, check=False,
        # Of the processor: on a busy machine clocks on the wall say nothing.
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s)),
    )  # fmt: skip
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    table = path.with_suffix(".dat")
    if done.returncode or not table.is_file():
        raise RuntimeError(f"ccx {path.stem}: {(done.stdout + done.stderr).strip()[-80:]}")
    rows = [line.split() for line in table.read_text().splitlines()]
    forces = [abs(float(row[2])) for row in rows if len(row) == 3 and _is_number(row[2])]
    return np.array(forces), seconds


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True
