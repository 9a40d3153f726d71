"""How much model does a packing need? Rigid, elastic, auto and elasto-plastic grains side by side.

A packing of angular grains is compressed in an oedometer with each fidelity, at the same
speed, mesh and friction:

- rigid: six degrees of freedom, contact on an elastic foundation;
- elastic: tetrahedra that do not yield;
- j2: tetrahedra that yield, as in Nadimi & Fonseca (2018);
- auto: each grain rigid until it carries a load, then j2.

Where grains rearrange, motion is sensitive: the same j2 test with another time step takes
another path. The band is the range of three j2 tests whose time steps are 0.9, 0.85 and 0.8 of
the limit; what lies within it cannot be told from j2.

    python demos/fidelity.py FOLDER             about five minutes
    python demos/fidelity.py FOLDER --quick     one minute: fewer grains, less strain
"""

import argparse
import csv
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib
import numpy as np
from mpi4py import MPI

from mufe_fenicsx.verification.fidelity import FIDELITIES, compress
from mufe_fenicsx.verification.packing import angular_grains

matplotlib.use("Agg")
import matplotlib.pyplot as plt

#: Time steps of the j2 tests over the limit.
FACTORS = (0.9, 0.85, 0.8)
COLOURS = {"rigid": "#777777", "elastic": "#0072b2", "auto": "#d55e00", "j2": "#000000"}


def run_all(counts, strain, speed):
    """Courses by fidelity, those of j2 as a list; each printed as it ends."""
    bodies = angular_grains(counts, 0.5, gap=0.0)
    courses = {}
    for name, material in FIDELITIES.items():
        factors = FACTORS if name == "j2" else FACTORS[:1]
        courses[name] = [
            compress(MPI.COMM_SELF, bodies, material, strain, speed, time_step_factor=factor)
            for factor in factors
        ]
        c = courses[name][0]
        print(
            f"{name:8s} {c.simulation.state.num_steps:7d} steps {c.seconds:6.1f} s   stress "
            f"{c.stress[-1] / 1e6:6.1f} MPa   neighbours {c.contacts[-1]:.2f}",
            flush=True,
        )
    return courses


def draw(courses, path):
    """Stress, neighbours, grains that deform, and cost."""
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    figure, ((left, right), (below, cost)) = plt.subplots(
        2, 2, figsize=(7.2, 5.4), layout="constrained"
    )
    full = courses["j2"]
    grid = full[0].strain
    band = np.array([np.interp(grid, c.strain, c.stress) for c in full]) / 1e6
    left.fill_between(
        100 * grid, band.min(axis=0), band.max(axis=0), color="0.8", label="j2, range"
    )
    for name, (c, *_) in courses.items():
        colour = COLOURS[name]
        left.plot(100 * c.strain, c.stress / 1e6, color=colour, label=name, lw=1.3)
        right.plot(100 * c.strain, c.contacts, color=colour, label=name, lw=1.3)
        if name in ("auto", "j2"):
            below.plot(100 * c.strain, c.deforming, color=colour, label=name, lw=1.3)
    # Stiff grains leave the range of the others at once.
    left.set_ylim(0, 2.0 * band.max())
    left.set_ylabel("vertical stress [MPa]")
    right.set_ylabel("active neighbours of a grain")
    below.set_ylabel("grains that deform")
    below.set_ylim(0, None)
    for axes in (left, right, below):
        axes.set_xlabel("strain after seating [%]")
    left.legend(frameon=False)
    names = list(courses)
    seconds = [courses[n][0].seconds for n in names]
    cost.bar(names, np.array(seconds) / seconds[-1], color=[COLOURS[n] for n in names])
    cost.set_ylabel("wall time over that of j2")
    figure.savefig(path, dpi=200)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    size = ((2, 2, 2), 0.02, 2.0) if arguments.quick else ((3, 3, 3), 0.06, 1.0)
    courses = run_all(*size)
    with (arguments.folder / "fidelity.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["fidelity", "run", "strain", "stress_Pa", "neighbours", "deforming"])
        for name, runs in courses.items():
            for k, c in enumerate(runs):
                for row in zip(c.strain, c.stress, c.contacts, c.deforming, strict=True):
                    rows.writerow([name, k, *row])
    draw(courses, arguments.folder / "fidelity.png")
    print(arguments.folder / "fidelity.png")


if __name__ == "__main__":
    main()
