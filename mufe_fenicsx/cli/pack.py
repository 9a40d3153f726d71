"""`mufe pack`: a packing of grains by gravity or compression.

What the command needs is imported where it runs, so that `mufe --help` is quick.
"""

from pathlib import Path
from typing import Annotated

import typer

from ..synthetic.rigid_packing.settings import PackSettings
from .app import Json, Overwrite, app, serial_only
from .arguments import merged_settings, with_settings
from .terminal import Printer, progress_bar


@app.command()
@with_settings(PackSettings)
def pack(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder to write.")],
    source: Annotated[
        str | None,
        typer.Argument(
            metavar="SOURCE",
            help="Grains that `mufe mesh` wrote, meshes:NAME, surfaces (STL …), or the shapes.csv "
            "of `mufe shapes`; left out: random grains.",
        ),
    ] = None,
    spheres: Annotated[bool, typer.Option("--spheres", help="Pack spheres.")] = False,
    given: dict | None = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Pack rigid grains by gravity or compression, mesh them and write a scene."""
    serial_only("pack")
    printer = Printer(json)
    settings = merged_settings(PackSettings, None, given)
    from ..synthetic.rigid_packing.pipeline import pack as make

    with progress_bar("packing") as progress:
        result = make(
            source, settings, output, spheres=spheres, overwrite=overwrite, progress=progress
        )
    printer.summary(result)
    printer.write_json(result)
