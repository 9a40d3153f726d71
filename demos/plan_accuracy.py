"""Do plans keep their accuracy away from the table, and what does their margin cost?

`mufe plan CASE --accuracy …` takes the cheapest measured point whose error, divided by the margin
of its case, is within the accuracy: at other Poisson's ratios, sizes of contact and speeds than
those of the table errors are larger. Here

- `--margins` measures by how much: the points that plans may choose are computed again at other
  parameters, and the margin of a case is the error of the table over the largest one found;
- without it plans are made and followed at parameters that took no part in that, and their errors
  stand beside what was wanted, and what they cost beside the cheapest point of the table that
  is just within.

    python demos/plan_accuracy.py FOLDER                a minute or two
    python demos/plan_accuracy.py FOLDER --margins --store   measure margins first, and keep them
"""

import argparse
import csv
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
from mpi4py import MPI

from mufe_fenicsx.charts.cases import POINTS
from mufe_fenicsx.errors import InputError, SolverError
from mufe_fenicsx.evidence import (
    MARGINS,
    SUFFIX,
    cheapest,
    command_of,
    pareto,
    read_points,
    usable,
    write_margins,
)
from mufe_fenicsx.planning import plan_case

#: What plans are asked for.
ACCURACIES = (0.2, 0.1, 0.05, 0.03, 0.02)
#: Parameters of a case other than those of the table: margins come of the first ones, and plans are
#: tried at the second ones.
ELSEWHERE = {
    "hertz": (({"nu": 0.3}, {"a_over_R": 0.03}),
              ({"nu": 0.25, "a_over_R": 0.015}, {"nu": 0.05, "a_over_R": 0.025})),
    "mindlin": (({"nu": 0.15}, {"a_over_R": 0.02}), ({"nu": 0.2, "a_over_R": 0.0125},)),
    "impact": (({"speed": 20.0}, {"speed": 2.5}), ({"speed": 5.0}, {"speed": 15.0})),
    "plastic-sphere": (({"nu": 0.3}, {"a_over_R": 0.085}), ({"nu": 0.3, "a_over_R": 0.08},)),
}  # fmt: skip


def typed(parameters):
    """Texts of a stored point as numbers where they are some."""
    found = {}
    for key, text in parameters.items():
        try:
            found[key] = float(text)
        except ValueError:
            found[key] = text
    return found


def error_at(case, point, change):
    """Error of a point at other parameters, and the command; None where it does not compute."""
    parameters = typed(point.parameters) | change
    try:
        answer = POINTS[case + SUFFIX](MPI.COMM_SELF, **parameters)
    except (InputError, SolverError, FloatingPointError) as error:
        print(f"{command_of(case, parameters)}: {error}", flush=True)
        return None, command_of(case, parameters)
    return answer["results"]["error"]["computed"], command_of(case, parameters)


def measure_margins(say, largest=0.25):
    """Margin of each case: the least error of the table over one found elsewhere, at most 1."""
    margins = {}
    for case, (changes, _) in ELSEWHERE.items():
        front = [p for p in pareto(usable(read_points(), case)) if p.error <= largest]
        ratios = []
        for point in front:
            for change in changes:
                error, command = error_at(case, point, change)
                if error is not None:
                    ratios.append(point.error / error)
                    say(f"{case:15} {point.error:8.4f} -> {error:8.4f}  {command}")
        margins[case] = (min(1.0, *ratios), len(ratios))
        say(f"{case:15} margin {margins[case][0]:.3f} of {len(ratios)} computations")
    return margins


def check(say):
    """Follow plans elsewhere; rows (case, accuracy, error, kept, cost over the cheapest)."""
    rows = []
    for case, (_, changes) in ELSEWHERE.items():
        own = usable(read_points(), case)
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
    parser.add_argument("--margins", action="store_true", help="measure them first")
    parser.add_argument("--store", action="store_true", help="keep them in the package")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)

    def say(text):
        print(text, flush=True)

    if given.margins:
        margins = measure_margins(say)
        write_margins(MARGINS if given.store else given.folder / "margins.csv", margins)
    rows = check(say)
    with (given.folder / "plan_accuracy.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", "accuracy", "error", "kept", "cost_over_cheapest", "command"])
        writer.writerows(rows)
    kept, costs = sum(row[3] for row in rows), [row[4] for row in rows]
    say(f"{kept} of {len(rows)} plans kept their accuracy; they cost up to {max(costs):.2f} and in "
        f"the mean {sum(costs) / len(costs):.2f} times the cheapest point within")  # fmt: skip


if __name__ == "__main__":
    main()
