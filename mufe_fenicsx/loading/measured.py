"""Curves over time that were measured: a CSV file, and what lies between its rows.

The first line names the columns, each with its unit in brackets where that is not SI:

    time [min], strain_z [%]
    0, 0
    10, 0.12

Lines that begin with # are comments. Between rows a curve is a monotone cubic (Fritsch & Carlson
1980): it goes through each row, has no extremum that the rows have not, and its slope is
continuous. Walls that follow it make no jump of speed, hence no wave, and no overshoot. Straight
lines would jump in speed at each row; other cubics would overshoot.

Source: F. N. Fritsch & R. E. Carlson, SIAM Journal on Numerical Analysis 17, 1980, 238-246.
"""

import csv
import io
import math
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mufe_fenicsx.errors import InputError, nearest_name, shown
from mufe_fenicsx.machine.files import reason, regular
from mufe_fenicsx.units import PLAUSIBLE, to_si

TIME = "time"
#: Shortest step of time over all of it, and largest number of a table: their curve is finite.
STEP, MOST = 1e-12, 1e100
#: Bytes of a file.
LARGEST = 100_000_000
#: What may stand where commas have to.
SEPARATORS = {";": "semicolons", "\t": "tabs"}
NAME_AND_UNIT = re.compile(r"(.*?)\s*(?:\[\s*([^\[\]]*?)\s*\]|\(\s*([^()]*?)\s*\))?")


@dataclass(frozen=True)
class Table:
    """A CSV file: the names of its columns and its rows, as texts with the numbers of lines."""

    path: Path
    number: int  #: line of the header
    header: list[str]
    rows: list[tuple[int, list[str]]]
    checksum: int  #: of the bytes of the file

    @property
    def where(self):
        """The header in messages."""
        return f"{self.path}, line {self.number}"

    @property
    def columns(self):
        """Name and unit of each column, see :func:`name_and_unit`."""
        return [name_and_unit(cell) for cell in self.header]

    def values(self, names, least=2, gaps=False):
        """Numbers of the columns, shape (num_rows, num_columns).

        Args:
            names: Of all columns, for messages; None where a column is left aside.
            least: Number of rows that there have to be.
            gaps: Whether cells may be empty; they are nan.

        Raises:
            InputError: There are fewer rows, or a value is no finite number.
        """
        if len(self.rows) < least:
            wanted = "one" if least == 1 else "two"
            raise InputError(f"{self.path} has {len(self.rows)} rows, expected at least {wanted}")
        return np.array(
            [_numbers(self.path, number, row, names, gaps) for number, row in self.rows]
        )


def read_table(path) -> Table:
    """Read a CSV file whose first line names the columns; lines with # are comments. Local.

    Raises:
        InputError: It cannot be read, is empty, or is separated by something else than commas.
    """
    path = Path(path)
    try:
        if regular(path).stat().st_size > LARGEST:
            raise InputError(f"{path} has more than {LARGEST} bytes, expected a table of curves")
        data = path.read_bytes()
        text = data.decode("utf-8-sig")
        lines = list(csv.reader(io.StringIO(text, newline="")))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read ({reason(error)}), expected a CSV file") from error
    rows = [
        (number, row)
        for number, row in enumerate(lines, start=1)
        if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#")
    ]
    if not rows:
        raise InputError(f"{path} has no line, expected the names of columns")
    number, header = rows[0]
    for letter, word in SEPARATORS.items():
        if sum(cell.count(letter) for cell in header) > len(header) - 1:
            raise InputError(
                f"{path}, line {number} is separated by {word}, expected commas, and numbers with "
                "a decimal point"
            )
    return Table(path, *rows[0], rows[1:], zlib.crc32(data))


def name_and_unit(cell):
    """Name of a column and its unit in brackets, [] or (), behind it; None without brackets."""
    text = " ".join(cell.split())
    match = NAME_AND_UNIT.fullmatch(text)
    return (match[1], match[2] or match[3]) if match[1] else (text, None)


@dataclass(frozen=True)
class Measured:
    """Curves over time, SI units. Local."""

    path: Path
    time: np.ndarray  #: [s], it grows, shape (num_rows,)
    columns: dict[str, np.ndarray]  #: name -> values, shape (num_rows,)
    checksum: int  #: of the bytes of the file

    def curve(self, name: str):
        """A column over the part of the whole time, from 0 to 1: a scipy PchipInterpolator."""
        return curve_through(self.part, self.columns[name])

    def step_to(self, row: int) -> "Measured":
        """The curves between a row, counted from 1, and the one before it.

        Raises:
            InputError: There is no such row.
        """
        if not 2 <= row <= len(self.time):
            raise InputError(
                f"row = {row} of {self.path}, expected 2 to {len(self.time)}, its number of rows"
            )
        both = slice(row - 2, row)
        columns = {name: values[both] for name, values in self.columns.items()}
        return replace(self, time=self.time[both], columns=columns)

    @property
    def part(self) -> np.ndarray:
        """Part of the whole time at each row, from 0 to 1, shape (num_rows,)."""
        return (self.time - self.time[0]) / (self.time[-1] - self.time[0])


def curve_through(x: np.ndarray, y: np.ndarray):
    """The monotone cubic through points, a scipy PchipInterpolator.

    Args:
        x: It grows, shape (num_points,).
        y: Values, shape (num_points,).
    """
    from scipy.interpolate import PchipInterpolator  # only where there is something to follow

    return PchipInterpolator(x, y)


def steepest(curve) -> float:
    """Largest absolute slope of a curve of :func:`curve_through`.

    The slope is a parabola in each interval: it is largest at an end, or at its vertex.
    """
    slope = curve.derivative()
    bend, rise, _ = slope.c
    width = np.diff(slope.x)
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = np.where(bend != 0.0, -0.5 * rise / bend, 0.0)
    at = slope.x[:-1] + np.clip(vertex, 0.0, width)
    return float(np.abs(slope(np.concatenate([slope.x, at]))).max())


def read_measured(path: str | Path, units: Mapping[str, str]) -> Measured:
    """Read curves over time from a CSV file. Local.

    Args:
        path: The file.
        units: SI unit of each column that there may be, "" of a number; "time" is one of them and
            has to be there.

    Raises:
        InputError: It cannot be read, a column is not known or missing, a value is no number, or
            the time does not grow. The message names the file and the line.
    """
    path, data = Path(path), read_table(path)
    names, factors = _columns(data, units)
    values = data.values(names)
    found = dict(zip(names, values.T * np.array(factors)[:, None], strict=True))
    time = found.pop(TIME)
    late = np.flatnonzero(np.diff(time) <= 0.0)
    if late.size:
        before, now = values[late[0] : late[0] + 2, names.index(TIME)]
        raise InputError(
            f"{path}, line {data.rows[late[0] + 1][0]}: time = {now:g}, expected more than "
            f"{before:g}, that of the row before"
        )
    whole, (shortest, longest) = time[-1] - time[0], PLAUSIBLE["s"]
    if not shortest <= whole <= longest or np.diff(time).min() < STEP * whole:
        raise InputError(
            f"{path}: time = {time[0]:g} to {time[-1]:g} s in steps of {np.diff(time).min():g} s "
            f"and more, expected {shortest:g} to {longest:g} s in all, in steps of {STEP:g} of it "
            "and more"
        )
    return Measured(path, time, found, data.checksum)


def _columns(table, units):
    """Names of the columns, and factors that turn them into SI units."""
    names, factors, where = [], [], table.where
    for name, unit in table.columns:
        if name not in units:
            raise InputError(
                f"{where}: {shown(name)} is not a known column, expected "
                f"{nearest_name(name, units)}"
            )
        if name in names:
            raise InputError(f"{where}: {name} is there twice, expected names that differ")
        names.append(name)
        factors.append(to_si(f"1 {unit}", units[name], f"{where}: {name}") if unit else 1.0)
    if TIME not in names:
        raise InputError(f"{where}: time is missing, expected a column of it")
    if len(names) < 2:
        others = ", ".join(name for name in units if name != TIME)
        raise InputError(f"{where}: time is alone, expected a column beside it: {others}")
    return names, factors


def _numbers(path, number, row, names, gaps=False):
    """The values of one line."""
    where = f"{path}, line {number}"
    if len(row) != len(names):
        raise InputError(f"{where} has {len(row)} values, expected {len(names)}")
    found = []
    for name, cell in zip(names, row, strict=True):
        if name is None:
            continue
        if gaps and not cell.strip():
            found.append(math.nan)
            continue
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not abs(value) <= MOST:
            raise InputError(f"{where}: {name} = {shown(cell.strip())}, expected a finite number")
        found.append(value)
    return found
