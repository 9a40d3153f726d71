"""`mufe sweep`: many runs of a scene, with one table and one report.

What the command needs is imported where it runs, so that `mufe --help` is quick.
"""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..machine.doing import Doing
from .app import Json, app, serial_only
from .exit_status import FAILED
from .terminal import Printer, progress_bar


@app.command()
def sweep(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder to write; default: sweeps/SCENE's name."
        ),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="K=V,V",
            help='Values of a key, as contact.friction=0.1,0.23, or a range, as material.E="50 '
            'GPa:70 GPa" (:log behind it: even in the logarithm); pack.seed and so on are settings '
            "of `mufe pack`; repeatable.",
        ),
    ] = None,
    samples: Annotated[
        int | None, typer.Option(min=1, help="Of a Latin hypercube of the ranges.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of its random numbers.")] = 0,
    table: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help='Rows of parameters below "# name name", SI units.'),
    ] = None,
    grains: Annotated[Path | None, typer.Option(metavar="DIR", help="As of `mufe run`.")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Runs at a time.")] = 1,
    ranks: Annotated[int, typer.Option(min=1, help="Ranks of each run.")] = 1,
    slurm: Annotated[
        bool, typer.Option("--slurm", help="Write a job array for SLURM and run nothing.")
    ] = False,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Go on with the sweep in the folder, whose parameters need not be given.",
        ),
    ] = False,
    json: Json = None,
):
    """Run a scene with many parameters; one table and one report over all runs."""
    serial_only("sweep")
    printer = Printer(json)
    from ..planning.sweep.plan import kept_sweep, make_sweep, open_folder
    from ..planning.sweep.runs import make_packings

    folder = Path("sweeps") / scene.stem if output is None else output
    if resume and not changes and table is None and samples is None:
        made = kept_sweep(scene, folder, grains)
    else:
        made = make_sweep(scene, changes or [], table, samples, seed, grains)
    open_folder(folder, made, resume)
    with progress_bar("packing") as progress:
        places = make_packings(made, folder, progress)
    if slurm:
        from ..planning.sweep.slurm import write_array

        job = write_array(made, folder, places, ranks)
        printer.say(f"{len(made.rows)} runs: sbatch {job}; then the same command with --resume")
        printer.write_json({"job": str(job), "num_runs": len(made.rows)})
        return 0
    failed = _run(made, folder, places, (jobs, ranks), printer)
    return FAILED if failed else 0


def _run(made, folder, places, numbers, printer):
    """Run what is left of a sweep, then write table and report; names of the runs that failed."""
    from ..machine.mpi_launcher import find_mpirun
    from ..planning.sweep.results import (
        shown_table,
        table_of,
        write_loop_files,
        write_sweep_report,
    )
    from ..planning.sweep.runs import Runner

    jobs, ranks = numbers
    if ranks > 1 and find_mpirun() is None:
        raise InputError(f"--ranks {ranks} without mpirun, expected one beside Python or on PATH")
    runner = Runner(made, folder, places, ranks, printer.say)
    runner.run_all(jobs)
    rows = table_of(made, folder)
    texts, names = shown_table(made, rows)
    printer.table(names, texts)
    with Doing("drawing the report"):
        page = write_sweep_report(made, rows, folder)
    printer.say(f"table: {folder / 'table.csv'}", *([f"report: {page}"] if page else []))
    failed = {made.names[k]: why for k, why in runner.failed.items()}
    printer.write_json({
        "runs": rows, "table": str(folder / "table.csv"), "report": page, "failed": failed,
        "files": write_loop_files(made, folder),
    })  # fmt: skip
    return failed
