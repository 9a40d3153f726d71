"""Do plans keep their accuracy away from the table, and what does that cost?

`mufe plan CASE --accuracy …` takes the cheapest choice that is within the accuracy not only as it
was measured, but at another Poisson's ratio, size of contact or speed as well. Here

- `--elsewhere` computes the points that plans are made of at such parameters and stores the largest
  error of each;
- without it plans are made and followed at parameters that took no part in that, and their errors
  stand beside what was wanted. `--again` does so at further ones, for what became of plans at the
  first ones led to a margin (planning.case). What plans cost stands beside two fronts: the cheapest
  point of the table that is within the accuracy there, and the cheapest one that is within it where
  plans are followed as well. A point may be within at one speed because its error changes sign
  there: the second front leaves it out.

    python demos/plan_accuracy.py FOLDER                minutes
    python demos/plan_accuracy.py FOLDER --again        minutes
    python demos/plan_accuracy.py FOLDER --elsewhere    compute points elsewhere first, an hour
"""

import argparse
import csv
import math
from functools import cache
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
from mufe_fenicsx.arguments import number_or_text
from mufe_fenicsx.charts.measure import measure
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.evidence import (
    DONE,
    ELSEWHERE,
    cheapest,
    pareto,
    read_elsewhere,
    read_points,
    usable,
    write_elsewhere,
)
from mufe_fenicsx.planning.case import lines, plan_case

#: What plans are asked for.
ACCURACIES = (0.2, 0.1, 0.05, 0.03, 0.02)
#: Parameters of a case other than those of the table: points are computed at the first ones, and
#: plans are tried at the second ones, and again at the third ones.
CHANGES = {
    "hertz": (({"nu": 0.0}, {"nu": 0.3}, {"a_over_R": 0.03}),
              ({"nu": 0.25, "a_over_R": 0.015}, {"nu": 0.05, "a_over_R": 0.025}),
              ({"nu": 0.1, "a_over_R": 0.0275}, {"nu": 0.2, "a_over_R": 0.0175})),
    "mindlin": (({"nu": 0.15}, {"a_over_R": 0.02}), ({"nu": 0.2, "a_over_R": 0.0125},),
                ({"nu": 0.25, "a_over_R": 0.0175},)),
    "impact": (({"speed": 20.0}, {"speed": 2.5}), ({"speed": 5.0}, {"speed": 15.0}),
               ({"speed": 3.5}, {"speed": 12.0})),
    "plastic-sphere": (({"nu": 0.3}, {"a_over_R": 0.085}), ({"nu": 0.3, "a_over_R": 0.08},),
                       ({"a_over_R": 0.0925},)),
}  # fmt: skip


#: The largest error of a point that is computed elsewhere.
LARGEST = 0.5
#: Plans shall cost no more than this over the front.
OVER = 1.5


@cache
def point_at(case, series, command_parameters, change):
    """A point computed at other parameters; both of them pairs of names and values."""
    parameters = {k: number_or_text(text) for k, text in command_parameters} | dict(change)
    return measure(case, series, parameters)


def at(point, change):
    """The same choice as that of a point at other parameters."""
    return point_at(
        point.case, point.series, tuple(point.parameters.items()), tuple(change.items())
    )


def compute_elsewhere(say, path=ELSEWHERE):
    """Largest error elsewhere of the lines that reach the front; those that are known stay."""
    known = read_elsewhere(path) if path.exists() else {}
    for case, (changes, *_) in CHANGES.items():
        own = usable(read_points(), case)
        front = {point.command for point in pareto(own)}
        for line in lines(own):
            if front.isdisjoint(point.command for point in line):
                continue
            for point in line:
                if point.error > LARGEST or point.command in known:
                    continue
                errors = [p.error for p in (at(point, change) for change in changes)
                          if p.status == DONE]  # fmt: skip
                if errors:
                    known[point.command] = max(errors)
                    write_elsewhere(path, known)
                    say(f"{case:15} {point.error:8.4f} -> {max(errors):8.4f}  {point.command}")


def front_where_followed(own, accuracy, changes):
    """The cheapest point that is within an accuracy in the table and at all of some parameters."""
    for point in sorted(own, key=lambda p: p.seconds):
        if point.error > accuracy:
            continue
        if all(at(point, change).error <= accuracy for change in changes):
            return point
    return None


def check(say, cases=tuple(CHANGES), again=False):
    """Follow plans elsewhere, at the second or third parameters of ``CHANGES``.

    Returns:
        Rows (case, accuracy, change, error, kept, time over that of the table's front, time and
        element-steps over those of the front where they are followed, command).
    """
    rows = []
    for case in cases:
        changes, own = CHANGES[case][2 if again else 1], usable(read_points(), case)
        for accuracy in ACCURACIES:
            try:
                plan = plan_case(case, accuracy)
            except InputError:
                say(f"{case:15} wanted {accuracy:5.2f}: refused")
                continue
            over = plan.seconds / cheapest(own, accuracy).seconds
            front = front_where_followed(own, accuracy, changes)
            for change in changes:
                done = at(plan, change)
                kept = done.error <= accuracy  # nan: no
                time, work = math.nan, math.nan
                if front is not None:
                    other = at(front, change)
                    time = done.seconds / other.seconds
                    work = done.element_steps / other.element_steps
                rows.append(
                    (case, accuracy, change, done.error, kept, over, time, work, done.command)
                )
                word = "kept" if kept else "NOT KEPT"
                say(
                    f"{case:15} wanted {accuracy:5.2f} error {done.error:8.4f} {word:8} cost "
                    f"{over:5.2f} x; there {time:5.2f} x, {work:5.2f} x element-steps  "
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
    parser.add_argument("--cases", nargs="+", default=list(CHANGES), choices=list(CHANGES))
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)

    def say(text):
        print(text, flush=True)

    if given.elsewhere:
        compute_elsewhere(say)
    rows = check(say, given.cases, given.again)
    with (given.folder / "plan_accuracy.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", "accuracy", "change", "error", "kept", "cost_over_front",
                         "cost_over_front_there", "element_steps_over_front_there",
                         "command"])  # fmt: skip
        writer.writerows(rows)
    kept = sum(row[4] for row in rows)
    say(f"{kept} of {len(rows)} plans kept their accuracy")
    for index, name in (
        (5, "in the table"), (6, "where followed"), (7, "where followed, element-steps"),
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
