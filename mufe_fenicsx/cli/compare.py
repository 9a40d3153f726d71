"""`mufe compare`: a run beside scans of the same sample.

What the command needs is imported where it runs, so that `mufe --help` is quick.
"""

from math import degrees, isnan
from pathlib import Path
from typing import Annotated

import typer
from typer.core import TyperCommand

from .app import Json, Overwrite, app, serial_only
from .arguments import ratio, voxel_edges, whole_numbers
from .terminal import Printer, progress_bar

#: What is printed of each scan; the report and JSON have all.
SHOWN = (
    "strain", "shortening", "run_shortening", "num_grains", "num_on_labels", "num_tracked",
    "num_lost_in_scan", "mean_displacement",
    "mean_displacement_difference", "mean_difference_voxels", "num_rotations",
    "mean_rotation_difference_deg", "mean_dice", "contacts_gained", "run_contacts_gained",
    "contacts_lost", "run_contacts_lost",
)  # fmt: skip
#: Of these, numbers without a length that are rounded for it: 1e-15 is none.
ROUNDED = (
    "strain", "shortening", "run_shortening", "mean_difference_voxels",
    "mean_rotation_difference_deg",
)  # fmt: skip
#: Options that take several values in a row.
LISTS = ("--labels", "--tracks")


class _Lists(TyperCommand):
    """`--labels A B C` is `--labels A --labels B --labels C`."""

    def parse_args(self, ctx, args):
        told, of = [], None
        for word in args:
            if word.startswith("-") and word != "-":
                of = word if word in LISTS else None
                told += [] if of else [word]
            else:
                told += [of, word] if of else [word]
        return super().parse_args(ctx, told)


@app.command(cls=_Lists)
def compare(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder that `mufe run` wrote.")],
    labels: Annotated[
        list[Path],
        typer.Option(
            metavar="SCAN...", help="Labels: of the sample before the test, then of later scans."
        ),
    ],
    tracks: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="TABLE...",
            help="Of SPAM (ddic) or iDVC (.disp), one a later scan, instead of tracking here.",
        ),
    ] = None,
    strain: Annotated[
        str | None,
        typer.Option(
            metavar="E,E…", help="Of the run at each later scan; default: by the grains' motion."
        ),
    ] = None,
    align: Annotated[
        bool, typer.Option("--align", help="Take out the motion that all grains share.")
    ] = False,
    grains: Annotated[
        str | None,
        typer.Option(
            metavar="N,N…", help="Whose surfaces are shown; default: the six that differ most."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Folder; default: RUN-scans."),
    ] = None,
    voxel_size: Annotated[
        str | None,
        typer.Option(help='Where labels do not state it, such as "5 um"; default: of the first.'),
    ] = None,
    key: Annotated[
        str | None, typer.Option(help="Name of the labels in a .npz or .h5 file.")
    ] = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Track grains through scans and hold a run against them: motions, strains, contacts."""
    serial_only("compare")
    printer = Printer(json)
    strains = _strains(strain)
    shown = () if grains is None else whole_numbers("--grains", grains, "such as 3,12")
    size = voxel_edges(voxel_size)
    output = Path(f"{run.resolve().name}-scans") if output is None else output
    with progress_bar("tracking") as progress:
        from ..peers.scans import How, compare_scans

        result = compare_scans(
            run, labels, output, tracks=tracks or (), how=How(strains, align, shown),
            voxel_size=size, key=key, progress=progress, overwrite=overwrite,
        )  # fmt: skip
    for scan in result["scans"]:
        printer.say(f"{scan['scan']}:")
        printer.summary(_shown(scan))
        if scan["lost_in_scan"]:
            printer.say("labels lost: " + ", ".join(str(n) for n in scan["lost_in_scan"]))
        printer.say("")
    printer.say(f"the run counts from its grains as {result['run_counts_from']}")
    printer.say(*result["notices"], *(f"warning: {line}" for line in result["warnings"]))
    printer.say(f"stages that follow the scans: {result['stages']}")
    printer.say(f"report: {result['report']}")
    printer.write_json(result)


def _shown(scan):
    """What is printed of a scan: without rounding errors, angles in degrees."""
    angle = degrees(scan["mean_rotation_difference"])
    values = scan | {"mean_rotation_difference_deg": angle}
    for name in ROUNDED:
        values[name] = round(values[name], 9)
    return {name: values[name] for name in SHOWN if name in values and not isnan(values[name])}


def _strains(text):
    """Numbers of a text with commas; () where there is none."""
    parts = [] if text is None else text.split(",")
    return tuple(ratio("--strain", part.strip()) for part in parts)
