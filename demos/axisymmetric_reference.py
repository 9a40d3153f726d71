"""Balls under a rigid plane by axisymmetric finite elements: the reference, and how it is made.

    python demos/axisymmetric_reference.py FOLDER          about four minutes on one core
    python demos/axisymmetric_reference.py FOLDER --quick  coarse, ten seconds

Hertz and Jackson & Green tell what a ball should do to some percent: one leaves out its finite
size and large strain, the others fitted a formula to finite elements. Here the same balls as in
`mufe verify hertz plastic-sphere paper-sphere` are pressed by a method that shares nothing with
the three-dimensional one but the material law on paper: displacements of second order with a
pressure of first order (Taylor & Hood), curved edges, equilibrium by Newton's method, and a plane
that no node passes. Results of balls that yield are drawn on to steps of no length. Meshes and
steps are halved to see how far the result is converged.

Writes FOLDER/axisymmetric.csv, which the package keeps a copy of
(mufe_fenicsx/verification/reference), and a picture. With --quick the result is compared
with that copy instead.
"""

import argparse
import sys
import time
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib
import numpy as np

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.theory import finite_sphere, plastic_contact
from mufe_fenicsx.verification import reference
from mufe_fenicsx.verification.axisymmetric import cases as cases

#: Of --quick: part of edges and steps, and the error of the force that they leave.
QUICK = (0.5, 0.02)


def make(quick):
    """Courses by name."""
    courses = {}
    chosen = cases.all_cases()
    if quick:
        chosen = [cases.elastic(0.04, 0.15, False), cases.perfect(100, 0.15)]
    for case in chosen:
        start = time.perf_counter()
        course = cases.checked(case, QUICK[0] if quick else 1.0)
        courses[case.name] = course
        print(
            f"{case.name}: δ/R {course['delta'][-1]:.3e}, F/ER² {course['force'][-1]:.5e}; change "
            f"from the coarser mesh: force {course.change('force').max():.2%}, radius "
            f"{course.change('radius').max():.2%}, p0 {course.change('p0').max():.2%}; "
            f"{time.perf_counter() - start:.0f} s",
            flush=True,
        )
    return courses


def compare(courses, tolerance):
    """Against the stored ones; True if all agree."""
    worst = 0.0
    for name, course in courses.items():
        stored = reference.load()[name]
        # Steps end at the same approach.
        error = abs(course["force"][-1] / stored["force"][-1] - 1)
        print(f"{name}: force off the stored one by {error:.2%}")
        worst = max(worst, error)
    return worst <= tolerance


def draw(courses, path):
    """Elastic balls over Hertz; mean pressure of yielding ones; the paper's balls."""
    with matplotlib.rc_context(style.RC):
        figure, (left, middle, right) = style.new_figure(style.PAGE, 2.5, ncols=3)
        for nu, colour in ((0.15, style.BLUE), (0.3, style.RED)):
            a = np.geomspace(0.01, 0.2, 12)
            theory = [finite_sphere.compression(float(x), nu)[:2] for x in a]
            ratio = [force / (4 / 3 * delta**1.5) for delta, force in theory]
            left.semilogx(a, ratio, color=colour, label=f"series, ν = {nu}")
            for finite, mark in ((False, "o"), (True, "x")):
                found = [
                    (x, course["force"][0] * (1 - nu**2) / (4 / 3 * course["delta"][0] ** 1.5))
                    for x in (0.005, 0.04, 0.16)
                    if (course := courses.get(reference.elastic_name(x, nu, finite)))
                ]
                if found:
                    left.semilogx(*np.transpose(found), mark, ms=4, mfc="none", color=colour,
                                  label="large strain" if finite else "linear")  # fmt: skip
            for E_over_Y, line in ((100, "--"), (1000, "-")):
                course = courses.get(reference.perfect_name(E_over_Y, nu))
                if course is None:
                    continue
                label = f"E/Y = {E_over_Y}, ν = {nu}"
                middle.plot(course["radius"], course.mean_pressure() * E_over_Y, line,
                            color=colour, label=label)  # fmt: skip
                force, radius = plastic_contact.jackson_green(
                    course["delta"], 1.0, 1 / (1 - nu**2), 1 / E_over_Y, nu
                )
                middle.plot(radius, force / (np.pi * radius**2) * E_over_Y, line, lw=0.6,
                            color=style.GREY)  # fmt: skip
        left.set(xlabel="contact radius / R", ylabel="force / force of Hertz")
        middle.set(xlabel="contact radius / R", ylabel="mean pressure / yield stress")
        middle.set(xlim=(0, None), ylim=(0, None))
        for Y, colour in zip(
            cases.YIELD, (style.RED, style.ORANGE, style.BLUE, style.SKY), strict=True
        ):
            if course := courses.get(reference.paper_name(Y)):
                right.plot(1e3 * course["delta"], 1e6 * course["force"], color=colour,
                           label=f"{Y / 1e6:g} MPa")  # fmt: skip
        right.set(xlabel="approach / R (‰)", ylabel="force / E R² (10⁻⁶)")
        for k, axis in enumerate((left, middle, right)):
            style.panel_letter(axis, k)
            if axis.lines:
                axis.legend()
        figure.savefig(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the table and the picture go")
    parser.add_argument("--quick", action="store_true", help="coarse, and compared with the table")
    options = parser.parse_args()
    try:
        options.folder.mkdir(parents=True, exist_ok=True)
        courses = make(options.quick)
        note = (
            f"made by demos/axisymmetric_reference.py{' --quick' if options.quick else ''}: edges "
            "per contact radius, how much shorter on the surface, steps: elastic "
            f"{cases.ELASTIC}, else {cases.PLASTIC}; check columns: half of edges and steps. "
            "Lengths over R, forces over E R^2, stresses over E"
        )
        reference.write(options.folder / "axisymmetric.csv", list(courses.values()), note)
        draw(courses, options.folder / "axisymmetric.png")
    except (InputError, OSError) as error:
        sys.exit(f"error: {error}")
    print(options.folder / "axisymmetric.csv")
    if options.quick and not compare(courses, QUICK[1]):
        sys.exit(f"error: force off the stored one, expected within {QUICK[1]:.1%}")


if __name__ == "__main__":
    main()
