"""What is the stress of a sample worth at the resolution people can afford?

Twenty grains whose surfaces are formulas, the same body on every mesh, are confined and pressed to
a strain of 0.05 (`mufe verify known-sample`). They lock into each other, so that hardly any path
differs, and two meshes of each coarse size show the scatter that is left. Each line is a method:
today's default, and the seed's method, plain tetrahedra with the time step of single elements.
Nodes of surfaces stand out a little, so that facets enclose the volume of the grain. A third line
leaves them on the surface, which opens all gaps. It comes from below where the others come from
above, and both have to meet. Of each,

    σ(h) = σ₀ + C h^p

through the three finest meshes gives the order p and the stress σ₀ that the meshes go to. What is
said to be the uncertainty of σ₀ is the larger of two: Roache's 1.25 |σ - σ₀| with σ of the finest
mesh (J. Fluids Eng. 116, 1994), and what the scatter of meshes makes of σ₀. Where the stress is not
monotone in h, or changes more the finer the meshes, there is no order and no limit. Small
differences of three meshes make p uncertain: what the two finest go to with p = 2, the order of
surfaces and of linear elements, stands beside it. The answer is the mean of that from above and
from below. Of other samples it tells what `mufe plan` says of their errors, beside what they are
against the limit of second order of their two finest meshes.

    python demos/known_sample.py FOLDER                             an hour of a processor
    python demos/known_sample.py FOLDER --sizes 5 7 --repeats 1     minutes
    python demos/known_sample.py FOLDER --draw                      the figure and the table alone
    python demos/known_sample.py FOLDER --pack 20 interlocked 1     store a packing, minutes
    python demos/known_sample.py FOLDER --sample 20 with-room 1 --methods default
                                                                    predicted and actual errors
"""

import argparse
import csv
import json
import math
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib
import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

from mufe_fenicsx.planning.errors import PLASTIC_RADIUS, elastic_radius, sample_errors
from mufe_fenicsx.report import style
from mufe_fenicsx.verification.fidelity import FIDELITIES
from mufe_fenicsx.verification.known_sample import (
    DIAMETER,
    PACKED,
    STORED,
    known_sample,
    name_of,
    pack_sample,
)
from mufe_fenicsx.verification.known_stress import APART, AROUND, STRAINS, press

#: Options of a simulation, and whether nodes of surfaces stand out (`formula_grains`).
METHODS = {
    "default": ({}, True),
    "seed's method": ({"element": "p1", "assembled": False}, True),
    "default, nodes on the surface": ({}, False),
}
LOOKS = {
    "default": (style.BLUE, "o"),
    "seed's method": (style.RED, "s"),
    "default, nodes on the surface": (style.GREEN, "^"),
}
COLUMNS = ("sample", "fidelity", "method", "elements_per_diameter", "mesh", "speed",
           *(f"stress_{strain:g}" for strain in STRAINS), "cells", "steps",
           "processor_s")  # fmt: skip
WHOLE = ("mesh", "cells", "steps")
#: Elements per diameter up to which there are several meshes of a size.
COARSE = 7.0
#: Those that meet from above and below.
BOTH = ("default", "default, nodes on the surface")
#: Orders between which one is looked for.
ORDERS = (0.3, 6.0)


def compute(comm, name, sample, elements, mesh, wanted, speed):
    """Rows of the table: one mesh, pressed in each wanted way (fidelity, method)."""
    bodies = {}
    for fidelity, method in wanted:
        options, bulge = METHODS[method]
        if bulge not in bodies:
            bodies[bulge] = sample.bodies(DIAMETER / elements, APART, bulge=bulge, mesh=mesh)
        course = press(
            comm, sample, bodies[bulge], FIDELITIES[fidelity], STRAINS[-1] + AROUND, speed,
            **options,
        )  # fmt: skip
        s = course.simulation
        stresses = [course.stress_at(strain) for strain in STRAINS]
        cells = sum(len(cells) for _, cells in bodies[bulge])
        row = (name, fidelity, method, elements, mesh, speed, *stresses, cells,
               s.state.num_steps, round(course.processor_s, 1))  # fmt: skip
        yield dict(zip(COLUMNS, row, strict=True))


def extrapolate(h, stress, scatter):
    """Order p, limit σ₀ and its uncertainty of the three finest meshes, nan where there is none.

    Args:
        h: Lengths of edges, the finest last.
        stress: On them.
        scatter: Standard deviation of each of these.
    """
    if len(h) < 3:
        return math.nan, math.nan, math.nan
    p, limit = _fitted(h[-3:], stress[-3:])
    if math.isnan(p):
        return p, limit, math.nan
    rng = np.random.default_rng(1)
    others = [
        _fitted(h[-3:], np.asarray(stress[-3:]) + scatter[-3:] * rng.standard_normal(3))[1]
        for _ in range(200)
    ]
    low, high = np.nanpercentile(others, [16, 84])
    return p, limit, float(max(1.25 * abs(stress[-1] - limit), 0.5 * (high - low)))


def limit_of_second_order(h, stress):
    """What the two finest meshes go to with p = 2; nan of one mesh."""
    if len(h) < 2:
        return math.nan
    return stress[-1] - (stress[-2] - stress[-1]) * h[-1] ** 2 / (h[-2] ** 2 - h[-1] ** 2)


def answer(rows, fidelity, strain):
    """Mean limit of second order of both kinds of meshes, and its uncertainty [Pa]; nan without.

    That is half of their distance, and what the scatter of single meshes makes of a limit.
    """
    limits, scatters = [], []
    for method in BOTH:
        found = means(rows, fidelity, method, strain)
        if len(found) < 2:
            return math.nan, math.nan
        h, stress, scatter, _ = map(np.array, zip(*found, strict=True))
        limits.append(limit_of_second_order(h, stress))
        part = h[-1] ** 2 / (h[-2] ** 2 - h[-1] ** 2)
        scatters.append(math.hypot((1 + part) * scatter[-1], part * scatter[-2]))
    return float(np.mean(limits)), float(0.5 * abs(np.subtract(*limits)) + max(scatters))


def _fitted(h, stress):
    """p and σ₀ of σ₀ + C h^p through three points."""
    first, second = stress[0] - stress[1], stress[1] - stress[2]

    def miss(p):
        return (h[0] ** p - h[1] ** p) * second - (h[1] ** p - h[2] ** p) * first

    low, high = ORDERS
    if first * second <= 0 or miss(low) * miss(high) > 0:
        return math.nan, math.nan
    p = brentq(miss, low, high)
    return p, stress[2] - second * h[2] ** p / (h[1] ** p - h[2] ** p)


def means(rows, fidelity, method, strain):
    """Edges over the diameter from long to short; mean stress [Pa], deviation, meshes of each."""
    own = [r for r in rows if (r["fidelity"], r["method"]) == (fidelity, method)]
    found = []
    for elements in sorted({r["elements_per_diameter"] for r in own}):
        values = [r[f"stress_{strain:g}"] for r in own if r["elements_per_diameter"] == elements]
        found.append((1 / elements, np.mean(values), np.std(values, ddof=min(1, len(values) - 1)),
                      len(values)))  # fmt: skip
    # A mean of n has the deviation over √n; of a single mesh that of the others is taken.
    relative = max((d / m for _, m, d, n in found if n > 1), default=0.0)
    return [(h, m, (d if n > 1 else relative * m) / math.sqrt(n), n) for h, m, d, n in found]


def table(rows):
    """Lines of text: stresses on all meshes, order, limit."""
    lines = []
    for fidelity in sorted({r["fidelity"] for r in rows}):
        for strain in STRAINS:
            for method in METHODS:
                found = means(rows, fidelity, method, strain)
                if not found:
                    continue
                h, stress, scatter, _ = map(np.array, zip(*found, strict=True))
                p, limit, error = extrapolate(h, stress, scatter)
                shown = ", ".join(
                    f"{1 / x:.3g}: {y / 1e6:.2f} ± {z / 1e6:.2f} MPa ({n})" for x, y, z, n in found
                )
                end = "not monotone, or no order"
                if not math.isnan(p):
                    end = f"order {p:.2f}, limit {limit / 1e6:.2f} ± {error / 1e6:.2f} MPa"
                second = limit_of_second_order(h, stress) / 1e6
                lines.append(f"{fidelity}, strain {strain:g}, {method}: {shown}; {end}; with p = 2 "
                             f"{second:.2f} MPa")  # fmt: skip
            limit, error = answer(rows, fidelity, strain)
            lines.append(f"{fidelity}, strain {strain:g}, both kinds of meshes: "
                         f"{limit / 1e6:.2f} ± {error / 1e6:.2f} MPa")  # fmt: skip
    return lines


def predictions(rows):
    """Lines of text: the error that a plan says of each mesh but the finest, beside the actual one.

    Both are means over the strains; the actual one is that from the limit of second order.
    """
    lines = []
    for fidelity in sorted({r["fidelity"] for r in rows}):
        courses = [means(rows, fidelity, "default", strain) for strain in STRAINS]
        if min(len(course) for course in courses) < 2:
            continue
        limits = [limit_of_second_order(*np.array([m[:2] for m in course]).T) for course in courses]
        material = FIDELITIES[fidelity]
        errors = sample_errors(yields=fidelity == "j2")
        radius = PLASTIC_RADIUS if fidelity == "j2" else elastic_radius(material, np.mean(limits))
        for at_strains in zip(*(course[:-1] for course in courses), strict=True):
            n = radius / at_strains[0][0]
            parts = [m[1] / limit - 1 for m, limit in zip(at_strains, limits, strict=True)]
            actual, said = float(np.mean(np.abs(parts))), errors.of_mesh(n)
            lines.append(
                f"{fidelity}, {n:.2f} elements per contact radius: predicted {100 * said:.1f} %, "
                f"actual {100 * actual:.1f} %, their ratio {said / actual:.2f}"
            )
    return lines


def draw(rows, path):
    """Stress at both strains over h, and what it goes to."""
    fidelities = sorted({r["fidelity"] for r in rows})
    with matplotlib.rc_context(style.RC):
        figure, axes = style.new_figure(
            style.PAGE, 0.4 * style.PAGE * len(fidelities), nrows=len(fidelities),
            ncols=len(STRAINS), squeeze=False,
        )  # fmt: skip
        for line, fidelity in zip(axes, fidelities, strict=True):
            for axis, strain in zip(line, STRAINS, strict=True):
                for method, (colour, mark) in LOOKS.items():
                    found = means(rows, fidelity, method, strain)
                    if not found:
                        continue
                    h, stress, scatter, _ = map(np.array, zip(*found, strict=True))
                    axis.errorbar(h, stress / 1e6, scatter / 1e6, color=colour, marker=mark,
                                  label=method.removeprefix("default, "), capsize=2)  # fmt: skip
                limit, error = answer(rows, fidelity, strain)
                axis.errorbar([0], [limit / 1e6], [error / 1e6], color=style.BLACK, marker="D",
                              label="limit", capsize=2)  # fmt: skip
                kind = {"j2": "yielding"}.get(fidelity, fidelity)
                axis.set_title(f"{kind} grains, strain {strain:g}")
                axis.set_xlim(left=-0.01)
                axis.set_ylim(bottom=0)
                axis.set_xlabel("edges over grain diameter")
                axis.set_ylabel("stress (MPa)")
        handles = {}
        for axis in axes.flat:
            handles |= dict(zip(*axis.get_legend_handles_labels()[::-1], strict=True))
        figure.legend(handles.values(), handles, loc="outside upper center", ncols=len(handles))
        figure.savefig(path)


def pack(number, state, seed):
    """Store a packing beside those that are there."""
    stored = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}
    sample = pack_sample(number, state, seed)
    stored[name_of(number, state, seed)] = sample.to_dict()
    STORED.write_text(json.dumps(stored) + "\n", encoding="utf-8")


def read(path):
    """Rows that are there already, numbers as such."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [
            {k: v if k in COLUMNS[:3] else int(float(v)) if k in WHOLE else float(v)
             for k, v in row.items()}
            for row in csv.DictReader(file)
        ]  # fmt: skip


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pack", nargs=3, metavar=("GRAINS", "STATE", "SEED"))
    parser.add_argument("--draw", action="store_true")
    parser.add_argument("--sample", nargs=3, default=("20", "interlocked", "1"))
    parser.add_argument("--sizes", type=float, nargs="+", default=[5, 7, 10, 14])
    parser.add_argument("--repeats", type=int, default=2, help="meshes of each coarse size")
    parser.add_argument("--fidelities", nargs="+", default=["j2", "elastic"])
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=list(METHODS))
    parser.add_argument("--speed", type=float, default=2.5, help="of the platens [m/s]")
    given = parser.parse_args()
    if given.pack:
        number, state, seed = given.pack
        if state not in PACKED:
            parser.error(f"state = {state}, expected {' or '.join(PACKED)}")
        return pack(int(number), state, int(seed))
    given.folder.mkdir(parents=True, exist_ok=True)
    number, state, seed = given.sample
    name = name_of(number, state, seed)
    path = given.folder / "known_sample.csv"
    rows = read(path)
    keys = ("sample", "fidelity", "method", "elements_per_diameter", "mesh", "speed")
    done = {tuple(row[k] for k in keys) for row in rows}
    sample = known_sample(int(number), state, int(seed))
    for elements in [] if given.draw else given.sizes:
        for mesh in range(1, (given.repeats if elements <= COARSE else 1) + 1):
            wanted = [
                (f, m) for f in given.fidelities for m in given.methods
                if (name, f, m, elements, mesh, given.speed) not in done
            ]  # fmt: skip
            for row in compute(MPI.COMM_SELF, name, sample, elements, mesh, wanted, given.speed):
                rows.append(row)
                with path.open("w", newline="", encoding="utf-8") as file:
                    writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
                    writer.writeheader()
                    writer.writerows(rows)
                print(*row.values(), flush=True)
    rows = [r for r in rows if (r["sample"], r["speed"]) == (name, given.speed)]
    print(*table(rows), *predictions(rows), sep="\n")
    draw(rows, given.folder / "known_sample.png")


if __name__ == "__main__":
    main()
