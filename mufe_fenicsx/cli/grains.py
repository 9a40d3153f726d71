"""Commands from an image to meshes of grains: thin layers over the functions that do the work.

What a command needs is imported where it runs, so that `mufe --help` is quick.
"""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .app import Json, Overwrite, SceneOption, app, serial_only
from .arguments import (
    crop_ranges,
    lengths,
    merged_settings,
    number_or_text,
    parameters,
    whole_numbers,
)
from .terminal import Printer, progress_bar

RawShape = Annotated[str | None, typer.Option(help="Of a raw file, along its axes: z,y,x.")]
RawType = Annotated[
    str | None, typer.Option(help='Of a raw file, such as "<u2"; ">" is big endian.')
]
Key = Annotated[str | None, typer.Option(help="Name of the array in a .npz or .h5 file.")]
Axes = Annotated[str | None, typer.Option(help="Order of the file's axes, slowest first: zyx.")]


@app.command()
def segment(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="LABELS", help="Labels to write (TIFF).")
    ],
    image: Annotated[
        str | None,
        typer.Argument(metavar="IMAGE", help="Grey image; left out: the one that the scene names."),
    ] = None,
    scene: SceneOption = None,
    voxel_size: Annotated[
        str | None, typer.Option(help='Edge of a voxel, "5 um", or along z,y,x.')
    ] = None,
    shape: RawShape = None,
    dtype: RawType = None,
    key: Key = None,
    axes: Axes = None,
    crop: Annotated[str | None, typer.Option(help="Voxels to keep: z0:z1,y0:y1,x0:x1.")] = None,
    mask: Annotated[
        str | None,
        typer.Option(help="What was measured: cylinder, none, a grey level outside, or a file."),
    ] = None,
    invert: Annotated[
        bool | None,
        typer.Option("--invert/--bright", help="Grains are darker than voids; or brighter."),
    ] = None,
    upsample: Annotated[str | None, typer.Option(help="Label voxels per image voxel.")] = None,
    filter: Annotated[str | None, typer.Option(help="gaussian, median or none.")] = None,
    filter_radius: Annotated[str | None, typer.Option(help="Of the filter, in voxels.")] = None,
    threshold: Annotated[
        str | None, typer.Option(help="middle, gaussians, otsu or a grey level.")
    ] = None,
    separation: Annotated[
        str | None, typer.Option(help="depth, level (ITK's watershed filter) or markers.")
    ] = None,
    marker_depth: Annotated[
        str | None, typer.Option(help="Dip of the distance map that parts grains, in voxels.")
    ] = None,
    relative_depth: Annotated[
        str | None, typer.Option(help="The same, over the grain's largest distance to the void.")
    ] = None,
    watershed_threshold: Annotated[
        str | None, typer.Option(help="ITK's threshold, with separation level.")
    ] = None,
    watershed_level: Annotated[
        str | None, typer.Option(help="ITK's level, with separation level.")
    ] = None,
    contact_level: Annotated[
        str | None,
        typer.Option(help="Least brightness of a contact, void 0, solid 1; 0: none asked."),
    ] = None,
    fill_pores: Annotated[
        bool | None, typer.Option("--fill-pores/--keep-pores", help="Fill voids inside grains.")
    ] = None,
    min_grain_voxels: Annotated[
        int | None, typer.Option(help="Smaller fragments are no grains.")
    ] = None,
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
    from ..geometry.settings import SegmentSettings
    from ..scene import image_path, load_scene

    in_scene = load_scene(scene).image if scene is not None else None
    if image is None and in_scene is None:
        raise InputError("IMAGE is missing, expected an image or a --scene with [image] file")
    settings = merged_settings(
        SegmentSettings,
        in_scene if in_scene is None else in_scene.separated_by(separation),
        voxel_size=lengths(voxel_size),
        axes=axes,
        shape=shape and whole_numbers("--shape", shape, "z,y,x"),
        dtype=dtype,
        key=key,
        crop=crop and crop_ranges(crop),
        mask=number_or_text(mask),
        invert=invert,
        upsample=number_or_text(upsample),
        filter=filter,
        filter_radius=number_or_text(filter_radius),
        threshold=number_or_text(threshold),
        separation=separation,
        marker_depth=number_or_text(marker_depth),
        relative_depth=number_or_text(relative_depth),
        watershed_threshold=number_or_text(watershed_threshold),
        watershed_level=number_or_text(watershed_level),
        contact_level=number_or_text(contact_level),
        fill_pores=fill_pores,
        min_grain_voxels=min_grain_voxels,
    )
    from ..geometry.pipeline import segment_image

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
    size: Annotated[str | None, typer.Option(help='Length of edges, such as "30 um".')] = None,
    smallest_size: Annotated[
        str | None, typer.Option(help="At least, where the size varies and in small grains.")
    ] = None,
    sizing: Annotated[
        str | None, typer.Option(help="What the size follows: uniform, curvature or contact.")
    ] = None,
    angle: Annotated[
        str | None, typer.Option(help="Between neighbouring facets, for --sizing curvature.")
    ] = None,
    contact_reach: Annotated[
        str | None, typer.Option(help="Gaps up to this are meshed finely, for --sizing contact.")
    ] = None,
    growth: Annotated[str | None, typer.Option(help="Of the size over distance.")] = None,
    surface_nodes: Annotated[
        int | None, typer.Option(help="Of each grain, whose sizes are scaled to that.")
    ] = None,
    inner_size: Annotated[
        str | None, typer.Option(help="Of edges inside grains, times those of the surface.")
    ] = None,
    min_angle: Annotated[
        str | None, typer.Option(help="Of triangles; grains with less are tried otherwise.")
    ] = None,
    smoothing: Annotated[str | None, typer.Option(help="Of surfaces, in voxels.")] = None,
    conforming: Annotated[
        bool | None,
        typer.Option("--conforming/--apart", help="Grains that touch share their facets there."),
    ] = None,
    keep_volume: Annotated[
        bool | None,
        typer.Option("--keep-volume/--free-volume", help="Keep the volume of each grain's voxels."),
    ] = None,
    processes: Annotated[int | None, typer.Option(help="Worker processes; 0: all cores.")] = None,
    time_limit: Annotated[str | None, typer.Option(help='For one grain, such as "2 min".')] = None,
    keep_largest_piece: Annotated[
        bool | None,
        typer.Option(
            "--keep-largest-piece/--whole-grains",
            help="Of a grain in several pieces; otherwise that is an error.",
        ),
    ] = None,
    fill_cavities: Annotated[
        bool | None,
        typer.Option(
            "--fill-cavities/--keep-cavities",
            help="Fill voids that a grain encloses; otherwise their surfaces are meshed too.",
        ),
    ] = None,
    voxel_size: Annotated[
        str | None, typer.Option(help='For labels that state none, "5 um", or along z,y,x.')
    ] = None,
    shape: RawShape = None,
    dtype: RawType = None,
    key: Key = None,
    axes: Axes = None,
    scale: Annotated[
        str | None, typer.Option(help='Length unit of surfaces, such as "1 mm".')
    ] = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Mesh each grain with tetrahedra and print their quality."""
    serial_only("mesh")
    printer = Printer(json)
    from ..geometry.settings import MeshSettings
    from ..scene import load_scene

    settings = merged_settings(
        MeshSettings,
        load_scene(scene).mesh if scene is not None else None,
        size=number_or_text(size),
        smallest_size=number_or_text(smallest_size),
        sizing=sizing,
        angle=number_or_text(angle),
        contact_reach=number_or_text(contact_reach),
        growth=number_or_text(growth),
        surface_nodes=surface_nodes,
        inner_size=number_or_text(inner_size),
        min_angle=number_or_text(min_angle),
        smoothing=number_or_text(smoothing),
        conforming=conforming,
        keep_volume=keep_volume,
        processes=processes,
        time_limit=number_or_text(time_limit),
        keep_largest_piece=keep_largest_piece,
        fill_cavities=fill_cavities,
        voxel_size=lengths(voxel_size),
        axes=axes,
        shape=shape and whole_numbers("--shape", shape, "z,y,x"),
        dtype=dtype,
        key=key,
        scale=number_or_text(scale),
    )
    from ..geometry.pipeline import mesh_labels

    with progress_bar("meshing") as progress:
        result = mesh_labels(labels, settings, output, overwrite=overwrite, progress=progress)
    printer.summary(result)
    if result["renumbered"]:
        printer.say("labels are numbered anew; labels.csv says what they were (label_in_file)")
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
    scale: Annotated[str, typer.Option(help='Length unit of the file, such as "1 mm".')] = "1 m",
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
    from ..geometry.atomic_output import new_folder
    from ..geometry.grains import save_grains
    from ..geometry.tets.foreign_meshes import import_grains
    from ..units import to_si

    notices = []
    unit = to_si(number_or_text(scale), "m", "--scale")
    grains = import_grains(mesh, unit, labels=labels, notices=notices)
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
        str | None, typer.Option(help='Of labels that do not state it, such as "5 um".')
    ] = None,
    key: Annotated[str | None, typer.Option(help="Name of the labels in an .npz file.")] = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Size and form of each grain: lengths, sphericity, inertia, orientation, size distribution."""
    serial_only("shapes")
    printer = Printer(json)
    from ..geometry.form.shape_table import write_shapes
    from ..units import to_si

    size = None if voxel_size is None else to_si(number_or_text(voxel_size), "m", "--voxel-size")
    output = Path(f"{source.stem}-shapes") if output is None else output
    result = write_shapes(source, output, voxel_size=size, key=key, overwrite=overwrite)
    printer.summary(result)
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
    return [f"{what} {line}" for line in lines[:num_lines]] + rest


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
