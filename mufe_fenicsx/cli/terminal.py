"""What the command line prints: summaries, tables, progress and JSON."""

import json
import math
import os
import sys
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from ..errors import InputError
from ..machine.doing import Doing
from ..units import with_unit
from .summary_words import described


class Printer:
    """Readable output of rank 0, on standard error where JSON goes to standard output.

    Args:
        json_path: Where JSON is wanted: a path, "-" for standard output, or None.
        rank: Rank of this process; other ranks than 0 print and write nothing.

    Raises:
        InputError: ``json_path`` cannot be written.
    """

    def __init__(self, json_path=None, rank=0):
        self.json_path = None if json_path is None else str(json_path)
        self.rank = rank
        if self.json_path not in (None, "-"):
            path = Path(self.json_path)
            if path.is_dir():
                raise InputError(f"--json {path} is a folder, expected a file")
            # The folder may be one that the command makes.
            there = next(folder for folder in path.absolute().parents if folder.exists())
            if not there.is_dir() or not os.access(there, os.W_OK):
                raise InputError(f"--json {path}, expected a file in a folder that can be written")

    @property
    def stream(self):
        """Where readable output goes."""
        return sys.stderr if self.json_path == "-" else sys.stdout

    def say(self, *lines):
        """Print lines, if any."""
        if self.rank == 0 and lines:
            print(*lines, sep="\n", file=self.stream, flush=True)

    def summary(self, values):
        """Print the numbers and short texts of a mapping in words, one a line, with units."""
        shown = [
            (*described(key), value)
            for key, value in values.items()
            if isinstance(value, bool | int | float | str | Path) or value is None
        ]
        width = max((len(words) for words, _, _ in shown), default=0)
        for words, unit, value in shown:
            self.say(f"{words:{width}}  {_text(value, unit)}".rstrip())

    def table(self, columns, rows):
        """Print rows of texts under columns; a column whose name starts with ">" is flush right."""
        if self.rank != 0:
            return
        from rich import box
        from rich.console import Console
        from rich.table import Table

        table = Table(box=box.SIMPLE_HEAD)
        for column in columns:
            right = column.startswith(">")
            table.add_column(column.lstrip(">"), justify="right" if right else "left")
        for row in rows:
            table.add_row(*row)
        # A pipe or a file has no width: lines as long as they need to be.
        width = None if self.stream.isatty() else 200
        Console(file=self.stream, width=width, highlight=False, markup=False).print(table)

    def write_json(self, result):
        """Write one JSON object, or a list of them, where it is wanted."""
        if self.rank != 0 or self.json_path is None:
            return
        text = json.dumps(plain(result), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        if self.json_path == "-":
            if "utf" not in (sys.stdout.encoding or "").lower():
                text = json.dumps(json.loads(text), indent=2) + "\n"
            sys.stdout.write(text)
            sys.stdout.flush()
        else:
            path = Path(self.json_path)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8", errors="backslashreplace")


def plain(value):
    """Copy of a result that JSON can hold: arrays as lists, numbers that are not finite as null."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy scalars and arrays
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


@contextmanager
def progress_bar(title):
    """A function (done, total, text) that draws a bar; lines now and then without a terminal."""
    if not sys.stderr.isatty():
        with Doing(title) as doing:
            yield partial(_tell, doing, title)
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    with Progress(
        TextColumn(title),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
        console=Console(stderr=True),
    ) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, total, text="": bar.update(
            task, completed=done, total=total, description=str(text)
        )


def _tell(doing, title, done, total, text=""):
    """Say how much is done, of the total if one is known."""
    part = f"step {done}" if total is None else f"{done} of {total}"
    doing.what = f"{title}: {part} {text}".rstrip()


def number(value):
    """A number in five digits; other values as text."""
    if isinstance(value, bool) or value is None:
        return _text(value, "")
    if isinstance(value, int | float) or hasattr(value, "dtype"):
        return f"{value:.5g}"
    return str(value)


def _text(value, unit):
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if unit == "bytes":
        return f"{value / 1e6:.4g} MB"
    if isinstance(value, float):
        return with_unit(value, unit)
    return f"{value} {unit}" if isinstance(value, int) else str(value)
