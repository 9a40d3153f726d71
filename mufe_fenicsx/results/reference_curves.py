"""Curves that were measured in a laboratory: read from a file, and compared with those of a run.

The first line of the file names the columns, each with its unit in brackets:

    strain [%], stress [MPa], k0 [-]
    0.0, 0.1, 0.55
    0.4, 1.2, 0.48

A test may unload and reload. Branches are told apart by where the strain turns, in the file and in
the run alike, and compared one by one.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..analysis import macro
from ..analysis.rows import loading_rows
from ..errors import InputError, nearest_name, shown
from ..loading.measured import NAME_AND_UNIT, read_table
from ..scene.reference import Column, Reference
from ..scene.values import build
from ..units import QUANTITIES, to_si

#: Quantity -> SI unit, "" of a ratio; compression is positive.
UNITS = {
    "strain": "",
    "stress": "Pa",
    "side_stress": "Pa",
    "k0": "",
    "void_ratio": "",
    "porosity": "",
    "p": "Pa",
    "q": "Pa",
    "volumetric_strain": "",
}
#: Other names of columns; capitals do not count.
SYNONYMS = {"sigma1": "stress", "sigma3": "side_stress"}
#: What is compared: quantity, over what (the first that both have), and whether relatively.
COMPARED = (
    ("stress", ("strain",), True),
    ("k0", ("stress", "strain"), False),
    ("void_ratio", ("stress", "strain"), False),
    ("q", ("strain", "p"), True),
    ("volumetric_strain", ("strain",), False),
)
#: A branch ends where the strain, or stress, turns back by more than this part of its range.
TURN = 0.02
#: Relative differences count where the measured value exceeds this part of its largest.
COUNTS = 0.1


@dataclass(frozen=True)
class ReferenceCurves:
    """Measured curves, SI units."""

    path: Path
    label: str  #: in legends and tables
    columns: dict[str, np.ndarray]  #: quantity -> values, shape (num_rows,)

    @cached_property
    def branches(self) -> list[slice]:
        """Rows of loading, unloading, reloading … in turn."""
        return branches_of(self.columns)


@dataclass(frozen=True)
class Difference:
    """A run less a measured curve, in one branch, at the measured points in the range of both."""

    reference: str  #: label of the measured curve
    quantity: str
    over: str  #: quantity at the same value of which they are compared
    branch: str
    relative: bool  #: differences are over the measured value
    num_points: int
    low: float  #: least value of what they are compared over, SI unit
    high: float  #: its largest
    mean: float  #: difference, with its sign
    largest: float  #: that of the largest absolute value, with its sign
    at: float  #: where that is


def read_reference(reference: Reference) -> ReferenceCurves:
    """Read measured curves. Local.

    Porosity n gives the void ratio n/(1-n) where that has no column; the stress of the sides over
    the vertical one gives K₀.

    Args:
        reference: File, label and columns.

    Raises:
        InputError: It cannot be read, a column is not known, has no unit or one of another
            dimension, nothing can be compared, or a value is no finite number; the message names
            the file and the line.
    """
    table = read_table(reference.file)
    where = f"{table.path}, line {table.number}"
    quantities, factors = _columns(where, table.header, reference.columns)
    values = table.values(quantities, least=1)
    kept = [name for name in quantities if name is not None]
    found = dict(zip(kept, values.T * np.array(factors)[:, None], strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        if "porosity" in found:
            found.setdefault("void_ratio", found["porosity"] / (1.0 - found["porosity"]))
        if {"stress", "side_stress"} <= set(found):
            found.setdefault("k0", found["side_stress"] / found["stress"])
    for name, numbers in found.items():
        if not np.isfinite(numbers).all():
            line = table.rows[int(np.argmin(np.isfinite(numbers)))][0]
            raise InputError(
                f"{table.path}, line {line}: {name} is not finite, expected a porosity below 1 and "
                "a stress that is not zero"
            )
    if not any(what in found and any(o in found for o in over) for what, over, _ in COMPARED):
        raise InputError(
            f"{where}: {', '.join(found)}, expected columns to compare, such as strain and stress"
        )
    return ReferenceCurves(table.path, reference.label, found)


def references_of(scene: Mapping) -> list[Reference]:
    """The tables [[reference]] of scene.toml of a run folder.

    Args:
        scene: As :attr:`Run.scene`.

    Raises:
        InputError: They are no such tables.
    """
    return [
        build(Reference, table, lambda key, k=k: f"reference[{k}].{key}")
        for k, table in enumerate(scene.get("reference", []), start=1)
    ]


def _columns(where, header, asked: Mapping[str, Column]):
    """Quantity of each column of the file, None where it is left aside, and factors to SI units."""
    cells = [NAME_AND_UNIT.fullmatch(cell) for cell in header]
    texts = [m[1] if m else cell.strip() for m, cell in zip(cells, header, strict=True)]
    units = [m[2] if m else None for m in cells]
    for quantity, column in asked.items():
        if quantity not in UNITS:
            raise InputError(
                f"columns.{quantity} of a reference is not known, expected "
                f"{nearest_name(quantity, UNITS)}"
            )
        if column.header not in texts:
            raise InputError(
                f"{where} has no column {shown(column.header)}, expected "
                f"{nearest_name(column.header, texts)}"
            )
    quantities: list[str | None] = [None] * len(header)
    factors = []
    for number, (text, unit) in enumerate(zip(texts, units, strict=True)):
        if asked:
            wanted = [q for q, column in asked.items() if column.header == text]
            if not wanted:
                continue
            quantity, unit = wanted[0], asked[wanted[0]].unit or unit
        else:
            quantity = SYNONYMS.get(text.lower(), text.lower())
        if quantity not in UNITS:
            raise InputError(
                f"{where}: {shown(text)} is not a known column, expected "
                f"{nearest_name(quantity, UNITS)}, or [[reference]] columns that say what it is"
            )
        if quantity in quantities:
            raise InputError(f"{where}: {quantity} is there twice, expected one column of it")
        quantities[number] = quantity
        factors.append(_factor(f"{where}: {text}", unit, UNITS[quantity]))
    return quantities, factors


def _factor(name, unit, wanted):
    """What a number of a unit is to be multiplied with to be in that of SI."""
    if not unit:
        example = f"[{QUANTITIES[wanted][1].split()[-1]}]" if wanted else "[-] or [%]"
        raise InputError(f"{name} has no unit, expected one behind the name, such as {example}")
    if unit == "-" and not wanted:
        return 1.0
    return to_si(f"1 {unit}", wanted, name)


def branches_of(columns: Mapping[str, np.ndarray]) -> list[slice]:
    """Rows of each branch: between the points where the strain turns, both ends included.

    Without a strain it is the stress that turns, or p.
    """
    name = next(name for name in ("strain", "stress", "p") if name in columns)
    way = np.asarray(columns[name], dtype=float)
    scale, ends, extreme, sign = TURN * np.ptp(way), [0], 0, 0.0
    for row in range(1, len(way)):
        beyond = way[row] - way[extreme]
        if sign * beyond >= 0 and (sign or abs(beyond) > scale):
            sign, extreme = sign or float(np.sign(beyond)), row
        elif sign and abs(beyond) > scale:
            ends.append(extreme)
            sign, extreme = -sign, row
    ends.append(len(way) - 1)
    return [slice(a, b + 1) for a, b in pairwise(ends)]


def curves_of_run(run) -> dict[str, np.ndarray]:
    """What of a run can be compared, by quantity, of the rows since strain 0.

    Void ratio, K₀, p and q are those between the walls. They are left out where the run folder
    lacks its mesh.

    Args:
        run: :class:`~mufe_fenicsx.results.Run`.
    """
    history = run.history
    rows = loading_rows(history)
    found = {"strain": history["strain"], "stress": history["stress"]}
    try:
        curves = run.curves()
    except InputError:
        curves = None
    if curves is not None:
        found |= {"void_ratio": curves["void_ratio"], "k0": curves["K0"]}
        if "strain_z" not in history:
            side = curves["K0"] * curves["stress"]
            found |= {"p": (curves["stress"] + 2 * side) / 3, "q": curves["stress"] - side}
    if "strain_z" in history:
        by_stages = macro.triaxial_curves(history)
        undrained = np.any(history.get("pore_pressure", 0.0))
        found |= {"p": by_stages["p"], "q": by_stages["q_axial" if undrained else "q"]}
        found["volumetric_strain"] = by_stages["strain_volume"]
    return {name: np.asarray(values, dtype=float)[rows] for name, values in found.items()}


def differences(reference: ReferenceCurves, curves: Mapping[str, np.ndarray]) -> list[Difference]:
    """How far a run is from measured curves, branch by branch.

    The k-th branch of the run is compared with the k-th measured one, at the measured points in
    the range of both; between its rows the run is a straight line.

    Args:
        reference: Of :func:`read_reference`.
        curves: Of :func:`curves_of_run`.

    Raises:
        InputError: No measured point is in the range of the run.
    """
    found = []
    for what, over, relative in COMPARED:
        both = [o for o in over if o in reference.columns and o in curves]
        if what not in reference.columns or what not in curves or not both:
            continue
        of_run = branches_of(curves)
        for number, (measured, own) in enumerate(zip(reference.branches, of_run, strict=False)):
            x, y = (reference.columns[name][measured] for name in (both[0], what))
            at, value = _within(x, y, *(curves[name][own] for name in (both[0], what)))
            if relative:
                counts = np.abs(y[at]) > COUNTS * np.abs(y[at]).max(initial=0.0)
                at, value = at[counts], value[counts]
            if not at.size:
                continue
            off = value - y[at]
            off = off / y[at] if relative else off
            k = int(np.argmax(np.abs(off)))
            found.append(
                Difference(
                    reference.label, what, both[0], _name(number, x), relative, int(at.size),
                    float(x[at].min()), float(x[at].max()), float(off.mean()), float(off[k]),
                    float(x[at][k]),
                )
            )  # fmt: skip
    if not found:
        raise InputError(_outside(reference, curves))
    return found


def values_beside(reference: ReferenceCurves, curves: Mapping[str, np.ndarray]):
    """Values of a run at measured points: the strain, or stress, there, and what the run has.

    Args:
        reference: Of :func:`read_reference`.
        curves: Of :func:`curves_of_run`.

    Returns:
        dict quantity -> list of floats, one a measured row; nan out of the range of the run.
    """
    over = next(name for name in ("strain", "stress", "p") if name in reference.columns)
    found = {over: reference.columns[over]}
    for what in reference.columns:
        if what in curves and what != over:
            found[what] = np.full(len(found[over]), np.nan)
            for measured, own in zip(reference.branches, branches_of(curves), strict=False):
                x = reference.columns[over][measured]
                at, value = _within(x, np.zeros(x.shape), curves[over][own], curves[what][own])
                found[what][np.arange(len(found[over]))[measured][at]] = value
    return {name: [float(v) for v in values] for name, values in found.items()}


def _within(x, y, own_x, own_y):
    """Numbers of the measured points in the range of a branch of a run, and its values there."""
    sign = 1.0 if own_x[-1] >= own_x[0] else -1.0
    way = sign * own_x
    known = np.isfinite(way) & np.isfinite(own_y)
    way, own_y = way[known], own_y[known]
    on = way >= np.maximum.accumulate(way)  # where it turns back for a moment, it waits
    way, own_y = way[on], own_y[on]
    if not way.size:
        return np.array([], dtype=int), np.array([])
    inside = (sign * x >= way[0]) & (sign * x <= way[-1])
    at = np.flatnonzero(inside & np.isfinite(y))
    return at, np.interp(sign * x[at], way, own_y)


def _name(number, way):
    """Name of a branch: loading, unloading, reloading, unloading 2 and so on."""
    down = way[-1] < way[0]
    if number == 0:
        return "extension" if down else "loading"
    word = "unloading" if down else "reloading"
    return word if number < 3 else f"{word} {(number + 1) // 2}"


def _outside(reference, curves):
    """The line for measured curves that a run does not meet."""
    for name in ("strain", "stress", "p"):
        if name in reference.columns and name in curves:
            parts = [f"{values.min():.4g} to {values.max():.4g} {UNITS[name]}".rstrip()
                     for values in (reference.columns[name], curves[name])]  # fmt: skip
            return (
                f"{name} of {reference.path} = {parts[0]}, expected points in the range of the "
                f"run, {parts[1]}, with what both have"
            )
    return (
        f"{reference.path} has {', '.join(reference.columns)}, expected what the run has too: "
        f"{', '.join(curves)}"
    )
