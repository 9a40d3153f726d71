"""Commands from an image to meshes of grains: thin layers over the functions that do the work.

What a command needs is imported where it runs, so that `mufe --help` is quick.
"""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..geometry.settings import MeshSettings, SegmentSettings
from ..machine.doing import Doing
from .app import Json, Overwrite, SceneOption, app, serial_only
from .arguments import (
    merged_settings,
    number_or_text,
    parameters,
    voxel_edges,
    whole_numbers,
    with_settings,
)
from .terminal import Printer, progress_bar


@app.command()
@with_settings(SegmentSettings)
def segment(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="LABELS", help="Labels to write (TIFF).")
    ],
    image: Annotated[
        str | None,
        typer.Argument(metavar="IMAGE", help="Grey image; left out: the one that the scene names."),
    ] = None,
    scene: SceneOption = None,
    given: dict | None = None,
    truth: Annotated[
        Path | None,
        typer.Option(metavar="LABELS", help="True labels, to tell how many grains are found."),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Part the grains of a grey image: threshold, distance map, watershed."""
    serial_only("segment")
    printer = Printer(json)
    from ..scene import image_path, load_scene

    in_scene = load_scene(scene).image if scene is not None else None
    if image is None and in_scene is None:
        raise InputError("IMAGE is missing, expected an image or a --scene with [image] file")
    if in_scene is not None:
        in_scene = in_scene.separated_by(given["separation"])
    settings = merged_settings(SegmentSettings, in_scene, given)
    with Doing("segmenting"):
        from ..geometry.segment import segment_image

        path = image_path(in_scene.file if image is None else image)
        result = segment_image(path, settings, output, truth=truth, overwrite=overwrite)
    printer.summary(result)
    if result["compared"]:
        printer.say("", f"against {truth}:")
        printer.summary(result["compared"])
    printer.say(*result["notices"])
    printer.say(*(f"warning: {line}" for line in result["warnings"]))
    printer.write_json(result)


@app.command()
@with_settings(MeshSettings)
def mesh(
    labels: Annotated[
        Path,
        typer.Argument(
            metavar="LABELS",
            help="Labels (any image format), surfaces (.npz), or a folder of STL files.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="GRAINS", help="Folder to write.")
    ],
    scene: SceneOption = None,
    given: dict | None = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Mesh each grain with tetrahedra and print their quality."""
    serial_only("mesh")
    printer = Printer(json)
    from ..scene import load_scene

    in_scene = load_scene(scene).mesh if scene is not None else None
    settings = merged_settings(MeshSettings, in_scene, given)
    with progress_bar("meshing") as progress:
        from ..geometry.mesh import mesh_labels

        result = mesh_labels(labels, settings, output, overwrite=overwrite, progress=progress)
    printer.summary(result)
    if result["renumbered"]:
        printer.say("labels are numbered anew; labels.csv says what they were (label_in_file)")
    printer.say(*_first_lines("", result["notices"]))
    printer.say(*(f"repaired {notice}" for notice in result["repaired"]))
    printer.say(*_first_lines("filled", result["filled"]))
    printer.say(*_first_lines("warning:", result["warnings"]))
    printer.say(*_failed_grains(result))
    printer.write_json(result)


@app.command("import")
def import_meshes(
    mesh: Annotated[Path, typer.Argument(metavar="FILE", help="Tetrahedra that meshio can read.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="GRAINS", help="Folder to write.")
    ],
    scale: Annotated[
        str | None, typer.Option(help='Length unit of the file, such as "1 mm"; default: "1 m".')
    ] = None,
    labels: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="What tells grains apart: cell data, the begin of the names of element sets, "
            "sets (all of them) or pieces (what hangs together).",
        ),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Take tetrahedral meshes of grains from another program as they are."""
    serial_only("import")
    printer = Printer(json)
    from ..geometry.grains import save_grains
    from ..geometry.measure import assumed_unit
    from ..geometry.tets.foreign_meshes import import_grains
    from ..machine.files import new_folder
    from ..units import to_si

    notices = []
    unit = 1.0 if scale is None else to_si(number_or_text(scale), "m", "--scale")
    grains = import_grains(mesh, unit, labels=labels, notices=notices)
    if scale is None:
        notices.append(assumed_unit(mesh, grains.points))
    with new_folder(output, overwrite=overwrite, marker="grains.h5") as folder:
        save_grains(folder, grains)
    result = {
        "grains": str(output),
        "num_grains": grains.num_grains,
        "num_cells": len(grains.cells),
        "num_nodes": len(grains.points),
        "element_size": grains.element_size,
        "notices": notices,
    }
    printer.summary(result)
    printer.say(*notices)
    printer.write_json(result)


@app.command()
def shapes(
    source: Annotated[
        Path, typer.Argument(metavar="SOURCE", help="Folder that `mufe mesh` wrote, or labels.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Folder for shapes.csv and shapes.png."),
    ] = None,
    voxel_size: Annotated[
        str | None,
        typer.Option(help='Of labels that do not state it, "5 um", or three: z,y,x.'),
    ] = None,
    key: Annotated[str | None, typer.Option(help="Name of the labels in an .npz file.")] = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Size and form of each grain: lengths, sphericity, inertia, orientation, size distribution."""
    serial_only("shapes")
    printer = Printer(json)
    size = voxel_edges(voxel_size)
    output = Path(f"{source.stem}-shapes") if output is None else output
    with Doing("measuring shapes"):
        from ..geometry.form.shape_table import write_shapes

        result = write_shapes(source, output, voxel_size=size, key=key, overwrite=overwrite)
    printer.summary(result)
    printer.say(*result["notices"])
    printer.write_json(result)


@app.command()
def synthesize(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder to write.")],
    shape: Annotated[str | None, typer.Option(help="Voxels of the image: z,y,x.")] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="K=V", help='Change a setting, as d50="300 um"; repeatable.'),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Of all random numbers.")] = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Make a synthetic scan of sand whose grains and contacts are known."""
    serial_only("synthesize")
    printer = Printer(json)
    from ..synthetic.settings import settings_from

    given = parameters(changes)
    if shape is not None:
        given["shape"] = tuple(whole_numbers("--shape", shape, "z,y,x"))
    if seed is not None:
        given["seed"] = seed
    settings = settings_from(given)
    from ..synthetic.pipeline import synthesize as make

    with progress_bar("packing") as progress:
        result = make(settings, output, overwrite=overwrite, progress=progress)
    printer.summary(result)
    printer.write_json(result)


def _first_lines(what, lines, num_lines=10):
    """The first lines, each after what it is, and how many follow."""
    more = len(lines) - num_lines
    rest = [f"{what} {more} other grains, see quality.csv or --json"] if more > 0 else []
    return [line.strip() for line in [f"{what} {line}" for line in lines[:num_lines]] + rest]


def _failed_grains(result, num_reasons=10):
    """Lines that name every grain without a mesh, with the reasons of the first ones."""
    failed = result["failed"]
    if not failed:
        return []
    lines = [f"grains not meshed: {len(failed)}, of label {', '.join(map(str, failed))}"]
    first = list(zip(failed, result["reasons"], strict=True))[:num_reasons]
    lines += [f"  grain {label}: {reason}" for label, reason in first]
    if len(failed) > num_reasons:
        lines.append(f"  the other reasons are in {Path(result['grains']) / 'quality.csv'}")
    return lines
