"""Balls that are pressed, elastic ones and ones that flow, and an impact, in other programs.

The half balls of the cases hertz-point and plastic-sphere-point, with the same mesh and approach:
static increments in CalculiX (C3D4 and C3D10, penalty), Akantu (linear tetrahedra, penalty at
nodes) and Kratos (linear tetrahedra, mortar contact by augmented Lagrangian); and two balls head on
in YADE, whose balls do not deform. Errors and times of the processor stand beside ours.

What is not there is left out, and said: `ccx` and `yade` on the path (Debian: calculix-ccx,
yade), Akantu and Kratos in the interpreter of `--python` (PyPI: akantu; KratosMultiphysics and its
applications StructuralMechanics, ContactStructuralMechanics, LinearSolvers, ConstitutiveLaws). The
decks of CalculiX are written anyway.

    python demos/peers.py FOLDER                         minutes
    python demos/peers.py FOLDER --python OTHER/bin/python
    python demos/peers.py FOLDER --sizes 1.5 --cases hertz
"""

import argparse
import csv
import json
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import numpy as np
from mpi4py import MPI
from peer_programs import calculix
from peer_programs.ball import NU, RADIUS, E, make_ball

from mufe_fenicsx.analysis.evidence import command_of
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.theory import hertz
from mufe_fenicsx.verification.charts.points import (
    course_error,
    finite_size,
    flowing_ball,
    flowing_error,
    hertz_point,
    impact_error,
    impact_point,
    plastic_sphere_point,
)
from mufe_fenicsx.verification.impact import QUARTZ, contact_time, impact_theory
from mufe_fenicsx.verification.plastic_sphere import RHO, approach_for

SIZES, INCREMENTS = (1.5, 2.5), {"hertz": 10, "plastic-sphere": 20}
#: Contact radius over that of the ball; E/Y of the one that flows.
A_OVER_R, RATIO = {"hertz": 0.02, "plastic-sphere": 0.1}, 1000.0
#: Processor time that a program may take for one computation [s].
LIMIT_S = 900
#: Speed of the impact against the plane between [m/s], and steps of YADE during it.
SPEED, STEPS = 10.0, 400
PROGRAMS = Path(__file__).parent / "peer_programs"
#: What needs which module of Python.
MODULES = {"Akantu C3D4": ("akantu", "akantu_ball.py"),
           "Kratos C3D4": ("KratosMultiphysics.ContactStructuralMechanicsApplication",
                           "kratos_ball.py")}  # fmt: skip


def scene(case, n):
    """The :class:`~peer_programs.ball.Ball` of a case at n elements per contact radius."""
    part = A_OVER_R[case]
    if case == "hertz":
        return make_ball(n, part, part**2 * RADIUS)
    material = J2(E, NU, RHO, ((0.0, E / RATIO),))
    approach = approach_for(part * RADIUS * (1 + 0.5 / n), material)
    return make_ball(n, part, approach, E / RATIO)


def error_of(case, ball, forces):
    """Error of forces along the course, as that of ours."""
    approach = ball.approach * np.arange(1, len(forces) + 1) / len(forces)
    if case == "plastic-sphere":
        return flowing_error(flowing_ball(NU), approach, forces)
    theory = hertz.hertz_force(approach, RADIUS, hertz.effective_modulus((E, NU)))
    return course_error(approach, forces, theory * finite_size(approach, NU))


def ours(case, n):
    """(name, parameters) of computations here."""
    if case == "impact":
        return [("ours, 5 % of mass", {"added_mass": 0.05}), ("ours, rigid", {"fidelity": "rigid"})]
    return [("ours, 5 % of mass", {"added_mass": 0.05}), ("ours, static", {"integrator": "static"})]


def script(python, name, *arguments):
    """What a script of `peer_programs` prints in its last line of JSON.

    Raises:
        RuntimeError: It did not come to its end, or took longer than ``LIMIT_S``.
    """
    done = subprocess.run(
        [*python, str(PROGRAMS / name), *map(str, arguments)],
        capture_output=True, text=True, check=False, env={**os.environ, "OMP_NUM_THREADS": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S)),
    )  # fmt: skip
    for line in reversed(done.stdout.splitlines()):
        line = line.removeprefix("RESULT ")
        if line.startswith("{"):
            return json.loads(line)
    raise RuntimeError(f"{name}: {(done.stderr or done.stdout).strip()[-80:]}")


def has_module(python, name):
    """Whether an interpreter finds a module."""
    code = f"import importlib.util as u; raise SystemExit(u.find_spec({name!r}) is None)"
    return not subprocess.run([python, "-c", code], capture_output=True, check=False).returncode


def pressed(case, n, folder, python, keep, say):
    """A ball of a case in CalculiX, Akantu and Kratos, each where it is there."""
    ball, increments = scene(case, n), INCREMENTS[case]
    stem = folder / f"{case}_{n:g}"
    ball.save(stem.with_name(stem.name + ".npz"))
    for order in (1, 2):
        deck = stem.with_name(f"{stem.name}_{order}.inp")
        calculix.write_deck(deck, ball, increments, order)
        if shutil.which("ccx"):
            name = "CalculiX C3D10" if order == 2 else "CalculiX C3D4"
            keep(name, len(ball.cells), lambda deck=deck: calculix.run_deck(deck, LIMIT_S),
                 lambda forces: error_of(case, ball, forces))  # fmt: skip
    for name, (module, file) in MODULES.items():
        try:
            there = has_module(python, module)
        except OSError:
            there = False
        if not there:
            say(f"{name.split()[0]} is not in {python}: left out")
            continue

        def run(file=file):
            found = script([python], file, stem.with_name(stem.name + ".npz"), increments)
            return np.array(found["forces"]), found["seconds"]

        keep(name, len(ball.cells), run, lambda forces: error_of(case, ball, forces))


def impact(folder, keep):
    """Two balls head on in YADE: by symmetry each meets a plane between."""
    mass = 4 / 3 * np.pi * RADIUS**3 * QUARTZ.rho
    theory = impact_theory(mass, SPEED)[0]
    gap = 0.02 * theory.approach
    given = {"radius": RADIUS, "speed": SPEED, "E": QUARTZ.E, "nu": QUARTZ.nu, "rho": QUARTZ.rho,
             "gap": gap, "duration": 1.2 * theory.time + gap / SPEED,
             "time_step": theory.time / STEPS}  # fmt: skip
    path = folder / "impact.json"
    path.write_text(json.dumps(given))

    def run():
        found = script(["yade", "-n", "-x"], "yade_impact.py", path)
        return found, found["seconds"]

    def error(found):
        time, force = np.array(found["time"]), np.array(found["force"])
        # Of both balls: half of the approach of centres is that against the plane.
        way = 0.5 * max(found["approach"])
        timed = contact_time(time, force)
        return impact_error(mass, SPEED, *np.atleast_1d(timed, force.max(), way,
                                                        found["restitution"]))  # fmt: skip

    keep("YADE, rigid", 0, run, error)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sizes", type=float, nargs="+", default=SIZES,
                        help="elements per contact radius")  # fmt: skip
    cases = ("hertz", "plastic-sphere", "impact")
    parser.add_argument("--cases", nargs="+", default=cases, choices=cases)
    parser.add_argument("--python", default=sys.executable, help="interpreter with the others")
    given = parser.parse_args()
    folder = given.folder
    folder.mkdir(parents=True, exist_ok=True)
    rows = []

    def say(text):
        print(text, flush=True)

    def keeper(case, n):
        def keep(name, cells, run, error):
            """A computation, its error and time, or why there is none."""
            try:
                found, seconds = run()
            except RuntimeError as reason:
                say(f"{case:15} {n:4g} per radius {name:18} {reason}")
                return
            row = (case, n, name, cells, float(error(found)), seconds)
            rows.append(row)
            say(f"{case:15} {n:4g} per radius {name:18} {cells:7d} elements  "
                f"error {100 * row[4]:6.2f} %  {seconds:8.3f} s")  # fmt: skip

        return keep

    for case in given.cases:
        for n in given.sizes:
            keep = keeper(case, n)
            for name, more in ours(case, n):
                parameters = {"elements_per_radius": n, **more}
                for _ in range(2):  # kernels are compiled or read at their first use
                    answer = OURS[case](MPI.COMM_SELF, **parameters)
                results = answer["results"]
                # Of the force alone, as theirs.
                error = results["error"]["computed"]
                seconds = results["time of the processor [s]"]["computed"]
                keep(name, answer["num_cells"], lambda e=error, s=seconds: (e, s), float)
                say(f"{'':16}{command_of(case, parameters)}")
            if case != "impact":
                pressed(case, n, folder, given.python, keep, say)
        if case == "impact" and shutil.which("yade"):
            impact(folder, keeper(case, 0))
    for name in ("ccx", "yade"):
        if not shutil.which(name):
            say(f"{name} is not on the path: what it would do is left out")
    with (folder / "peers.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", "elements_per_radius", "program", "elements", "error", "seconds"])
        writer.writerows(rows)


OURS = {"hertz": hertz_point, "plastic-sphere": plastic_sphere_point, "impact": impact_point}

if __name__ == "__main__":
    main()
