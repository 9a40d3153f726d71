"""`mufe paraview`: files of a run that ParaView shows at once."""

from pathlib import Path
from typing import Annotated

import typer

from .app import Json, app, serial_only
from .terminal import Printer


@app.command()
def paraview(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder that `mufe run` wrote.")],
    json: Json = None,
):
    """Write contacts, strains of grains, fragments and a script for ParaView into a run folder."""
    serial_only("paraview")
    printer = Printer(json)
    from ..report.paraview import write_paraview
    from ..results import Run

    result = write_paraview(Run(folder))
    printer.say(*result["missing"])
    printer.say(f"in ParaView, File > Load State: {result['script']}")
    printer.say(f"or a picture: pvbatch {result['script']} PICTURE.png")
    printer.write_json(result)
