"""Curves that were measured in a laboratory: read from a file, and compared with those of a run.

The first line of the file names the columns, each with its unit in brackets:

    strain [%], stress [MPa], k0 [-]
    0.0, 0.1, 0.55
    0.4, 1.2, 0.48

Empty cells are left out, column by column. A test may unload and reload. Branches are told apart by
where the strain turns, in the file and in the run alike, and compared one by one.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, zip_longest
from pathlib import Path

import numpy as np

from ..analysis import macro
from ..analysis.cycles import turning_points
from ..analysis.rows import loading_rows
from ..errors import InputError, nearest_name, shown
from ..loading.measured import name_and_unit, read_table
from ..scene.reference import Column, Reference
from ..scene.values import build

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
#: SI unit -> what may stand in brackets, and its factor; powers may be written m^2 and m² too.
ACCEPTED = {
    "": {"-": 1.0, "%": 0.01, "mm/mm": 1.0},
    "Pa": {
        "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5, "N/m2": 1.0, "kN/m2": 1e3,
        "MN/m2": 1e6, "N/mm2": 1e6,
    },
}  # fmt: skip
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
#: Points beyond a branch of a run by less than this part of its range count as at its end, which is
#: about a step from what was asked; before the first row of the run by less than START, since that
#: row is some way after strain 0.
EDGE, START = 2e-3, 0.02
#: Why points are not compared.
BEYOND = "beyond the run"
NO_BRANCH, NO_QUANTITY = "of a branch that the run has not", "of a quantity that the run has not"
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
    """A run less a measured curve, in one branch, at the measured points in the range of both.

    Where no point is compared all numbers of the difference are None.
    """

    reference: str  #: label of the measured curve
    quantity: str
    over: str  #: quantity at the same value of which they are compared
    branch: str
    relative: bool  #: differences are over the measured value
    num_points: int  #: that are compared
    num_measured: int  #: of the branch; a point where the strain turns is of both its branches
    left_out: str  #: why others are not compared, "" where all are
    low: float | None = None  #: least value of what they are compared over, SI unit
    high: float | None = None  #: its largest
    mean: float | None = None  #: difference, with its sign
    largest: float | None = None  #: that of the largest absolute value, with its sign
    at: float | None = None  #: where that is


def read_reference(reference: Reference) -> ReferenceCurves:
    """Read measured curves. Local.

    Porosity n gives the void ratio n/(1-n) where that has no column; the stress of the sides over
    the vertical one gives K₀, nan where that is 0.

    Args:
        reference: File, label and columns.

    Raises:
        InputError: It cannot be read, a column is not known, has no unit or none of
            :data:`ACCEPTED`, nothing can be compared, or a value is no finite number; the message
            names the file and the line.
    """
    table = read_table(reference.file)
    quantities, factors = _columns(table, reference.columns)
    values = table.values(quantities, least=1, gaps=True)
    kept = [name for name in quantities if name is not None]
    found = dict(zip(kept, values.T * np.array(factors)[:, None], strict=True))
    for name, numbers in found.items():
        if np.isnan(numbers).all():
            raise InputError(f"{table.path}: {name} has no number, expected one at least")
    if "porosity" in found:
        n = found["porosity"]
        if (n >= 1.0).any():
            row = int(np.argmax(n >= 1.0))
            raise InputError(
                f"{table.path}, line {table.rows[row][0]}: porosity = {n[row]:g}, expected less "
                "than 1"
            )
        found.setdefault("void_ratio", n / (1.0 - n))
    if {"stress", "side_stress"} <= set(found):
        stress = np.where(found["stress"] == 0.0, np.nan, found["stress"])
        found.setdefault("k0", found["side_stress"] / stress)
    if not any(what in found and any(o in found for o in over) for what, over, _ in COMPARED):
        raise InputError(
            f"{table.where}: {', '.join(found)}, expected columns to compare, such as strain and "
            "stress"
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


def _columns(table, asked: Mapping[str, Column]):
    """Quantity of each column of the file, None where it is left aside, and factors to SI units.

    Columns that are not asked for keep the names that they have.
    """
    where, cells = table.where, table.columns
    listed = _listed(where, cells, asked)
    quantities: list[str | None] = [None] * len(cells)
    factors = []
    for number, (text, unit) in enumerate(cells):
        quantity = listed.get(number) or SYNONYMS.get(text.lower(), text.lower())
        if number in listed:
            unit = asked[quantity].unit or unit
        elif asked and (quantity not in UNITS or quantity in listed.values()):
            continue
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


def _listed(where, cells, asked):
    """Number of a column -> its quantity, of those asked for, with or without their brackets."""
    found = {}
    for quantity, column in asked.items():
        if quantity not in UNITS:
            raise InputError(
                f"columns.{quantity} of a reference is not known, expected "
                f"{nearest_name(quantity, UNITS)}"
            )
        name, unit = name_and_unit(column.header)
        numbers = [k for k, cell in enumerate(cells) if cell == (name, unit or cell[1])]
        if not numbers:
            raise InputError(
                f"{where} has no column {shown(column.header)}, expected "
                f"{nearest_name(column.header, [text for text, _ in cells])}"
            )
        if len(numbers) > 1 or numbers[0] in found:
            raise InputError(
                f"{where}: columns.{quantity} = {shown(column.header)} is "
                f"{'there twice' if len(numbers) > 1 else found[numbers[0]] + ' too'}, expected "
                "one column for each"
            )
        found[numbers[0]] = quantity
    return found


def _factor(name, unit, wanted):
    """What a number of a unit is to be multiplied with to be in that of SI."""
    accepted = ACCEPTED[wanted]
    if not unit:
        raise InputError(f"{name} has no unit, expected one behind the name, of {_words(accepted)}")
    plain = unit.replace(" ", "").replace("**", "").replace("^", "").replace("²", "2")
    if plain not in accepted:
        raise InputError(f"{name} has the unit {shown(unit)}, expected one of {_words(accepted)}")
    return accepted[plain]


def _words(units):
    return ", ".join(f"[{unit}]" for unit in units)


def branches_of(columns: Mapping[str, np.ndarray]) -> list[slice]:
    """Rows of each branch: between the points where the strain turns, both ends included.

    Without a strain it is the stress that turns, or p. Rows where that is nan turn nothing.
    """
    way = np.asarray(_way(columns), dtype=float)
    known = np.flatnonzero(np.isfinite(way))
    turns = known[turning_points(way[known])[1:-1]].tolist()
    return [slice(a, b + 1) for a, b in pairwise([0, *turns, len(way) - 1])]


def _way(columns):
    """What turns where branches end."""
    return next(columns[name] for name in ("strain", "stress", "p") if name in columns)


def _sense(way):
    """1 where a branch goes up, -1 where it goes down, 0 of a single point."""
    way = way[np.isfinite(way)]
    return float(np.sign(way[-1] - way[0])) if way.size else 0.0


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

    The k-th branch of the run is compared with the k-th measured one where both go the same way, at
    the measured points in the range of both; between its rows the run is a straight line.

    Args:
        reference: Of :func:`read_reference`.
        curves: Of :func:`curves_of_run`.

    Returns:
        One of each quantity and measured branch, also where no point of that is compared.

    Raises:
        InputError: No measured point is in the range of the run.
    """
    found = []
    pairs = _pairs(reference, curves)
    for what, over, relative in COMPARED:
        given = [o for o in over if o in reference.columns]
        if what not in reference.columns or not given:
            continue
        both = [o for o in given if o in curves and what in curves]
        at = (both or given)[0]
        for number, (measured, own) in enumerate(pairs):
            x, y = (reference.columns[name][measured] for name in (at, what))
            known = np.isfinite(x) & np.isfinite(y)
            if not known.any():
                continue
            branch = _name(number, _way(reference.columns)[measured])
            names = reference.label, what, at, branch, relative
            of_run = NO_BRANCH if both else NO_QUANTITY
            if both and own is not None:
                of_run = curves[at][own], curves[what][own], _start(own)
            found.append(_difference(names, x[known], y[known], of_run))
    if not any(d.num_points for d in found):
        raise InputError(_outside(reference, curves))
    return found


def _pairs(reference, curves):
    """Rows of each measured branch, and of that of the run; None where the run has none."""
    of_run = branches_of(curves)
    name = next(name for name in ("strain", "stress", "p") if name in reference.columns)
    pairs = []
    for measured, own in zip_longest(reference.branches, of_run[: len(reference.branches)]):
        if own is not None and name in curves:
            senses = _sense(reference.columns[name][measured]), _sense(curves[name][own])
            own = own if np.prod(senses) >= 0 else None
        pairs.append((measured, own))
    return pairs


def _difference(names, x, y, of_run):
    """:class:`Difference` of a branch from its points and those of the run, or why it has none."""
    relative = names[-1]
    if isinstance(of_run, str):
        return Difference(*names, 0, len(x), f"{len(x)} {of_run}")
    at, value = _within(x, *of_run)
    reasons, inside = [(len(x) - len(at), BEYOND)], len(at)
    if relative:
        counts = np.abs(y[at]) > COUNTS * np.abs(y[at]).max(initial=0.0)
        at, value = at[counts], value[counts]
        reasons.append((inside - len(at), f"below {COUNTS:g} of the largest"))
    left_out = ", ".join(f"{number} {why}" for number, why in reasons if number)
    if not at.size:
        return Difference(*names, 0, len(x), left_out)
    off = value - y[at]
    off = off / y[at] if relative else off
    k = int(np.argmax(np.abs(off)))
    return Difference(
        *names, int(at.size), len(x), left_out, float(x[at].min()), float(x[at].max()),
        float(off.mean()), float(off[k]), float(x[at][k]),
    )  # fmt: skip


def values_beside(reference: ReferenceCurves, curves: Mapping[str, np.ndarray]):
    """Values of a run at measured points: the strain, or stress, there, and what the run has.

    Args:
        reference: Of :func:`read_reference`.
        curves: Of :func:`curves_of_run`.

    Returns:
        dict quantity -> list of floats, one a measured row; nan wherever the run has no value: out
        of its range at either end, in branches that it has not, in rows without that strain.
    """
    over: str = next(n for n in ("strain", "stress", "p") if n in reference.columns)
    found = {over: reference.columns[over]}
    for what in reference.columns:
        if what in curves and what != over:
            found[what] = np.full(len(found[over]), np.nan)
            for measured, own in _pairs(reference, curves):
                if own is not None:
                    x = reference.columns[over][measured]
                    at, value = _within(x, curves[over][own], curves[what][own], _start(own))
                    found[what][np.arange(len(found[over]))[measured][at]] = value
    return {name: [float(v) for v in values] for name, values in found.items()}


def _start(own):
    """Part of its range by which points may be before a branch of a run."""
    return EDGE if own.start else START


def _within(x, own_x, own_y, start):
    """Numbers of the measured points in the range of a branch of a run, and its values there."""
    sign = 1.0 if own_x[-1] >= own_x[0] else -1.0
    way = sign * own_x
    known = np.isfinite(way) & np.isfinite(own_y)
    way, own_y = way[known], own_y[known]
    if way.size:  # where it turns back for a moment, it waits
        on = way >= np.maximum.accumulate(way)
        way, own_y = way[on], own_y[on]
    if not way.size:
        return np.array([], dtype=int), np.array([])
    width = way[-1] - way[0]
    at = np.flatnonzero((sign * x >= way[0] - start * width) & (sign * x <= way[-1] + EDGE * width))
    return at, np.interp(sign * x[at], way, own_y)


def _name(number, way):
    """Name of a branch: loading, unloading, reloading, unloading 2 and so on."""
    down = _sense(way) < 0
    if number == 0:
        return "extension" if down else "loading"
    word = "unloading" if down else "reloading"
    return word if number < 3 else f"{word} {(number + 1) // 2}"


def _outside(reference, curves):
    """The line for measured curves that a run does not meet."""
    measured, own = (
        {q for q, over, _ in COMPARED if q in c and any(o in c for o in over)}
        for c in (reference.columns, curves)
    )
    name = next((n for n in ("strain", "stress", "p") if n in reference.columns), "")
    if not measured & own or name not in curves:
        return (
            f"{reference.path} has {', '.join(reference.columns)}, expected what the run has too: "
            f"{', '.join(curves)}"
        )
    parts = [
        f"{values[0]:.4g} to {values[1]:.4g} {UNITS[name]}".rstrip()
        for values in (
            (np.nanmin(c[name]), np.nanmax(c[name])) for c in (reference.columns, curves)
        )
    ]
    way = reference.columns[name]
    turned = np.nanmin(way) < 0.0 and -np.nanmin(way) > np.nanmax(way)
    return (
        f"{name} of {reference.path} = {parts[0]}, expected points in the range of the run, "
        f"{parts[1]}, of branches that go the same way"
        + (": compression is positive, here and in the run" if turned else "")
    )
