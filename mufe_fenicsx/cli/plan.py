"""The command `mufe plan`: how much model a test needs, and what it will cost here."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..machine.doing import Doing
from .app import Json, app, world
from .arguments import number_or_text, parameters, ratio, stated_texts
from .terminal import Printer

CASES = (
    "hertz", "mindlin", "impact", "plastic-sphere", "oedometer", "jammed", "cylinder-wall", "tool",
    "membrane",
)  # fmt: skip


@app.command()
def plan(
    scene: Annotated[
        str,
        typer.Argument(metavar="SCENE", help=f"Scene file (TOML), or a case: {', '.join(CASES)}."),
    ],
    accuracy: Annotated[
        str | None,
        typer.Option(
            help='Wanted error of the stress, 0.05 or "5 %"; default: that of the scene. '
            "Without one: what the test as it stands gives."
        ),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="K=V",
            help="Change the scene, as loading.speed=0.5, or a parameter of a case; repeatable.",
        ),
    ] = None,
    cost: Annotated[
        str | None,
        typer.Option(
            help='Wanted time of the run after its seating, "8 min": the least error it buys here.'
        ),
    ] = None,
    modulus: Annotated[
        str | None,
        typer.Option(
            help='Constrained modulus of the sample, as from a laboratory, "300 MPa"; default: '
            "that of the scene, else a guess from grains, contacts and stress."
        ),
    ] = None,
    grains: Annotated[Path | None, typer.Option(metavar="DIR", help="As of `mufe run`.")] = None,
    json: Json = None,
):
    """What a test needs for an accuracy: model, mesh, speed, steps, memory, time; under mpirun too.

    Nothing is written. About a second of the test itself is run to measure this machine.
    """
    comm = world()
    printer = Printer(json, comm.rank)
    accuracy = ratio("--accuracy", accuracy)
    if scene in CASES and not Path(scene).exists():
        if modulus is not None:
            raise InputError(f"--modulus {modulus} with a case, expected one with a scene file")
        _plan_case(scene, accuracy, parameters(changes), printer, cost)
        return
    if cost is not None and accuracy is not None:
        raise InputError("--cost beside --accuracy, expected one of them")
    stated = stated_texts(changes) | ({} if modulus is None else {"modulus": modulus})
    _plan_scene(comm, scene, accuracy, stated, printer, cost, grains)


def _plan_scene(comm, scene, accuracy, stated, printer, cost, grains):
    from ..planning.text import as_dict, lines, lines_of_present
    from ..run.scene_file import read_scene
    from ..scene.usual import unusual
    from ..units import to_si

    loaded = read_scene(comm, Path(scene), stated)
    printer.say(*unusual(loaded))
    grains = loaded.sample.grains if grains is None else grains
    from ..planning.run import make_plan, plan_within, present

    if cost is not None:
        seconds = to_si(number_or_text(cost), "s", "--cost")
        with Doing("planning", comm.rank == 0):
            made, cost = plan_within(loaded, grains, comm, seconds)
    elif accuracy is None and loaded.accuracy is None:
        with Doing("measuring this machine", comm.rank == 0):
            found, cost = present(loaded, grains, comm)
        printer.say(*lines_of_present(found, cost))
        printer.write_json(as_dict(found, cost))
        return
    else:
        with Doing("planning", comm.rank == 0):
            made, cost = make_plan(loaded, grains, comm, accuracy)
    printer.say(*lines(made, cost))
    printer.write_json(as_dict(made, cost))


def _plan_case(case, accuracy, stated, printer, cost):
    if cost is not None:
        raise InputError(f"--cost {cost} with a case, expected one with a scene file")
    from ..planning.case import measured, plan_case

    point = plan_case(case, accuracy, stated=stated)
    known = "measured" if measured(point) else point.status
    printer.summary({
        "case": case, "accuracy": accuracy, "error": point.error, "choice": point.series,
        "processor_time_s": point.seconds, "known": known, "command": point.command,
    })  # fmt: skip
    printer.write_json(asdict(point) | {"accuracy": accuracy})
