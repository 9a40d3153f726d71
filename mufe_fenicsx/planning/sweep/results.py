"""What came out of the runs of a sweep: one table, one report, and files of an outer loop."""

from pathlib import Path

import numpy as np

from ...analysis.stress_strain import tangent_modulus
from ...errors import InputError
from ...machine.files import reason, write_atomically
from ...results import Run
from ...results.reference_curves import (
    branches_of,
    curves_of_run,
    differences,
    read_reference,
    values_beside,
)
from ...units import base_number
from .plan import Sweep, value_of
from .runs import folder_of, is_finished

#: The table of all runs, and the folder of files of an outer loop.
TABLE, LOOP = "table.csv", "grainlearning"
#: What the page and the terminal show of it.
SHOWN = ("strain at the end [-]", "peak stress [Pa]", "K0 at peak stress [-]",
         "modulus of loading [Pa]", "modulus of unloading [Pa]")  # fmt: skip
#: Ends of the names of GrainLearning's files, which hold SI units.
FILES = ("_sim.txt", "_param.txt")


def results_of(folder, references=()) -> dict:
    """Numbers of one run, by name with unit; "finished" and nothing else without a history.

    Args:
        folder: Of the run.
        references: Measured curves.
    """
    found = {"finished": is_finished(folder)}
    try:
        run = Run(folder)
        curves, summary = curves_of_run(run), run.summary
    except InputError:
        return found
    if not len(curves["strain"]):
        return found
    found |= {name: summary.get(name) for name in ("num_grains", "num_cells", "num_steps")}
    found["wall [s]"] = summary.get("wall_s")
    found |= _of_curves(curves)
    for reference in references:
        try:
            rows = differences(reference, curves)
        except InputError:
            continue
        for row in rows:
            name = f"{row.reference}: {row.quantity} of {row.branch}"
            found[f"{name}, points compared [-]"] = row.num_points
            found[f"{name}, points measured [-]"] = row.num_measured
            found[f"{name}, mean difference [-]"] = row.mean
            found[f"{name}, largest difference [-]"] = row.largest
    return found


def _of_curves(curves):
    """Strains, stresses, moduli and ratios of a run.

    The modulus of loading is that of the last fifth of the first branch, of unloading and reloading
    that of a line through the whole branch.
    """
    strain, stress = curves["strain"], curves["stress"]
    peak = int(np.argmax(stress))
    found = {
        "strain at the end [-]": strain[-1],
        "stress at the end [Pa]": stress[-1],
        "peak stress [Pa]": stress[peak],
        "strain at peak [-]": strain[peak],
    }
    for name, label in (("k0", "K0"), ("void_ratio", "void ratio")):
        if name in curves:
            found |= {f"{label} at peak stress [-]": curves[name][peak],
                      f"{label} at the end [-]": curves[name][-1]}  # fmt: skip
    if "p" in curves:
        with np.errstate(divide="ignore", invalid="ignore"):
            found["largest q/p [-]"] = np.nanmax(curves["q"] / curves["p"])
    for rows, name in zip(branches_of(curves), ("loading", "unloading", "reloading"), strict=False):
        width = np.ptp(strain[rows])
        middle = 0.5 * (strain[rows][0] + strain[rows][-1])
        if name == "loading":
            middle, width = strain[rows][-1] - 0.1 * width, 0.2 * width
        found[f"modulus of {name} [Pa]"] = tangent_modulus(
            strain[rows], stress[rows], middle, width
        )
    return {name: float(value) if np.isfinite(value) else None for name, value in found.items()}


def table_of(sweep: Sweep, folder) -> list[dict]:
    """A row a run: its name, its parameters and what came out; written as CSV too.

    Args:
        sweep: The runs.
        folder: Of the sweep.
    """
    references = [read_reference(one) for one in sweep.load(0).references]
    rows = []
    for number, name in enumerate(sweep.names):
        parameters = {key: base_number(text) for key, text in sweep.rows[number].items()}
        parameters = {k: sweep.rows[number][k] if v is None else v for k, v in parameters.items()}
        rows.append({"run": name} | parameters | results_of(folder_of(folder, name), references))
    import pandas

    path = Path(folder) / TABLE
    write_atomically(path, pandas.DataFrame(rows).to_csv(index=False))
    return rows


def shown_table(sweep: Sweep, rows):
    """The parameters that differ between the runs, and what came out in short.

    Args:
        sweep: The runs.
        rows: Of :func:`table_of`.

    Returns:
        Rows of texts, and names of the columns.
    """
    varied = sweep.varied
    results = [name for name in SHOWN if any(row.get(name) is not None for row in rows)]
    texts = [
        (
            row["run"], "yes" if row["finished"] else "no", *(given[key] for key in varied),
            *("–" if row.get(name) is None else f"{row[name]:.5g}" for name in results),
        )
        for row, given in zip(rows, sweep.rows, strict=True)
    ]  # fmt: skip
    return texts, ("run", "finished", *varied, *results)


def write_sweep_report(sweep: Sweep, rows, folder) -> str | None:
    """Draw the runs that have loaded over each other; path of the page, None without any.

    Args:
        sweep: The runs.
        rows: Of :func:`table_of`.
        folder: Of the sweep, where ``report.html`` comes.
    """
    from ...report import write_report

    runs = {
        folder_of(folder, row["run"]): {k: value_of(text) for k, text in sweep.packing(number)}
        for number, row in enumerate(rows)
        if "peak stress [Pa]" in row
    }
    if not runs:
        return None
    table = (f"The sweep ({TABLE})", *shown_table(sweep, rows))
    return write_report(runs, folder, tables=[table])["report"]


def write_loop_files(sweep: Sweep, folder) -> list[str]:
    """Write what GrainLearning reads of each finished run: parameters, curves at measured points.

    Points are those of the first [[reference]] of the scene; out of the range of the run they are
    nan. Columns have the names of the quantities, SI units.

    Returns:
        Paths; none without a [[reference]].
    """
    given = sweep.load(0).references
    if not given:
        return []
    reference, place = read_reference(given[0]), Path(folder) / LOOP
    digits, written = len(str(len(sweep.names))), []
    for number, name in enumerate(sweep.names):
        own = folder_of(folder, name)
        if not is_finished(own):
            continue
        label = f"{sweep.scene.stem}_Iter0_Sample{number:0{digits}d}"
        label = sweep.described[number] if sweep.described else label
        values = values_beside(reference, curves_of_run(Run(own)))
        parameters = {k: base_number(text) for k, text in sweep.rows[number].items()}
        parameters = {k: [v] for k, v in parameters.items() if v is not None}
        try:
            place.mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"{place} cannot be written ({reason(error)})") from error
        for ending, columns in zip(FILES, (values, parameters), strict=True):
            lines = [f"# {' '.join(columns)}"]
            lines += [
                " ".join(f"{v!r}" for v in row) for row in zip(*columns.values(), strict=True)
            ]
            write_atomically(place / f"{label}{ending}", "\n".join(lines) + "\n")
            written.append(str(place / f"{label}{ending}"))
    return written
