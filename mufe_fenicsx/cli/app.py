"""The program `mufe` as typer sees it, and what its commands share."""

from pathlib import Path
from typing import Annotated

import typer

from .. import __version__
from ..errors import InputError, raise_on_broken_pipes
from ..machine.mpi_launcher import forget_launcher

app = typer.Typer(
    name="mufe",
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # rich alone takes as long as all else of `mufe --help`
)

Json = Annotated[
    str | None,
    typer.Option("--json", metavar="PATH", help="Write the result as JSON; - for standard output."),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace earlier output.")]
SceneChanges = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="K=V",
        help='Change the scene, as loading.speed="0.5 m/s" or stage.2.z.strain=0.01; repeatable.',
    ),
]
SceneOption = Annotated[
    Path | None, typer.Option("--scene", metavar="SCENE", help="Take the settings of a scene file.")
]


@app.callback(invoke_without_command=True)
def _options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print it and end.")] = False,
    json: Annotated[
        bool,
        typer.Option("--json", help="With --version: that of libraries and the machine, as JSON."),
    ] = False,
):
    """Micro finite-element model of sand: from a CT scan to grains in frictional contact."""
    if version:
        typer.echo(_versions_as_json() if json else f"mufe_fenicsx {__version__}")
        raise typer.Exit
    if json or context.invoked_subcommand is None:
        raise InputError("--json before a command, expected it beside --version or behind one")


def _versions_as_json():
    import json
    import os
    import platform

    from ..output.run_folder import versions

    machine = {"machine": platform.platform(), "processors": os.cpu_count()}
    return json.dumps(versions() | machine, indent=2)


def world():
    """The communicator of all ranks, for commands that compute; PETSc is started too.

    Its options are those of PETSC_OPTIONS: a .petscrc in the folder where one works is not read.
    """
    import petsc4py

    # What nobody asks for is refused by linear_system, or none of our business.
    petsc4py.init(["mufe", "-skip_petscrc", "-options_left", "no"])
    raise_on_broken_pipes()
    return _all_ranks()


def _all_ranks():
    from mpi4py import MPI

    return MPI.COMM_WORLD


def serial_only(command):
    """Refuse several ranks; on one, worker processes shall not take themselves for it."""
    size = _all_ranks().size
    if size > 1:
        raise InputError(f"mufe {command} on {size} ranks, expected one: run it without mpirun")
    forget_launcher()
