"""Do plans keep their accuracy away from the table, and what does that cost?

`mufe plan CASE --accuracy …` takes the cheapest choice that is within the accuracy not only as it
was measured, but at another Poisson's ratio, size of contact or speed as well; with `--set speed=…`
and the like, at that one. Here

- `--elsewhere` computes the points that plans are made of at such parameters and stores their
  errors;
- without it plans are made and followed at parameters that took no part in that, and their errors
  stand beside what was wanted. `--again` does so at further ones, for what became of plans at the
  first ones led to a margin (planning.case). With `--stated` plans are told the parameters. What
  plans cost stands beside three fronts: the cheapest point of the table that is within the accuracy
  there, the cheapest one that is within it wherever plans are followed as well, and the cheapest
  one that is within it at all parameters that anything was computed at. A point may be within at
  one speed because its error changes sign there: the second front leaves out some of these, the
  third one all that are known; it is what a plan could do at best that is told no parameters.

    python demos/plan_accuracy.py FOLDER                minutes
    python demos/plan_accuracy.py FOLDER --stated       minutes
    python demos/plan_accuracy.py FOLDER --again        minutes
    python demos/plan_accuracy.py FOLDER --elsewhere    compute points elsewhere first, a while
"""

import argparse
import csv
import inspect
import math
from functools import cache
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
from mufe_fenicsx.analysis.evidence import (
    DONE,
    ELSEWHERE,
    SUFFIX,
    cheapest,
    pareto,
    read_elsewhere,
    read_points,
    usable,
    write_elsewhere,
)
from mufe_fenicsx.cli.arguments import number_or_text
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.planning.case import lines, plan_case
from mufe_fenicsx.verification.charts.measure import measure
from mufe_fenicsx.verification.charts.points import POINTS

#: What plans are asked for.
ACCURACIES = (0.2, 0.1, 0.05, 0.03, 0.02)
#: Parameters of a case other than those of the table: points are computed at the first ones, and
#: plans are tried at the second ones, and again at the third ones.
CHANGES = {
    "hertz": (({"nu": 0.0}, {"nu": 0.3}, {"a_over_R": 0.01}, {"a_over_R": 0.03}),
              ({"nu": 0.25, "a_over_R": 0.015}, {"nu": 0.05, "a_over_R": 0.025}),
              ({"nu": 0.1, "a_over_R": 0.0275}, {"nu": 0.2, "a_over_R": 0.0175})),
    "mindlin": (({"nu": 0.15}, {"a_over_R": 0.01}, {"a_over_R": 0.02}),
                ({"nu": 0.2, "a_over_R": 0.0125},),
                ({"nu": 0.25, "a_over_R": 0.0175},)),
    "impact": (({"speed": 2.5}, {"speed": 5.0}, {"speed": 20.0}),
               ({"speed": 3.5}, {"speed": 15.0}), ({"speed": 7.0}, {"speed": 12.0})),
    "plastic-sphere": (({"nu": 0.3}, {"a_over_R": 0.075}, {"a_over_R": 0.085}),
                       ({"nu": 0.3, "a_over_R": 0.08},),
                       ({"a_over_R": 0.0925},)),
    "jammed": (({"friction": 0.1}, {"friction": 0.4}, {"sample": 5}, {"sample": 6},
                {"sample": 9}),
               ({"sample": 12},), ({"friction": 0.3, "sample": 2},)),
}  # fmt: skip


#: The largest error of a point that is computed elsewhere.
LARGEST = 0.5
#: Points that take less [s] are computed so often, and the fastest counts.
SHORT, REPEATS = 0.5, 3
#: Plans shall cost no more than this over the front.
OVER = 1.5


@cache
def point_at(case, series, parameters):
    """A point computed with parameters, pairs of names and values."""
    first = measure(case, series, dict(parameters))
    repeats = REPEATS - 1 if first.status == DONE and first.seconds < SHORT else 0
    more = [measure(case, series, dict(parameters)) for _ in range(repeats)]
    return min([first, *more], key=lambda point: point.seconds)


def at(point, change):
    """The same choice as that of a point at other parameters."""
    own = {name: number_or_text(text) for name, text in point.parameters.items()}
    return point_at(point.case, point.series, tuple((own | change).items()))


def compute_elsewhere(say, cases=tuple(CHANGES), path=ELSEWHERE):
    """Errors elsewhere of the lines that reach the front; those that are known stay."""
    known = read_elsewhere(path) if path.exists() else {}
    for case in cases:
        own = usable(read_points(), case)
        front = {point.command for point in pareto(own)}
        for line in lines(own):
            if front.isdisjoint(point.command for point in line):
                continue
            for point in line:
                if point.error > LARGEST:
                    continue
                errors = {k: dict(v) for k, v in known.get(point.command, {}).items()}
                for change in CHANGES[case][0]:
                    ((name, value),) = change.items()
                    along = errors.setdefault(name, {table_value(case, name): point.error})
                    if value not in along and (done := at(point, change)).status == DONE:
                        along[value] = done.error
                if errors and errors != known.get(point.command):
                    known[point.command] = errors
                    write_elsewhere(path, known)
                    say(f"{case:15} {point.error:8.4f} {errors} {point.command}")


def table_value(case, name):
    """What a parameter of a case is in the table: its default."""
    return float(inspect.signature(POINTS[case + SUFFIX]).parameters[name].default)


def front_where_followed(own, accuracy, changes, elsewhere=None):
    """The cheapest point that is within an accuracy in the table and at all of some parameters.

    With errors ``elsewhere`` within it wherever these are known, too. None where there is none.
    """
    for point in sorted(own, key=lambda p: p.seconds):
        if elsewhere is not None:
            known = elsewhere.get(point.command, {"": {0.0: math.inf}})
            if max(error for along in known.values() for error in along.values()) > accuracy:
                continue
        if point.error > accuracy:
            continue
        if all(at(point, change).error <= accuracy for change in changes):
            return point
    return None


def check(say, cases=tuple(CHANGES), again=False, stated=False):
    """Follow plans elsewhere, at the second or third parameters of ``CHANGES``.

    Args:
        say: Called with a line for each plan.
        cases: Some of ``CHANGES``.
        again: The third ones.
        stated: Plans are told the parameters.

    Returns:
        Rows (case, accuracy, change, error, kept, time over that of the table's front, time and
        element-steps over those of the front where they are followed, time over that of the front
        of what is within everywhere, command).
    """
    rows, elsewhere = [], read_elsewhere()
    for case in cases:
        changes, own = CHANGES[case][2 if again else 1], usable(read_points(), case)
        for accuracy in ACCURACIES:
            front = front_where_followed(own, accuracy, changes)
            safe = front_where_followed(own, accuracy, changes, elsewhere)
            for change in changes:
                try:
                    plan = plan_case(case, accuracy, stated=change if stated else None)
                except InputError:
                    say(f"{case:15} wanted {accuracy:5.2f} at {change}: refused")
                    continue
                over = plan.seconds / cheapest(own, accuracy).seconds
                done = at(plan, change)
                kept = done.error <= accuracy  # nan: no
                time, work = math.nan, math.nan
                if front is not None:
                    other = at(front, change)
                    time = done.seconds / other.seconds
                    work = done.element_steps / other.element_steps
                over_safe = done.seconds / at(safe, change).seconds if safe else math.nan
                rows.append(
                    (case, accuracy, change, done.error, kept, over, time, work, over_safe,
                     done.command)
                )  # fmt: skip
                word = "kept" if kept else "NOT KEPT"
                say(
                    f"{case:15} {change} wanted {accuracy:5.2f} error {done.error:8.4f} {word:8} "
                    f"cost {over:5.2f} x; there {time:5.2f} x, {work:5.2f} x element-steps; safe "
                    f"{over_safe:5.2f} x  "
                    f"{done.command}; front {front and front.command}"
                )
    return rows


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--elsewhere", action="store_true", help="compute points there first")
    parser.add_argument("--again", action="store_true", help="follow plans at further parameters")
    parser.add_argument("--stated", action="store_true", help="plans are told the parameters")
    parser.add_argument("--cases", nargs="+", default=list(CHANGES), choices=list(CHANGES))
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)

    def say(text):
        print(text, flush=True)

    if given.elsewhere:
        compute_elsewhere(say, given.cases)
    rows = check(say, given.cases, given.again, given.stated)
    with (given.folder / "plan_accuracy.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", "accuracy", "change", "error", "kept", "cost_over_front",
                         "cost_over_front_there", "element_steps_over_front_there",
                         "cost_over_front_everywhere", "command"])  # fmt: skip
        writer.writerows(rows)
    kept = sum(row[4] for row in rows)
    say(f"{kept} of {len(rows)} plans kept their accuracy")
    for index, name in (
        (5, "in the table"), (6, "where followed"), (7, "where followed, element-steps"),
        (8, "of what is within everywhere"),
    ):  # fmt: skip
        plans = {}
        for row in rows:
            plans.setdefault(row[:2], []).append(row[index])
        # Static increments and rigid grains have no element-steps.
        costs = [max(values) for values in plans.values() if not any(map(math.isnan, values))]
        dear = sum(cost > OVER for cost in costs)
        say(f"front {name}: {dear} of {len(costs)} plans cost more than {OVER:g} times as much, at "
            f"most {max(costs):.2f} times, in the mean {sum(costs) / len(costs):.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
