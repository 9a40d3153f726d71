"""Commands for scene files: what may stand in one, and new ones to begin with.

What a command needs is imported where it runs, so that `mufe --help` is quick.
"""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .app import Json, Overwrite, SceneChanges, app, serial_only
from .arguments import stated_texts
from .terminal import Printer


@app.command()
def scene(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="SCENE", help="Scene to check, and to print with all defaults."),
    ] = None,
    explain: Annotated[
        str | None,
        typer.Option(
            metavar="KEY",
            help="What a key or table is; beside SCENE, also what it has there.",
        ),
    ] = None,
    changes: SceneChanges = None,
    schema: Annotated[
        bool, typer.Option("--schema", help="JSON schema of a scene, for editors.")
    ] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Write it there instead.")
    ] = None,
    overwrite: Overwrite = False,
):
    """Check a scene file, explain a key of one, or give their JSON schema."""
    serial_only("scene")
    if (file is None and explain is None) != schema:
        raise InputError("expected SCENE, --explain KEY or both of them, or --schema alone")
    if changes and (file is None or explain is not None):
        raise InputError("--set beside no SCENE or --explain, expected SCENE alone with it")
    if schema:
        from ..scene.schema import schema_text

        text = schema_text()
    elif explain is not None:
        from ..scene.explanations import explain as explained

        lines = explained(explain)
        if file is not None:
            from ..scene import load_scene
            from ..scene.explanations import in_file

            load_scene(file)
            lines += ["", *in_file(explain, file)]
        text = "\n".join(lines) + "\n"
    else:
        from ..scene import load_scene, scene_to_toml
        from ..scene.schema import absent_schema
        from ..scene.usual import unusual

        loaded = load_scene(file, stated_texts(changes))
        _read_files_of(loaded)
        for line in [*unusual(loaded), *filter(None, [absent_schema(file)])]:
            typer.echo(f"mufe: {line}", err=True)
        text = scene_to_toml(loaded)
    if output is None:
        Printer().say(text.rstrip("\n"))
        return
    from ..machine.files import new_files

    with new_files(output, overwrite=overwrite) as folder:
        (folder / output.name).write_text(text, encoding="utf-8")


def _read_files_of(scene):
    """Read the motions, tools and measured curves that a scene names, to check them."""
    if scene.stages:
        from ..loading.measured_paths import read_motions

        read_motions(scene.stages, scene.container.kind)
    if scene.tools:
        from ..run.scene_tools import read_tools

        read_tools(scene)
    for reference in scene.references:
        from ..results.reference_curves import read_reference

        read_reference(reference)


@app.command()
def new(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            help="scan (one of your own), oedometer, isotropic, triaxial, shear-box, single-grain, "
            "crushing or two-spheres",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Folder to write; default: KIND."),
    ] = None,
    membrane: Annotated[
        bool, typer.Option("--membrane", help="The sample of a triaxial test in a membrane.")
    ] = False,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Write a scene to begin with: commented; but for scan with grains, ready for `mufe run`."""
    serial_only("new")
    printer = Printer(json)
    from ..synthetic.starter_scenes import write_new_scene

    folder = Path(kind) if output is None else output
    result = write_new_scene(kind, folder, overwrite=overwrite, membrane=membrane)
    printer.summary(result)
    printer.write_json(result)
