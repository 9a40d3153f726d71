"""The history of a run: a CSV file with one row a record."""

import csv
import io
import os
import zlib
from pathlib import Path

import numpy as np

from mufe_fenicsx.container import BOX, CONTAINERS
from mufe_fenicsx.errors import InputError, raise_together
from mufe_fenicsx.machine.files import open_plain, reason, regular

#: Columns of history.csv before the forces on the walls, and after them; SI units.
BEFORE = ("step", "time", "dt", "stage", "strain", "height", "speed")
VOIDS = ("void_ratio", "porosity", "void_ratio_inside", "void_ratio_error")
AFTER = (
    "stress",
    "kinetic",
    "elastic",
    "plastic",
    "plastic_dents",
    "friction",
    "switching",
    "contact",
    "damping",
    "parting",
    "work",
    "residual",
    "added_mass",
    "added_mass_of_grain",
    "num_contacts",
    "num_active_grains",
    "num_active_contacts",
    "elements_per_radius",
    "elements_per_radius_tenth",
    "overlap",
    *(f"unbalanced_{axis}" for axis in "xyz"),
    *VOIDS,
)


def history_columns(container):
    """Columns of the history.csv of a run in a container, in order; SI units.

    Args:
        container: :class:`~mufe_fenicsx.container.Container`.
    """
    forces = [f"force_{name}" for name in container.walls]
    return (*BEFORE, *forces, *AFTER, *container.widths)


#: Those of a box.
COLUMNS = history_columns(BOX)
#: Those that runs of earlier versions lack.
NEWER_COLUMNS = (
    *("length_x", "length_y", "switching", "plastic_dents", "parting"),
    *("elements_per_radius", "elements_per_radius_tenth", "overlap"),
    *("unbalanced_x", "unbalanced_y", "unbalanced_z"),
    *VOIDS,
)
TEXT_COLUMNS = ("stage", "wall", "mode")
NUMBERS = {name for each in CONTAINERS.values() for name in history_columns(each)}


class HistoryWriter:
    """Writes a history row by row; each row is on disk when ``append`` returns.

    Numbers are written with as many digits as it takes to read them back unchanged.

    Without a communicator it belongs to one rank. With one, creation and ``append`` are
    collective, rank 0 writes, and all ranks raise together.

    Args:
        path: The CSV file; an existing one is replaced.
        columns: Names of the columns.
        comm: MPI communicator or None.
        kept: Bytes of an existing file to go on from, what :meth:`sync` returned; None: a new one.
        rows: What :attr:`rows` was then.

    Raises:
        InputError: It cannot be written (disk full, folder not writable).
    """

    def __init__(self, path, columns=COLUMNS, comm=None, kept=None, rows=None):
        self.path, self._kept = Path(path), kept
        #: Checksums of the names of the columns and of each row so far; None: unknown.
        self.rows = [] if kept is None else rows and list(rows)
        self.columns = tuple(columns)
        self.comm = comm
        self._file = None
        self._together(self._open)

    def append(self, row):
        """Write one row.

        Args:
            row: dict column -> number or text; every column, nothing else.
        """
        self._together(lambda: self._append(row))

    def sync(self):
        """Wait until all rows are on disk; returns their bytes, on rank 0. Collective."""
        size = []

        def sync():
            os.fsync(self._file.fileno())
            size.append(self._file.tell())

        self._together(sync)
        return size[0] if size else None

    def close(self):
        """Close the file; twice does no harm."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _together(self, action):
        message = None
        if self.comm is None or self.comm.rank == 0:
            try:
                action()
            except OSError as error:
                message = f"{self.path} cannot be written ({reason(error)})"
        if self.comm is not None:
            raise_together(self.comm, message)
        elif message is not None:
            raise InputError(message)

    def _open(self):
        # Unbuffered: a row is one system call, and closing has nothing left to fail on.
        if self._kept is not None:
            self._file = os.fdopen(open_plain(self.path, os.O_RDWR), "r+b", buffering=0)
            if self._file.seek(0, os.SEEK_END) < self._kept:
                raise OSError(f"it has lost rows that the checkpoint counts, {self._kept} bytes")
            self._file.seek(0)
            first = self._file.readline().decode("utf-8", "replace").strip()
            if first != ",".join(self.columns):
                raise OSError(f"its columns are those of another version of the program: {first}")
            self._file.truncate(self._kept)
            self._file.seek(self._kept)
            return
        self.path.unlink(missing_ok=True)
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
        self._file = os.fdopen(open_plain(self.path, flags), "wb", buffering=0)
        self._write(self.columns)

    def _append(self, row):
        if set(row) != set(self.columns):
            wrong = sorted(set(row) ^ set(self.columns))
            raise ValueError(f"columns of a row differ from those of {self.path.name}: {wrong}")
        self._write([_text(row[name]) for name in self.columns])

    def _write(self, values):
        line = io.StringIO()
        csv.writer(line, lineterminator="\n").writerow(values)
        data = line.getvalue().encode()
        if self.rows is not None:
            self.rows.append(zlib.crc32(data[:-1]))
        while data:
            data = data[self._file.write(data) :]


#: A text that begins with one of these is a formula to spreadsheets; after a quote it is none.
FORMULA, QUOTE = ("=", "+", "-", "@", "\t", "\r"), "'"


def _text(value):
    if isinstance(value, str):
        return QUOTE + value if value.startswith((*FORMULA, QUOTE)) else value
    if isinstance(value, int | np.integer):
        return str(int(value))
    return repr(float(value))


def read_history(path):
    """Read a history that may still be being written.

    A last line without its line end (torn by the end of a run) is left out.

    Args:
        path: The CSV file.

    Returns:
        dict column -> array, shape (num_rows,): int64, float64, or str for text columns.

    Raises:
        InputError: It is absent, empty, or a row does not fit the columns.
    """
    path = Path(path)
    try:
        text = regular(path).read_text(encoding="utf-8")
        rows = list(csv.reader(io.StringIO(text[: text.rfind("\n") + 1])))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read ({reason(error)})") from error
    if not rows:
        raise InputError(f"{path} has no line, expected column names")
    columns, rows = rows[0], rows[1:]
    if len(set(columns)) < len(columns):
        raise InputError(f"{path} has a column twice, expected names that differ")
    for number, row in enumerate(rows, start=2):
        if len(row) != len(columns):
            raise InputError(
                f"{path}, line {number} has {len(row)} values, expected {len(columns)}"
            )
    return {name: _column([row[i] for row in rows], name) for i, name in enumerate(columns)}


def _column(values, name):
    if name not in TEXT_COLUMNS:
        for kind in (np.int64, np.float64):
            try:
                return np.array(values, dtype=kind) if values else np.empty(0)
            except (ValueError, OverflowError):
                continue
    if name in NUMBERS and name not in TEXT_COLUMNS:  # damaged: what is no number is none
        return np.array([_number(value) for value in values])
    texts = [
        v[1:] if v.startswith(QUOTE) and v[1:].startswith((*FORMULA, QUOTE)) else v for v in values
    ]
    return np.array(texts, dtype=str)


def _number(text):
    try:
        return float(text)
    except ValueError:
        return np.nan
