"""Tables of tests of single grains: columns by name, with their units.

    displacement [um], force [N], diameter [mm], curve
    0.5, 0.12, 0.71, A
    1.0, 0.31, 0.71, A

What a table is follows from its columns: curves of grains that are pressed have ``displacement``
and ``force``, those that are rubbed ``tangential_displacement``, ``tangential_force`` and
``normal_force``; a table of strengths has ``force`` and no displacement. The size is the column
``diameter``, or ``length``, ``width`` and ``height`` of ellipsoids, the height between the platens.
A column ``curve`` names the curve of each row; other columns are left aside.
"""

import difflib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ..errors import InputError, nearest_name, shown
from ..loading.measured import read_table
from ..theory.hertz import elliptic_contact
from ..units import PLAUSIBLE, to_si

#: Unit of each column of numbers.
UNITS = {
    "displacement": "m",
    "force": "N",
    "tangential_displacement": "m",
    "tangential_force": "N",
    "normal_force": "N",
    "diameter": "m",
    "length": "m",
    "width": "m",
    "height": "m",
}
SIZES = ("diameter", "length", "width", "height")
#: Columns above 0, as is ``force`` where grains broke.
POSITIVE = (*SIZES, "normal_force")
#: Kind of a table -> columns it has to have, the kind of most columns first.
KINDS = {
    "rubbed": ("tangential_displacement", "tangential_force", "normal_force"),
    "pressed": ("displacement", "force"),
    "crushed": ("force",),
}
#: Part of the largest force from which on a grain counts as touched.
TOUCHED = 0.02
#: Rows that a curve has to have, and grains that a table of strengths has to have.
LEAST, LEAST_GRAINS = 5, 5
#: Names count as misspelled from this ratio of :mod:`difflib` on.
SIMILAR = 0.75
#: Beginnings of names count as misspelled from so many letters on.
SHORT = 3
#: Least and largest friction that is sought.
FRICTION = (1e-3, 10.0)
#: A force falls if it drops by this many times the scatter, and by this part of the largest.
TIMES, PART = 5.0, 0.05
#: Standard deviation of normal noise over the median size of its second differences.
DEVIATION = 1.4826 / 6**0.5


@dataclass(frozen=True)
class Size:
    """A ball or an ellipsoid between platens: its axes [m], the height between them."""

    length: float
    width: float
    height: float

    @cached_property
    def radius(self):
        """Radius of the ball that by Hertz bears as much at the same approach [m].

        That of curvature at the pole, for the curvatures of both axes; :func:`elliptic_contact`.
        """
        A, B = sorted(self.height / edge**2 for edge in (self.length, self.width))
        force = elliptic_contact(1e-6 / B, A, B, 1.0)[0]
        return (0.75 * force) ** 2 * (B / 1e-6) ** 3

    @property
    def diameter(self):
        """Of the ball of the same volume [m]."""
        return float(np.cbrt(self.length * self.width * self.height))


@dataclass(frozen=True)
class Curve:
    """One curve of a pressed grain, in SI units."""

    name: str
    displacement: np.ndarray  #: [m], shape (num_rows,)
    force: np.ndarray  #: [N], shape (num_rows,)
    size: Size


@dataclass(frozen=True)
class Rubbed:
    """One curve of a contact that is sheared."""

    name: str
    displacement: np.ndarray  #: tangential [m], shape (num_rows,)
    force: np.ndarray  #: tangential [N], shape (num_rows,)
    normal: np.ndarray  #: force [N], shape (num_rows,)


@dataclass(frozen=True)
class Data:
    """All that the files have."""

    curves: list  #: of :class:`Curve`
    rubbed: list  #: of :class:`Rubbed`
    forces: np.ndarray  #: at which grains broke [N], shape (num_grains,)
    diameters: np.ndarray  #: of these [m], shape (num_grains,)
    notes: list  #: sentences on what was left out


def read_data(paths, size=None):
    """Read tables of tests. Local.

    Args:
        paths: CSV files.
        size: :class:`Size` of grains whose table has none.

    Raises:
        InputError: A file cannot be read or has not the columns or units of any kind of test; a
            curve has too few points or the name of another one, or its force falls. The message
            names file, curve and line.
    """
    found = Data([], [], np.empty(0), np.empty(0), [])
    forces, diameters = [], []
    for path in map(Path, paths):
        table, kind, values = _columns(path)
        for name, rows in _curves(table, kind).items():
            label = path.stem + (f" {name}" if name else "")
            part = {key: column[rows] for key, column in values.items()}
            lines = [table.rows[i][0] for i in rows]
            if kind == "crushed":
                forces += list(part["force"])
                diameters += [_size(part, i, size, path).diameter for i in range(len(rows))]
                continue
            if len(rows) < LEAST:
                raise InputError(
                    f"{path}: curve {label} has {len(rows)} points, expected at least {LEAST}"
                )
            if kind == "pressed":
                found.curves.append(_pressed(path, label, lines, part, size, found.notes))
            else:
                found.rubbed.append(_rubbed(path, label, part))
    if forces and len(forces) < LEAST_GRAINS:
        raise InputError(f"strengths of {len(forces)} grains, expected at least {LEAST_GRAINS}")
    names = [curve.name for curve in (*found.curves, *found.rubbed)]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"curve {name} is there twice, expected names that differ")
    return Data(found.curves, found.rubbed, np.array(forces), np.array(diameters), found.notes)


def within_table(data, setup, offset=None, compliance=0.0):
    """The data without rows beyond the largest displacement that the model knows.

    Args:
        data: :class:`Data`; its notes say what is left out.
        setup: :class:`~.model.Setup`.
        offset: Displacement at touch [m]; None: not known.
        compliance: Of the machine [m/N], where it is known.

    Raises:
        InputError: Too few rows of a curve are left, or the offset is beyond it.
    """
    curves = []
    for curve in data.curves:
        touched = offset
        if offset is None:
            touched = curve.displacement[curve.force > TOUCHED * curve.force.max()].min()
        elif offset >= curve.displacement.max():
            raise InputError(
                f"offset = {offset:g} m, expected less than {curve.displacement.max():g} m, the "
                f"largest displacement of curve {curve.name}"
            )
        most = touched + setup.longest * curve.size.radius
        keep = curve.displacement - compliance * curve.force <= most
        if keep.all():
            curves.append(curve)
            continue
        if keep.sum() < LEAST:
            raise InputError(
                f"curve {curve.name} has {keep.sum()} points up to the displacement {most:.3g} m, "
                f"{setup.longest:g} radii, expected at least {LEAST}: beyond it no ball is known"
            )
        data.notes.append(
            f"{curve.name}: {(~keep).sum()} rows beyond {setup.longest:g} radii, left out"
        )
        curves.append(replace(curve, displacement=curve.displacement[keep],
                              force=curve.force[keep]))  # fmt: skip
    return replace(data, curves=curves)


def _columns(path):
    """The table, its kind, and its columns of numbers in SI units by name."""
    table = read_table(path)
    where, names, units = table.where, [name for name, _ in table.columns], dict(table.columns)
    kind = next((k for k, wanted in KINDS.items() if set(wanted) <= set(names)), None)
    known = [*UNITS, "curve"]
    for name in names:
        if name in known and names.count(name) > 1:
            raise InputError(f"{where}: {name} is there twice, expected names that differ")
        # A slip of the keyboard makes no table of another kind.
        short = len(name) >= SHORT and any(each.startswith(name.lower()) for each in known)
        if name not in known and (short or difflib.get_close_matches(name, known, 1, SIMILAR)):
            raise InputError(f"{where}: column {shown(name)}, expected {nearest_name(name, known)}")
    if kind is None:
        odd = next((name for name in names if name not in known), names[0])
        raise InputError(
            f"{where}: column {shown(odd)}, expected displacement and force, or force and "
            f"diameter, or {', '.join(KINDS['rubbed'])}"
        )
    wanted = [name for name in names if name in (*KINDS[kind], *SIZES)]
    for name in wanted:
        if not units[name]:
            raise InputError(
                f"{where}: {name} has no unit, expected one in brackets, such as "
                f'"{name} [{"N" if UNITS[name] == "N" else "um"}]"'
            )
    numbers = table.values([name if name in wanted else None for name in names], least=1)
    factors = [to_si(f"1 {units[name]}", UNITS[name], f"{where}: {name}") for name in wanted]
    columns = dict(zip(wanted, (numbers * factors).T, strict=True))
    for name, column in columns.items():
        least, most = PLAUSIBLE[UNITS[name]]
        if name not in POSITIVE and kind != "crushed":
            least = -most
        wrong = np.flatnonzero((column < least) | (column > most))
        if wrong.size:
            raise InputError(
                f"{path}, line {table.rows[wrong[0]][0]}: {name} = {column[wrong[0]]:g} "
                f"{UNITS[name]}, expected {least:g} to {most:g} {UNITS[name]}"
            )
    return table, kind, columns


def _curves(table, kind):
    """Rows of each curve, by its name, in the order of the file."""
    names = [name for name, _ in table.columns]
    if "curve" not in names or kind == "crushed":
        return {"": list(range(len(table.rows)))}
    at, found = names.index("curve"), {}
    for i, (_, row) in enumerate(table.rows):
        found.setdefault(row[at].strip(), []).append(i)
    return found


def _size(part, i, size, path):
    """Of the grain of a row."""
    if "diameter" in part:
        edges = [part["diameter"][i]] * 3
    elif all(name in part for name in SIZES[1:]):
        edges = [part[name][i] for name in SIZES[1:]]
    elif size is not None:
        return size
    else:
        raise InputError(
            f'{path} has no size of its grains, expected a column "diameter [mm]", columns length, '
            "width and height, or --diameter"
        )
    return Size(*edges)


def _pressed(path, label, lines, part, size, notes):
    """A curve up to its largest displacement, whose force rises."""
    x, force = part["displacement"], part["force"]
    own = [_size(part, i, size, path) for i in range(x.size)]
    if any(each != own[0] for each in own):
        raise InputError(
            f"{path}: curve {label} has sizes that differ, expected one; name curves in a column "
            '"curve"'
        )
    end = int(np.argmax(x)) + 1
    if end < x.size:
        notes.append(f"{label}: the {x.size - end} rows after the largest displacement, left out")
    if end < LEAST or force[:end].max() <= 0.0:
        raise InputError(
            f"{path}: curve {label} has {end} points up to its largest displacement and the "
            f"largest force {force[:end].max():g} N, expected at least {LEAST} and a force > 0"
        )
    _check_rising(path, label, lines, x[:end], force[:end])
    return Curve(label, x[:end], force[:end], own[0])


def _check_rising(path, label, lines, x, force):
    """Raise InputError where a force falls beyond its scatter while the displacement rises."""
    order = np.argsort(x, kind="stable")
    ordered = force[order]
    wide = np.pad(ordered, 2, mode="reflect")  # the last row alone is no fall
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(wide, 5), axis=1)
    top = np.maximum.accumulate(smooth)
    drop, size = top - smooth, np.maximum(top, PART * top[-1])
    # Noise goes with the force, and rows that break are few.
    bend = np.abs(np.diff(ordered, 2)) / size[1:-1]
    scatter = DEVIATION * float(np.median(bend))
    i = int(np.argmax(drop))
    if drop[i] > max(TIMES * scatter * size[i], PART * top[-1]):
        raise InputError(
            f"{path}, line {lines[order[i]]}: curve {label} falls from {top[i]:.4g} to "
            f"{smooth[i]:.4g} N while the displacement rises, expected a force that rises: end "
            "the curve where the grain breaks"
        )


def _rubbed(path, label, part):
    x, force = part["tangential_displacement"], part["tangential_force"]
    if force.max() <= 0.0 or np.ptp(x) <= 0.0:
        raise InputError(
            f"{path}: curve {label} has the largest tangential force {force.max():g} N over "
            f"{np.ptp(x):g} m, expected both > 0"
        )
    ratio = np.max(force / part["normal_force"])
    if not FRICTION[0] <= ratio <= FRICTION[1]:
        raise InputError(
            f"{path}: curve {label} has the largest tangential over normal force {ratio:g}, "
            f"expected {FRICTION[0]:g} to {FRICTION[1]:g}"
        )
    return Rubbed(label, x, force, part["normal_force"])
