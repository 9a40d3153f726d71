"""`mufe calibrate`: from tables of tests of single grains to parameters, figures and a block."""

import csv
import io
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..machine.files import new_folder, write_atomically
from ..units import with_unit
from . import own_mesh, rounds, sentences
from .data import read_data, within_table
from .figures import draw_curves, draw_friction, draw_survival
from .fit import Given, fit_simplest
from .friction import fit_friction
from .model import Setup
from .parts import agreement
from .weibull import fit_weibull

#: File by which a folder of results is known.
TABLE = "parameters.csv"
#: Strength of grains over that of their facets, of `mufe new crushing` with scatter = "grain", and
#: the power of the latter with which it goes at one fracture energy: 60 MPa bear 94.7, 37.06 72.1.
CRUSHING, POWER = 1.6, 0.57
TITLES = {"E": "Young's modulus", "yield": "yield stress", "hardening": "slope of hardening"}


@dataclass(frozen=True)
class Options:
    """What is known of grains and machine."""

    setup: Setup
    given: Given
    density: float  #: [kg/m³]
    size: object = None  #: :class:`~.data.Size` of grains whose table has none
    grain: object = None  #: :class:`~.rounds.Grain` whose mesh is run; None: a ball


def calibrate(paths, options, output, overwrite=False, progress=None, say=print):
    """Fit all that the tables have and write it to a folder. Local.

    Args:
        paths: CSV files, as :mod:`~.data` says.
        options: :class:`Options`.
        output: Folder to write: parameters.csv, material.toml, curves.png, …
        overwrite: Replace an earlier one.
        progress: Function (done, total, text), or None.
        say: Called with lines on the rounds of a grain with its own mesh.

    Returns:
        A dict: ``parameters`` is a list of dicts (name, value, low, high, unit), of 95 %, value
        None where the data do not determine it;
        ``correlation``; ``material``, the block; ``notes``, sentences; ``output``.

    Raises:
        InputError: As of :func:`~.data.read_data`; or the folder is there.
        SolverError: A run of the grain failed.
        Interrupted: A signal came while one ran; runs stay.
    """
    data = read_data(paths, options.size)
    if options.grain is not None:
        data = options.grain.sized(data)
    runs, notes = Path(output) / rounds.FOLDER, data.notes[:]
    begun = options.grain is not None and rounds.begun(runs)
    marker = rounds.FOLDER if begun else TABLE
    with new_folder(output, overwrite=overwrite or begun, marker=marker) as folder:
        within = _within_model(data, options)
        if options.grain is not None:
            own = rounds.Rounds(data, options, runs, say)
            own.check(overwrite)
            setup, unsettled = own.settle()
            options = replace(options, setup=setup)
            data.notes[:] = [*notes, *([unsettled] if unsettled else [])]
            within = _within_model(data, options)
        data = within
        result = {"parameters": [], "notes": [f"{note}." for note in data.notes], "material": ""}
        if data.curves:
            _pressed(folder, data, options, result, progress)
        if data.rubbed:
            _rubbed(folder, data, result)
        if data.forces.size:
            _crushed(folder, data, result)
        write_atomically(folder / TABLE, _as_csv(result["parameters"]))
        if result["material"]:
            notes = "".join(f"# {note}\n" for note in result["notes"])
            write_atomically(folder / "material.toml", notes + result["material"])
        if options.grain is not None:
            runs.rename(folder / rounds.FOLDER)
    return result | {"output": Path(output)}


def _within_model(data, options):
    """The data without rows that the model does not know; what is given has to be possible."""
    setup, given = options.setup, options.given
    if setup.shape is not None:
        data = own_mesh.as_grain(data, setup.shape)
    data = within_table(data, setup, given.offset, given.known_compliance)
    for curve in data.curves:
        way = float(np.ptp(curve.displacement))
        most = way / float(curve.force.max())
        if given.known_compliance >= most:
            raise InputError(
                f"compliance = {given.compliance:.3g} m/N, expected less than {most:.3g} m/N, the "
                f"displacement over the force of curve {curve.name}"
            )
    return data


def _pressed(folder, data, options, result, progress):
    fit, given = fit_simplest(data.curves, options.setup, options.given, progress)
    law = agreement(fit, data.curves, options.setup, given)
    result["parameters"] += _found(fit, law)
    result["correlation"] = {"names": fit.names, "matrix": fit.correlation}
    said = sentences.limits_of(fit, given, law)
    far, spoilt = own_mesh.how_far(fit, options.setup)
    said += far
    result["notes"] += said
    unsure = given.E is None and (spoilt or bool(sentences.doubts(fit, given, law)))
    result["material"] = sentences.material_block(fit, options.setup.nu, options.density, unsure)
    offsets = [
        fit.value(f"offset {c.name}") if options.given.offset is None else options.given.offset
        for c in data.curves
    ]
    draw_curves(folder / "curves.png", data.curves, fit, offsets)
    table = [["", *fit.names], *([n, *(f"{v:.4f}" for v in row)]
             for n, row in zip(fit.names, fit.correlation, strict=True))]  # fmt: skip
    write_atomically(folder / "correlation.csv", _text(table))


def _found(fit, law):
    """Rows of the table; a model that does not fit has no intervals."""
    rows, fits = [], sentences.misfit(fit) is None
    for name in fit.names:
        ends = fit.interval(name) if fits and (name not in fit.held or fit.others) else None
        if ends and law and law.name == name and not law.agrees:
            ends = law.ends
        unit = sentences.UNITS[name.partition(" ")[0]]
        rows.append(_row(TITLES.get(name, name), fit.value(name), ends, unit))
    if sentences.yielded(fit):
        strain, stress, ends = sentences.end_of_table(fit)
        name = f"yield stress at plastic strain {strain:g}"
        rows.append(_row(name, stress, ends if fits else None, "Pa"))
    return [*rows, _row("scatter of force", fit.scatter, None, "")]


def _rubbed(folder, data, result):
    found = fit_friction(data.rubbed)
    rows = result["parameters"]
    for curve, stiffness in zip(data.rubbed, found.stiffness, strict=True):
        rows.append(_row(f"tangential stiffness {curve.name}", stiffness, None, "N/m"))
    if found.sliding:
        rows.append(_row("friction", found.mu, found.interval, ""))
        result["material"] += f"\n[contact]\nfriction = {found.mu:.3g}\n"
    else:
        least = max(float(np.max(c.force / c.normal)) for c in data.rubbed)
        result["notes"].append(f"No curve comes to slide: friction is at least {least:.2g}.")
    draw_friction(folder / "friction.png", data.rubbed, found)


def _crushed(folder, data, result):
    found = fit_weibull(data.forces, data.diameters)
    size = with_unit(found.size, "m")
    rows = result["parameters"]
    rows.append(_row("Weibull modulus", found.modulus, found.modulus_interval, ""))
    name = f"strength F/d² at {size}, which 37 % survive"
    rows.append(_row(name, found.strength, found.strength_interval, "Pa"))
    if found.exponent_interval:
        rows.append(_row("fall of strength with size, exponent", found.exponent,
                         found.exponent_interval, ""))  # fmt: skip
        low, high = found.exponent_interval
        volume = 3 / found.modulus
        flaws = f"flaws in the volume would have it fall with d^-{volume:.2f}"
        told = f"Strength goes with d^{-found.exponent:.2f}"
        if low <= 0.0 <= high:
            told = "The forces tell no effect of size"
        result["notes"].append(
            f"{told}; {flaws}, which {'fits' if low <= volume <= high else 'does not fit'}."
        )
    else:
        result["notes"].append("Sizes are alike or few: no effect of size is sought.")
    result["material"] += _fracture_block(found)
    draw_survival(folder / "survival.png", found)


def _fracture_block(found):
    """The table [fracture] of a scene, as TOML: what forces of grains do not tell lacks.

    Facets' strength over grains' was seen on one mesh: a comment.
    """
    told = "# strength and modulus: state them; the data do not tell them."
    if all(map(sentences.determined, (found.modulus_interval, found.strength_interval))):
        facets, modulus = with_unit(found.strength / CRUSHING, "Pa"), POWER * found.modulus
        volume = np.pi / 6 * found.size**3 * 1e9
        told = (
            f"# Grains: F/d^2 = {with_unit(found.strength, 'Pa')} at {with_unit(found.size, 'm')}, "
            f"Weibull {found.modulus:.2g}. Facets, as on the mesh of\n"
            "# `mufe new crushing`: crush one on yours, scale the strength, and take these:\n"
            f'# strength = "{facets}"\n# modulus = {modulus:.2g}\n'
            f'# reference_volume = "{volume:.3g} mm^3"'
        )
    return f"""
[fracture]
scatter = "grain"   # each grain has a strength of its own
{told}
# energy: state it; the data do not tell it.
"""


def _row(name, value, ends, unit):
    if ends is not None and not sentences.determined(ends):
        return {"name": name, "value": None, "unit": unit}
    interval = {} if ends is None else {"low": float(ends[0]), "high": float(ends[1])}
    return {"name": name, "value": float(value), **interval, "unit": unit}


def _as_csv(rows):
    lines = [["name", "value", "low_95", "high_95", "unit"]]
    for row in rows:
        ends = [f"{row[key]:.6g}" if key in row else "" for key in ("low", "high")]
        value = "" if row["value"] is None else f"{row['value']:.6g}"
        lines.append([row["name"], value, *ends, row["unit"]])
    return _text(lines)


def _text(lines):
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(lines)
    return out.getvalue()
