"""Commands `mufe export …`: grains, labels and tests for other programs.

What a command needs is imported where it runs, so that `mufe --help` is quick.
"""

from pathlib import Path
from typing import Annotated

import typer
from typer.core import TyperGroup

from ..errors import InputError
from .app import Json, Overwrite, app, serial_only, world
from .arguments import number_or_text, ratio, voxel_edges
from .terminal import Printer, progress_bar


class _Export(TyperGroup):
    """`mufe export GRAINS -o FILE` is `mufe export mesh GRAINS -o FILE`."""

    def parse_args(self, ctx, args):
        if args and args[0] not in self.commands and args[0] != "--help":
            args = ["mesh", *args]
        return super().parse_args(ctx, args)


export = typer.Typer(
    cls=_Export,
    no_args_is_help=True,
    help="Write grains, labels or a test for another program; without COMMAND, mesh.",
)
app.add_typer(export, name="export")

GrainsFolder = Annotated[
    Path, typer.Argument(metavar="GRAINS", help="Folder that `mufe mesh` wrote.")
]
LabelsFile = Annotated[
    Path, typer.Argument(metavar="LABELS", help="Labels (TIFF or any other image format).")
]
OutputFolder = Annotated[
    Path, typer.Option("--output", "-o", metavar="DIR", help="Folder to write.")
]
VoxelSize = Annotated[
    str | None, typer.Option(help='Of labels that do not state it, such as "5 um".')
]
Key = Annotated[str | None, typer.Option(help="Name of the labels in a .npz or .h5 file.")]


@export.command()
def mesh(
    grains: GrainsFolder,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="FILE", help=".msh, .vtu, .vtk, .xdmf or .inp"),
    ],
    overwrite: Overwrite = False,
):
    """The meshes of all grains in one file, with the label of each cell."""
    serial_only("export mesh")
    from ..geometry.grains import load_grains
    from ..geometry.tets.foreign_meshes import export_grains

    export_grains(output, load_grains(grains), overwrite=overwrite)


@export.command()
def surfaces(
    grains: GrainsFolder,
    output: OutputFolder,
    format: Annotated[str, typer.Option(help="stl, ply or obj.")] = "stl",
    unit: Annotated[str, typer.Option(help='Length that is written as 1, such as "1 mm".')] = "1 m",
    overwrite: Overwrite = False,
    json: Json = None,
):
    """The closed surface of each grain, a file a grain."""
    serial_only("export surfaces")
    printer = Printer(json)
    from ..geometry.grains import load_grains
    from ..peers.surfaces import export_surfaces
    from ..units import to_si

    loaded, unit = load_grains(grains), to_si(number_or_text(unit), "m", "--unit")
    result = export_surfaces(output, loaded, kind=format, unit=unit, overwrite=overwrite)
    _done(printer, result)


@export.command()
def clumps(
    grains: GrainsFolder,
    output: OutputFolder,
    spheres: Annotated[int, typer.Option(help="Most spheres of a grain.")] = 20,
    missing: Annotated[
        str, typer.Option(help="Part of the volume that spheres inside may leave uncovered.")
    ] = "0.02",
    inscribed: Annotated[
        bool, typer.Option("--inscribed", help="Keep all spheres inside: the clump is too light.")
    ] = False,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Each grain as a clump of spheres, for YADE and other discrete elements."""
    serial_only("export clumps")
    printer = Printer(json)
    from ..geometry.grains import load_grains
    from ..peers.clump_files import export_clumps

    with progress_bar("clumps") as progress:
        result = export_clumps(
            output,
            load_grains(grains),
            num_spheres=spheres,
            missing=ratio("--missing", missing),
            grow=not inscribed,
            progress=progress,
            overwrite=overwrite,
        )
    _done(printer, result)


@export.command("level-sets")
def level_sets(
    grains: GrainsFolder,
    output: OutputFolder,
    spacing: Annotated[
        str | None, typer.Option(help='Of the grids, such as "10 um"; default: half an edge.')
    ] = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Each grain as signed distances on a grid, for level-set discrete elements and YADE."""
    serial_only("export level-sets")
    printer = Printer(json)
    from ..geometry.grains import load_grains
    from ..peers.level_set_files import export_level_sets
    from ..units import to_si

    size = None if spacing is None else to_si(number_or_text(spacing), "m", "--spacing")
    result = export_level_sets(output, load_grains(grains), spacing=size, overwrite=overwrite)
    _done(printer, result)


@export.command()
def fiji(
    labels: LabelsFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="TIFF stack to write.")
    ],
    voxel_size: VoxelSize = None,
    key: Key = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Labels as a stack that ImageJ and Fiji open with its voxel size."""
    serial_only("export fiji")
    printer = Printer(json)
    from ..peers.fiji import export_fiji

    array, edge = _labels(labels, voxel_size, key)
    _done(printer, export_fiji(output, array, edge, overwrite=overwrite))


@export.command()
def spam(
    labels: LabelsFile,
    output: OutputFolder,
    voxel_size: VoxelSize = None,
    key: Key = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Labels and their contacts as SPAM has them."""
    serial_only("export spam")
    printer = Printer(json)
    from ..peers.spam import export_spam

    array, edge = _labels(labels, voxel_size, key)
    _done(printer, export_spam(output, array, edge, overwrite=overwrite))


@export.command()
def calculix(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="Deck to write, .inp")
    ],
    grains: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder that `mufe mesh` wrote; default: the scene's sample.grains."
        ),
    ] = None,
    procedure: Annotated[
        str | None,
        typer.Option(help="static or dynamic (implicit); default: by the scene's integrator."),
    ] = None,
    units: Annotated[str, typer.Option(help="um, mm or m, with uN, N and N.")] = "um",
    reach: Annotated[
        str | None,
        typer.Option(help='Largest gap of a contact pair, such as "50 um"; default: by the test.'),
    ] = None,
    penalty: Annotated[
        float, typer.Option(help="Stiffness of contact over that of the layers of a run.")
    ] = 4.0,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """The test of a scene as a deck of CalculiX: grains, contact, rigid walls, one step."""
    serial_only("export calculix")
    comm = world()
    printer = Printer(json)
    from ..peers.calculix import export_calculix
    from ..scene import load_scene
    from ..units import to_si

    loaded = load_scene(scene)
    grains = loaded.sample.grains if grains is None else grains
    if grains is None:
        raise InputError(
            "sample.grains is missing, expected the folder that `mufe mesh` wrote, or --grains"
        )
    result = export_calculix(
        output,
        loaded,
        grains,
        comm,
        units=units,
        procedure=procedure,
        reach=None if reach is None else to_si(number_or_text(reach), "m", "--reach"),
        penalty=penalty,
        overwrite=overwrite,
    )
    _done(printer, result)


def _labels(path, voxel_size, key):
    """Labels and the edge of a voxel [m]."""
    from ..geometry.image.label_files import read_labels

    return read_labels(path, voxel_size=voxel_edges(voxel_size), key=key)


def _done(printer, result):
    """Print what was written."""
    printer.summary(result)
    printer.say(*(f"note: {line}" for line in result.get("notes", ())))
    printer.write_json(result)
