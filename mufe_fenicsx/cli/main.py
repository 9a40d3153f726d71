"""The command `mufe`: runs, reports and cases; the other modules here have the others.

What a command needs is imported where it runs, so that `mufe --help` is quick.
"""

import os
import sys
from math import inf
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..machine.doing import Doing
from . import calibrate as _calibrate  # noqa: F401
from . import chart as _chart  # noqa: F401
from . import compare as _compare  # noqa: F401
from . import export as _export  # noqa: F401
from . import grains as _grains  # noqa: F401
from . import pack as _pack  # noqa: F401
from . import paraview as _paraview  # noqa: F401
from . import plan as _plan  # noqa: F401
from . import scene as _scene  # noqa: F401
from . import sweep as _sweep  # noqa: F401
from . import watch as _watch  # noqa: F401
from .app import Json, Overwrite, SceneChanges, app, serial_only, world
from .arguments import known_names, parameters, place, stated_texts
from .exit_status import FAILED, INTERRUPTED, run_to_exit
from .summary_words import breakage_line, printed
from .terminal import Printer, number

#: Variable by which a shell asks for completions (`mufe --install-completion`).
COMPLETION = "_MUFE_COMPLETE"

#: What a row of a case says of its bound.
VERDICTS = {True: "passed", False: "FAILED", None: "measured"}

Changes = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="K=V", help="Change a parameter of the cases; repeatable."),
]
CaseNames = Annotated[list[str] | None, typer.Argument(metavar="CASE...", show_default=False)]
ListCases = Annotated[bool, typer.Option("--list", help="List the cases and end.")]


def main(arguments=None):
    """Run `mufe` with the given arguments (default: those of the process) and exit. Collective."""
    if COMPLETION in os.environ:  # a shell that asks how a word goes on, and waits
        app(arguments, prog_name="mufe")
    run_to_exit(lambda: _dispatch(arguments))


@app.command()
def run(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder to write; default: runs/SCENE's name."
        ),
    ] = None,
    grains: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder that `mufe mesh` wrote; default: the scene's sample.grains."
        ),
    ] = None,
    changes: SceneChanges = None,
    max_steps: Annotated[
        int | None,
        typer.Option(min=1, help="Stop at this time step, counted from the start of the test."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print the last summary only.")] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the last checkpoint in the folder.")
    ] = False,
    accept_loss: Annotated[
        bool,
        typer.Option("--accept-loss", help="Resume without results that are gone or changed."),
    ] = False,
    profile: Annotated[
        bool, typer.Option("--profile", help="Time of the parts of a step, on each rank.")
    ] = False,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Run the test of a scene; also under mpirun."""
    comm = world()
    printer = Printer(json, comm.rank)
    from ..run.scene_file import read_scene

    loaded = read_scene(comm, scene, stated_texts(changes))
    grains = loaded.sample.grains if grains is None else grains
    if grains is None:
        raise InputError(
            "sample.grains is missing, expected the folder that `mufe mesh` wrote, or --grains"
        )
    output = Path("runs") / scene.stem if output is None else output
    if resume and overwrite:
        raise InputError("--overwrite beside --resume, expected one of them")
    options = {
        "overwrite": overwrite,
        "max_steps": max_steps,
        # JSON on standard output stands alone there.
        "quiet": quiet or json == "-",
        "command": ["mufe", *sys.argv[1:]],
        "resume": resume,
        "accept_loss": accept_loss,
        "profile": profile,
    }
    result = _run_told(loaded, grains, output, comm, options)
    measured = result.get("profile")
    fine, cracks = result.get("contact_resolution"), breakage_line(result)
    printer.summary(
        printed(result)
        | {"elements_per_radius": fine and fine["half"]}
        | ({"cracks": cracks} if cracks else {})
        | {"all_hold_from": _place(result["holds_from"]["all"])}
    )
    if measured:
        from ..run.profile import profile_rows

        printer.table(*profile_rows(measured))
    printer.write_json(result)


def _place(found):
    """Where all checks begin to hold, as run.json has it, in words."""
    if isinstance(found, dict):
        return f'{found["strain"]:.4g} of stage "{found["stage"]}"'
    return "nowhere: read the checks of the report" if found is None else found


def _run_told(scene, grains, output, comm, options):
    """Run a test, and say so before the libraries of the computation are loaded. Collective."""
    wanted = comm.rank == 0 and not options["quiet"]
    if wanted:
        title = scene.title or "a test without title"
        print(f"mufe: {title}; grains {grains}, results in {output}", file=sys.stderr, flush=True)
    after = None
    with Doing("loading libraries", wanted) as doing:
        from ..kernels.build.ahead import compile_ahead
        from ..machine.memory import is_first_on_machine

        if is_first_on_machine(comm):
            compile_ahead()  # while this process loads the rest
        from ..run.run import run_scene

        if scene.accuracy is not None:
            from ..planning.run import planned_scene

            doing.what = "planning the test"
            measure = not options["resume"]
            scene, after = planned_scene(scene, grains, comm, measure=measure)
        return run_scene(scene, grains, output, comm, **options, after=after)


@app.command()
def report(
    folders: Annotated[
        list[Path],
        typer.Argument(metavar="DIR...", help="Folder that `mufe run` wrote; several: compared."),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder of the report. Default: DIR, or comparison."),
    ] = None,
    grain: Annotated[
        list[int] | None, typer.Option(help="Label of a grain to show; repeat for more.")
    ] = None,
    point: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y,Z", help="Place whose course is shown; repeat for more."),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Draw this figure only; repeatable.")
    ] = None,
    skip: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Leave this figure out; repeatable.")
    ] = None,
    overlay: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE", help="Measured curves to draw and compare, as lab.csv; repeatable."
        ),
    ] = None,
    chain_angle: Annotated[
        float, typer.Option(help="Of force chains against the stress of their grains [degrees].")
    ] = 45.0,
    json: Json = None,
):
    """Draw the figures of a run, or of several together, and write report.html beside them."""
    serial_only("report")
    printer = Printer(json)
    points = [place(text) for text in point or ()]
    with Doing("drawing the report"):
        if len(folders) == 1 and folders[0].is_dir():
            from ..geometry.tets.workers import load_ahead

            load_ahead("mufe_fenicsx.report.ahead")  # while this process loads much the same
        from ..report import write_report

        result = write_report(
            folders, output, grain, points, only, skip,
            processes=0, chain_angle=chain_angle, overlays=overlay or (),
        )  # fmt: skip
    printer.say(*(f"not in the report: {sentence}" for sentence in result["missing"]))
    printer.say(f"report: {result['report']}")
    printer.write_json(result)


@app.command()
def verify(
    cases: CaseNames = None,
    changes: Changes = None,
    list_cases: ListCases = False,
    json: Json = None,
):
    """Compare with closed-form solutions; without CASE, all of them."""
    comm = world()
    printer = Printer(json, comm.rank)
    from ..verification.cases import CASES, answer_of, chosen_cases, known_cases

    if list_cases:
        _list(printer, known_cases())
        return 0
    chosen = chosen_cases(known_names(cases or CASES, known_cases()), parameters(changes))
    results = []
    columns = ["case", "quantity", ">computed", ">theory", ">error", ">tolerance", "result"]
    for name, run in chosen:
        with Doing(f"verifying {name}, {len(results) + 1} of {len(chosen)}", comm.rank == 0):
            results.append(run(comm) if len(chosen) == 1 else answer_of(name, run, comm))
        rows = []
        for quantity, row in results[-1]["results"].items():
            names = ("computed", "theory", "error", "tolerance")
            values = [number(None if row.get(k) == inf else row.get(k)) for k in names]
            rows.append([name, quantity, *values, VERDICTS[row["passed"]]])
        if rows:
            printer.table(columns, rows)
        if "stopped" in results[-1]:
            printer.say(f"{name}: FAILED, {results[-1]['stopped']}")
    verdicts = [result["passed"] for result in results]
    num_failed, measured = verdicts.count(False), verdicts.count(None)
    without = f", {measured} measured without a bound" * bool(measured)
    printer.say(f"{verdicts.count(True)} passed, {num_failed} failed{without}")
    printer.write_json(results[0] if len(results) == 1 else results)
    return FAILED if num_failed else 0


@app.command()
def bench(
    cases: CaseNames = None,
    changes: Changes = None,
    list_cases: ListCases = False,
    json: Json = None,
):
    """Measure the throughput; without CASE, all that take minutes."""
    comm = world()
    printer = Printer(json, comm.rank)
    from ..verification.bench.benchmarks import BENCHMARKS, USUAL, run_benchmarks

    if list_cases:
        _list(printer, BENCHMARKS)
        return 0
    names = known_names(cases or USUAL, BENCHMARKS)
    with Doing(f"measuring {_counted(names)}", comm.rank == 0):
        results = run_benchmarks(names, parameters(changes), comm)
    rows = []
    for result in results:
        case = result.get("case", "")
        values = result.get("results", {k: v for k, v in result.items() if k != "case"})
        for name, value in values.items():
            if isinstance(value, dict):
                value = value.get("computed")
            rows.append([str(case), str(name), number(value)])
    printer.table(["case", "quantity", ">value"], rows)
    printer.write_json(results[0] if len(names) == 1 else results)
    return FAILED if any(result.get("passed") is False for result in results) else 0


@app.command()
def demo(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder to write.")
    ] = Path("demo-output"),
    sand: Annotated[
        bool, typer.Option("--sand", help="Make a scan of sand and take that for the image.")
    ] = False,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Oedometer test on a real image: segment, mesh, run, report."""
    serial_only("demo")
    printer = Printer(json)
    from ..run.demo import run_demo

    result = run_demo(output, overwrite, printer, sand)
    printer.write_json(result)
    return result["status"]


def _dispatch(arguments):
    """Status of the command; a usage error of typer becomes an `InputError`."""
    usage_error = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")
    try:
        status = app(arguments, prog_name="mufe", standalone_mode=False)
    except typer.Abort:
        raise KeyboardInterrupt from None
    except usage_error as error:
        if error.__class__.__name__ == "NoArgsIsHelpError":
            error.show()
            return error.exit_code
        context = getattr(error, "ctx", None)
        command = context.command_path if context is not None else "mufe"
        message = error.format_message().rstrip(".")
        raise InputError(f"{message}. See {command} --help.") from None
    if status == INTERRUPTED:  # typer has taken the interrupt for a status
        raise KeyboardInterrupt
    return status if isinstance(status, int) else 0


def _counted(names):
    """The name of a case, or how many there are."""
    names = list(names)
    return names[0] if len(names) == 1 else f"{len(names)} cases"


def _list(printer, cases):
    width = max(map(len, cases), default=0)
    for name, function in cases.items():
        text = (function.__doc__ or "").strip().partition("\n")[0]
        printer.say(f"{name:{width}}  {text}".rstrip())
    printer.write_json(list(cases))
