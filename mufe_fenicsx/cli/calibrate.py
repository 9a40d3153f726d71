"""`mufe calibrate`: material parameters from tests of single grains.

What the command needs is imported where it runs, so that `mufe --help` is quick.
"""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..units import to_si, with_unit
from .app import Json, Overwrite, app, serial_only
from .arguments import lengths, number_or_text
from .terminal import Printer, progress_bar

#: Of the grains [kg/m³] where nobody states it.
DENSITY = 2650.0


@app.command()
def calibrate(
    data: Annotated[
        list[Path],
        typer.Argument(metavar="DATA...", help="CSV files: columns by name, [unit] behind each."),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder to write.")
    ] = Path("calibration"),
    diameter: Annotated[
        str | None,
        typer.Option(
            metavar="D", help='Of grains without a column of it, "0.8 mm", or length,width,height.'
        ),
    ] = None,
    test: Annotated[
        str,
        typer.Option(help="platens: a grain between two; grains: two alike; platen: on one."),
    ] = "platens",
    platen: Annotated[
        str, typer.Option(metavar="E,NU", help='Of platens; "rigid" for none. Default: steel.')
    ] = "210 GPa,0.3",
    nu: Annotated[
        float | None, typer.Option(help="Poisson's ratio of the grains. Default: scene's, or 0.2.")
    ] = None,
    density: Annotated[
        str | None,
        typer.Option(metavar="RHO", help="Of the block. Default: scene's, or 2650 kg/m^3."),
    ] = None,
    modulus: Annotated[
        str | None, typer.Option(metavar="E", help="Young's modulus, where it is known.")
    ] = None,
    compliance: Annotated[
        str,
        typer.Option(
            metavar="C",
            help='Of the machine, as "0.05 um/N"; else sought: "common", or "each" for each curve.',
        ),
    ] = "common",
    offset: Annotated[
        str | None,
        typer.Option(metavar="X", help="Displacement at touch, where it is known; else sought."),
    ] = None,
    scene: Annotated[
        Path | None,
        typer.Option(
            metavar="SCENE",
            help="Of this grain's own mesh between platens, as of `mufe new single-grain`: it is "
            "run with what is found, in turns, and stands for the ball.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = None,
):
    """Material parameters, friction and strength from tests of single grains."""
    serial_only("calibrate")
    printer = Printer(json)
    from ..calibration.calibrate import Options
    from ..calibration.calibrate import calibrate as fit_all
    from ..calibration.fit import Given
    from ..calibration.model import TESTS, Setup
    from ..calibration.rounds import read_grain

    if test not in TESTS:
        raise InputError(f'--test "{test}", expected one of {", ".join(TESTS)}')
    if nu is not None and not 0.0 <= nu < 0.5:
        raise InputError(f"--nu {nu:g}, expected 0 <= nu < 0.5")
    sought = compliance in ("common", "each")
    given = Given(
        _usual("--modulus", modulus, "Pa"),
        None if offset is None else to_si(number_or_text(offset), "m", "--offset"),
        compliance if sought else to_si(number_or_text(compliance), "m/N", "--compliance"),
    )
    if not sought and given.compliance < 0.0:
        raise InputError(f"--compliance {compliance}, expected 0 or more")
    grain, size = None, _size(diameter)
    density = _usual("--density", density, "kg/m^3")
    if scene is not None:
        grain = _grain(read_grain(scene), test, nu, density)
        nu, density = grain.scene.material.nu, grain.scene.material.rho
        size = size or grain.size
    setup = Setup(0.2 if nu is None else nu, test, _platen(platen))
    options = Options(setup, given, density or DENSITY, size, grain)
    with progress_bar("calibrating") as progress:
        result = fit_all(data, options, output, overwrite, progress, printer.say)
    _print(printer, result)
    printer.write_json(result)


def _grain(grain, test, nu, density):
    """The grain of a scene, with which the other options agree."""
    material = grain.scene.material
    for name, value, wanted in (
        ("--nu", nu, material.nu), ("--density", density, material.rho), ("--test", test, "platens")
    ):  # fmt: skip
        if value is not None and value != wanted:
            raise InputError(f"{name} {value}, expected with --scene {wanted}")
    return grain


def _print(printer, result):
    rows = []
    for row in result["parameters"]:
        ends = [row.get(key) for key in ("low", "high")]
        value = row["value"]
        value = "not determined" if value is None else with_unit(value, row["unit"])
        rows.append([row["name"], value,
                     *("" if e is None else with_unit(e, row["unit"]) for e in ends)])  # fmt: skip
    printer.table(["parameter", ">value", ">95 %, from", ">to"], rows)
    printer.say(*result["notes"])
    if result["material"]:
        printer.say("", *result["material"].strip().splitlines(), "")
    printer.say(f"tables and figures: {result['output']}")


def _platen(text):
    """Modulus [Pa] and Poisson's ratio of platens of a text "210 GPa,0.3"; None of "rigid"."""
    if text == "rigid":
        return None
    modulus, comma, nu = (part.strip() for part in text.partition(","))
    if not comma:
        raise InputError(f'--platen "{text}", expected "rigid" or modulus and ν: "210 GPa,0.3"')
    ratio = to_si(number_or_text(nu), "", "--platen")
    if not 0.0 <= ratio < 0.5:
        raise InputError(f"--platen ν = {nu}, expected 0 <= ν < 0.5")
    return _usual("--platen", modulus, "Pa"), ratio


def _usual(name, text, unit):
    """A modulus or a density of an option, within what solids have; None where it is left out."""
    from ..materials.elastic import USUAL_E, USUAL_RHO

    if text is None:
        return None
    value, (least, most) = to_si(number_or_text(text), unit, name), {
        "Pa": USUAL_E, "kg/m^3": USUAL_RHO
    }[unit]  # fmt: skip
    if not least <= value <= most:
        low, high = with_unit(least, unit), with_unit(most, unit)
        raise InputError(
            f"{name} {with_unit(value, unit)}, expected {low} to {high}: has a unit been left out?"
        )
    return value


def _size(text):
    """Of a text "0.8 mm" or "1 mm,0.8 mm,0.7 mm"; None where it is left out."""
    from ..calibration.data import Size

    if text is None:
        return None
    found = lengths(text)
    edges = [
        to_si(edge, "m", "--diameter") for edge in (found if isinstance(found, list) else [found])
    ]
    if len(edges) not in (1, 3) or min(edges) <= 0.0:
        raise InputError(f'--diameter "{text}", expected one length > 0 or length,width,height')
    return Size(*(edges * 3 if len(edges) == 1 else edges))
