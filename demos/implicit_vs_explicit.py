"""Time steps against increments: the same bodies, meshes and contact, answers and seconds.

Writes a page, implicit_vs_explicit.md, with one table and one figure: each case by damped time
steps and by static increments (the impact by those of the generalised-α method), what theory
says, how far they are apart, and what each took, meshes left out. The figure has the force on the
paper's ball as steps and increments get finer, and the error of a Hertz contact against its cost.

    python demos/implicit_vs_explicit.py FOLDER              about two minutes
    python demos/implicit_vs_explicit.py FOLDER --quick      seconds: coarse, to see that it runs
"""

import argparse
import json
import time
from dataclasses import dataclass
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import numpy as np
from mpi4py import MPI

from mufe_fenicsx.theory import hertz
from mufe_fenicsx.verification.bar_impact import bar_impact
from mufe_fenicsx.verification.hertz import errors_of
from mufe_fenicsx.verification.hertz_bodies import make
from mufe_fenicsx.verification.hertz_stress import profile
from mufe_fenicsx.verification.integrators import BALLS, NU, E, press
from mufe_fenicsx.verification.plastic_ball import RADIUS

COMM = MPI.COMM_SELF


@dataclass(frozen=True)
class Size:
    """How fine everything is."""

    a_over_R: float  #: contact radius over that of the ball in the Hertz contacts
    elements: float  #: per contact radius
    stress: float  #: the same where the stress below a contact is looked at
    periods: float  #: of yielding balls, in which the plane comes in
    increments: int  #: static ones of yielding balls
    courses: tuple  #: (periods, increments or None) of the curves in the figure
    hertz_periods: tuple  #: of the elastic ball in the figure
    hertz_increments: tuple
    divisions: int  #: bricks along each bar
    apart: float  #: how far answers may be apart


FULL = Size(
    0.02, 2.0, 3.0, 160.0, 40, ((20.0, None), (160.0, None), (20.0, 10), (20.0, 20), (20.0, 40)),
    (1.0, 1.5, 3.0, 6.0), (1, 2, 4), 20, 0.02,
)  # fmt: skip
QUICK = Size(0.06, 1.5, 2.0, 20.0, 10, ((20.0, None), (20.0, 10)), (1.5, 3.0), (1, 2), 8, 0.1)


def timed(function, *arguments, **options):
    """What a function gives, and its seconds."""
    start = time.perf_counter()
    found = function(*arguments, **options)
    return found, time.perf_counter() - start


def hertz_contact(size):
    """Force of a ball on a plane over that of linear elasticity, mean over indentations."""
    values, seconds = [], []
    make("sphere-plane", size.elements, size.a_over_R, NU, 0.4)  # meshes are kept
    for integrator in ("explicit", "static"):
        (_, rows), took = timed(
            errors_of, COMM, "sphere-plane", size.elements, size.a_over_R, NU, integrator=integrator
        )
        values.append(float(np.mean(rows["force"])))
        seconds.append(took)
    return row("hertz", "force over that of elasticity", 1.0, values, seconds)


def hertz_stress(size):
    """Largest von Mises stress below it over the largest pressure."""
    values, seconds = [], []
    make("sphere-plane", size.stress, size.a_over_R, NU, 0.5)
    for integrator in ("explicit", "static"):
        axis, took = timed(profile, COMM, size.stress, size.a_over_R, NU, integrator=integrator)
        values.append(float(axis["computed"].max()))
        seconds.append(took)
    return row("hertz-stress", "largest von Mises stress over p0", float(axis["theory"].max()),
               values, seconds)  # fmt: skip


def yielding_ball(name, size):
    """Force at the end, of both over the larger."""
    courses = [press(COMM, name, size.elements, size.periods, n) for n in (None, size.increments)]
    force = [c.force[-1] for c in courses]
    return row(name, "force at the end [N]", None, force, [c.seconds for c in courses])


def plastic_ball(size):
    """A ball without hardening."""
    return yielding_ball("plastic-sphere", size)


def papers_ball(size):
    """A ball that hardens."""
    return yielding_ball("paper-sphere", size)


def impact(size):
    """Velocity of a bar after the impact over that before, by dynamics of both kinds."""
    answers = [
        bar_impact(COMM, divisions=size.divisions, integrator=integrator)
        for integrator in ("explicit", "implicit")
    ]
    name = "velocity of the second bar after over before"
    lines = [a["results"] for a in answers]
    gained = max(line["energy gained"]["computed"] for line in lines)
    assert gained < 1e-3, f"energy gained = {gained}, expected less than 1e-3"
    values = [line[name]["computed"] for line in lines]
    return row("bar-impact", "velocity after over before", 1.0, values,
               [a["wall_s"] for a in answers])  # fmt: skip


def row(case, what, theory, values, seconds):
    """One line of the table."""
    return {
        "case": case,
        "what": what,
        "theory": theory,
        "time_steps": values[0],
        "increments": values[1],
        "apart": abs(values[1] / values[0] - 1),
        "seconds_time_steps": seconds[0],
        "seconds_increments": seconds[1],
    }


def courses(size):
    """Force on the paper's ball over its approach, one dict for each way."""
    found = []
    for periods, increments in size.courses:
        c = press(COMM, "paper-sphere", size.elements, periods, increments)
        found.append(
            {"periods": periods, "increments": increments, "seconds": c.seconds,
             "approach": c.approach.tolist(), "force": c.force.tolist()}
        )  # fmt: skip
    return found


def costs(size):
    """(seconds, force over Hertz's, periods or increments) of the elastic ball, for both ways."""
    ways = {"time steps": [(p, None) for p in size.hertz_periods]}
    ways["static increments"] = [(1.0, n) for n in size.hertz_increments]
    modulus, found = hertz.effective_modulus((E, NU)), {}
    for name, runs in ways.items():
        found[name] = []
        for periods, increments in runs:
            c = press(COMM, "hertz", size.elements, periods, increments)
            # It begins at the highest node, which stands h²/8R above the ball.
            assert c.approach[-1] > 0.98 * BALLS["hertz"][1] * RADIUS
            theory = hertz.hertz_force(c.approach[-1], RADIUS, modulus)
            number = periods if increments is None else increments
            found[name].append((c.seconds, float(c.force[-1] / theory), number))
    return found


def draw(curves, cost, path):
    """Two panels: force over approach, and error over cost."""
    import matplotlib

    from mufe_fenicsx.report.style import (
        BLUE,
        PAGE,
        RC,
        RED,
        new_figure,
        panel_letter,
        plain_log_ticks,
    )

    with matplotlib.rc_context(RC):
        figure, (left, right) = new_figure(PAGE, 0.42 * PAGE, ncols=2)
        finest = [c for c in curves if c["increments"] is None][-1]
        styles = {True: iter((":", "-", "--", "-.")), False: iter((":", "--", "-", "-."))}
        for c in curves:
            steps = c["increments"] is None
            at = np.array(c["approach"])
            on = at > 0.25 * at[-1]
            fine = np.interp(at, finest["approach"], finest["force"])
            label = f"{c['periods']:g} periods" if steps else f"{c['increments']} increments"
            left.plot(1e6 * at[on], 100 * (np.array(c["force"])[on] / fine[on] - 1),
                      color=BLUE if steps else RED, linestyle=next(styles[steps]),
                      label=label)  # fmt: skip
        left.set_xlabel("approach [µm]")
        left.set_ylabel(f"force over that in {finest['periods']:g} periods, less 1 [%]")
        low, high = left.get_ylim()
        left.set_ylim(low - 0.35 * (high - low), high)
        left.legend(loc="lower center", ncols=2)
        at_rest = cost["static increments"][-1][1]
        for (name, points), colour, marker in zip(cost.items(), (BLUE, RED), "os", strict=True):
            seconds, force, numbers = zip(*points, strict=True)
            error = 100 * np.maximum(np.abs(np.array(force) / at_rest - 1), 1e-7)
            shown = slice(None, -1 if name == "static increments" else None)
            right.plot(seconds[shown], error[shown], color=colour, marker=marker, markersize=4,
                       label=name)  # fmt: skip
            for s, e, number in list(zip(seconds, error, numbers, strict=True))[shown]:
                right.annotate(f"{number:g}", (s, e), xytext=(4, 4),
                               textcoords="offset points", fontsize=6, color=colour)  # fmt: skip
        right.set_xscale("log")
        right.set_yscale("log")
        plain_log_ticks(right.xaxis)
        right.set_xlabel("wall time [s]")
        right.set_ylabel("force, away from that at rest [%]")
        right.legend()
        for k, axis in enumerate((left, right)):
            panel_letter(axis, k)
        figure.savefig(path)


def page(rows, size, num_cells, at_rest):
    """The page in Markdown."""
    lines = [
        "# Time steps and increments",
        "",
        "Made by `python demos/implicit_vs_explicit.py FOLDER`. The same bodies, meshes and "
        "contact by damped time steps and by static increments; the bars by time steps and by "
        "increments of the generalised-α method, a quarter of a brick's wave each. "
        "Seconds are those of one core without making meshes, whatever else the machine did: "
        "their ratios count.",
        "",
        "| case | what | theory | time steps | increments | apart | steps [s] | increments [s] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        theory = "" if r["theory"] is None else f"{r['theory']:.4g}"
        lines.append(
            f"| `{r['case']}` | {r['what']} | {theory} | {r['time_steps']:.5g} | "
            f"{r['increments']:.5g} | {100 * r['apart']:.2f} % | "
            f"{r['seconds_time_steps']:.1f} | {r['seconds_increments']:.1f} |"
        )
    lines += [
        "",
        f"Contacts have {size.elements:g} elements per radius, {size.stress:g} in `hertz-stress`; "
        f"yielding balls are pressed in {size.periods:g} of their periods or {size.increments} "
        "increments, and `hertz` in five indentations. The paper's ball has "
        f"{num_cells} tetrahedra.",
        "",
        "![Force and cost](implicit_vs_explicit.png)",
        "",
        "(a) Force on the paper's ball over that of the slowest time steps: fast ones are too "
        "stiff by inertia, few increments by radial return, which is of the first order in them. "
        "(b) A Hertz contact on one mesh: how far its force is from that of "
        f"{size.hertz_increments[-1]} increments, itself {100 * (at_rest - 1):.2g} % from Hertz. "
        "Numbers are periods of the ball in which the plane comes in, and increments.",
        "",
    ]
    return "\n".join(lines)


def main(folder, quick=False):
    """Measure, write the page, its figure and its numbers into ``folder``; returns the rows."""
    folder, size = Path(folder), QUICK if quick else FULL
    folder.mkdir(parents=True, exist_ok=True)
    for increments in (None, 2):  # compile
        first = press(COMM, "paper-sphere", 1.5, 1.0, increments)
    rows = []
    for measure in (hertz_contact, hertz_stress, plastic_ball, papers_ball, impact):
        rows.append(r := measure(size))
        print(f"{r['case']}: {r['time_steps']:.5g} and {r['increments']:.5g}, {r['apart']:.2%} "
              f"apart; {r['seconds_time_steps']:.1f} and {r['seconds_increments']:.1f} s",
              flush=True)  # fmt: skip
    curves, cost = courses(size), costs(size)
    first = first if quick else press(COMM, "paper-sphere", size.elements, 1.0, 2)
    at_rest = cost["static increments"][-1][1]
    text = page(rows, size, first.simulation.mesh.num_cells, at_rest)
    (folder / "implicit_vs_explicit.md").write_text(text, encoding="utf-8")
    (folder / "implicit_vs_explicit.json").write_text(
        json.dumps({"rows": rows, "courses": curves, "costs": cost}, indent=1)
    )
    draw(curves, cost, folder / "implicit_vs_explicit.png")
    for r in rows:
        # Dynamics damp what a mesh cannot resolve in ways of their own.
        assert r["apart"] < size.apart * (3 if r["case"] == "bar-impact" else 1), r
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", help="where the page, its figure and its numbers are written")
    parser.add_argument("--quick", action="store_true", help="coarse, in seconds")
    given = parser.parse_args()
    main(given.folder, given.quick)
