"""Do plans keep their accuracy away from the table, and what does that cost?

`mufe plan CASE --accuracy …` takes the cheapest measured point that is within the accuracy not
only as it was measured, but at another Poisson's ratio, size of contact or speed as well. Here

- `--elsewhere` computes the points of the front at such parameters and stores the largest error
  of each;
- without it plans are made and followed at parameters that took no part in that, and their errors
  stand beside what was wanted, and what they cost beside the cheapest point of the table that
  is just within.

    python demos/plan_accuracy.py FOLDER                minutes
    python demos/plan_accuracy.py FOLDER --elsewhere    compute points elsewhere first, an hour
"""

import argparse
import csv
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
from mpi4py import MPI

from mufe_fenicsx.arguments import number_or_text
from mufe_fenicsx.charts.cases import POINTS
from mufe_fenicsx.errors import InputError, SolverError
from mufe_fenicsx.evidence import (
    ELSEWHERE,
    SUFFIX,
    cheapest,
    command_of,
    pareto,
    read_elsewhere,
    read_points,
    usable,
    write_elsewhere,
)
from mufe_fenicsx.planning.case import plan_case

#: What plans are asked for.
ACCURACIES = (0.2, 0.1, 0.05, 0.03, 0.02)
#: Parameters of a case other than those of the table: points are computed at the first ones, and
#: plans are tried at the second ones.
CHANGES = {
    "hertz": (({"nu": 0.3}, {"a_over_R": 0.03}),
              ({"nu": 0.25, "a_over_R": 0.015}, {"nu": 0.05, "a_over_R": 0.025})),
    "mindlin": (({"nu": 0.15}, {"a_over_R": 0.02}), ({"nu": 0.2, "a_over_R": 0.0125},)),
    "impact": (({"speed": 20.0}, {"speed": 2.5}), ({"speed": 5.0}, {"speed": 15.0})),
    "plastic-sphere": (({"nu": 0.3}, {"a_over_R": 0.085}), ({"nu": 0.3, "a_over_R": 0.08},)),
}  # fmt: skip


def error_at(case, point, change):
    """Error of a point at other parameters, and the command; None where it does not compute."""
    parameters = {k: number_or_text(text) for k, text in point.parameters.items()} | change
    try:
        answer = POINTS[case + SUFFIX](MPI.COMM_SELF, **parameters)
    except (InputError, SolverError, FloatingPointError) as error:
        print(f"{command_of(case, parameters)}: {error}", flush=True)
        return None, command_of(case, parameters)
    return answer["results"]["error"]["computed"], command_of(case, parameters)


def compute_elsewhere(say, path=ELSEWHERE, largest=0.25):
    """Largest error elsewhere of the points of each front; those that are known stay."""
    known = read_elsewhere(path) if path.exists() else {}
    for case, (changes, _) in CHANGES.items():
        for point in pareto(usable(read_points(), case)):
            if point.error > largest or point.command in known:
                continue
            errors = [error_at(case, point, change)[0] for change in changes]
            errors = [error for error in errors if error is not None]
            if errors:
                known[point.command] = max(errors)
                write_elsewhere(path, known)
                say(f"{case:15} {point.error:8.4f} -> {max(errors):8.4f}  {point.command}")


def check(say, cases=tuple(CHANGES)):
    """Follow plans elsewhere; rows (case, accuracy, error, kept, cost over the cheapest)."""
    rows = []
    for case in cases:
        changes, own = CHANGES[case][1], usable(read_points(), case)
        known = {}
        for accuracy in ACCURACIES:
            try:
                point = plan_case(case, accuracy)
            except InputError:
                say(f"{case:15} wanted {accuracy:5.2f}: refused")
                continue
            over = point.seconds / cheapest(own, accuracy).seconds
            for change in changes:
                key = (point.command, *change.values())
                if key not in known:
                    known[key] = error_at(case, point, change)
                error, command = known[key]
                kept = error is not None and error <= accuracy
                rows.append((case, accuracy, error, kept, over, command))
                word = "kept" if kept else "NOT KEPT"
                say(
                    f"{case:15} wanted {accuracy:5.2f} error {error or float('nan'):8.4f} "
                    f"{word:8} cost {over:5.2f} x  {command}"
                )
    return rows


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--elsewhere", action="store_true", help="compute points there first")
    parser.add_argument("--cases", nargs="+", default=list(CHANGES), choices=list(CHANGES))
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)

    def say(text):
        print(text, flush=True)

    if given.elsewhere:
        compute_elsewhere(say)
    rows = check(say, given.cases)
    with (given.folder / "plan_accuracy.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", "accuracy", "error", "kept", "cost_over_cheapest", "command"])
        writer.writerows(rows)
    kept, costs = sum(row[3] for row in rows), [row[4] for row in rows]
    say(f"{kept} of {len(rows)} plans kept their accuracy; they cost up to {max(costs):.2f} and in "
        f"the mean {sum(costs) / len(costs):.2f} times the cheapest point within")  # fmt: skip


if __name__ == "__main__":
    main()
