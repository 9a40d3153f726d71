"""The command `mufe chart`: error against cost over all choices of model."""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .app import Json, app, serial_only, world
from .arguments import known_names
from .terminal import Printer


@app.command()
def chart(
    cases: Annotated[
        list[str] | None, typer.Argument(metavar="CASE...", show_default=False)
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder to write.")
    ] = Path("charts"),
    full: Annotated[
        bool, typer.Option("--full", help="Finer meshes and all lines over all of them.")
    ] = False,
    draw_only: Annotated[
        bool, typer.Option("--draw-only", help="Draw what the table has; compute nothing.")
    ] = False,
    table: Annotated[
        Path | None,
        typer.Option(metavar="CSV", help="Table to go on with; default: DIR/points.csv."),
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(min=0, help="Stop after so long; the next call goes on.")
    ] = None,
    json: Json = None,
):
    """Chart error against cost: mesh, element, contact law, time step, mass, speed of loading.

    An interrupted chart goes on: points that its table has are not computed again.
    """
    serial_only("chart")
    world()
    printer = Printer(json)
    from ..verification.charts.grid import CHARTS
    from ..verification.charts.make import make_charts

    names = known_names(cases, CHARTS)
    if output.exists() and not output.is_dir():
        raise InputError(f"output {output} is a file, expected a folder")
    result = make_charts(names, output, table, full, draw_only, minutes, printer.say)
    rows = [
        [case, f"{100 * error:.3g} %", *(f"{gain:.3g}" for gain in gains)]
        for case, lines in result["gains"].items()
        for error, *gains in lines
    ]
    printer.table(["case", ">error", ">seed's cost over ours", ">over the front's"], rows)
    printer.say(f"table: {result['table']}")
    printer.write_json(result)
