"""What a choice of model costs and how far off its answer is, measured: a stored table.

``points.csv`` is made by ``demos/speed_accuracy.py`` (which is ``mufe chart``): a row is one
computation of a case at one choice of element, mesh, contact law, time step, added mass and
loading time, with the command that repeats it. ``oedometer.csv`` holds the stress over strain
that those of the case ``oedometer-point`` are compared with, ``jammed.csv`` that of
``jammed-point``. `mufe plan` reads the first two.
"""

import csv
import itertools
import math
import shlex
from dataclasses import dataclass, fields
from pathlib import Path

from ...errors import InputError

TABLE = Path(__file__).with_name("points.csv")
REFERENCE = Path(__file__).with_name("oedometer.csv")
JAMMED = Path(__file__).with_name("jammed.csv")
#: Made by ``demos/plan_accuracy.py``.
ELSEWHERE = Path(__file__).with_name("elsewhere.csv")
#: A case of charts is called so by `mufe verify`: "hertz" is "hertz-point".
SUFFIX = "-point"
#: Status of a point that was computed; others say what went wrong.
DONE = "done"


@dataclass(frozen=True)
class Point:
    """One computation."""

    case: str  #: "hertz", "mindlin" and so on
    series: str  #: line of the chart that it belongs to
    error: float  #: over the answer, as the case defines it [-]; nan if it failed
    seconds: float  #: time of one processor for the steps alone [s]
    element_steps: float  #: tetrahedra that deform times steps; nan for increments
    num_cells: int
    num_steps: int
    status: str  #: "done", or what went wrong
    command: str  #: that repeats it
    curve: tuple = ()  #: what the error is that of, at even parts of the course

    @property
    def parameters(self):
        """{"name": "value"} of the command, texts."""
        words = shlex.split(self.command)
        return dict(w.split("=", 1) for w, flag in zip(words[1:], words, strict=False)
                    if flag == "--set")  # fmt: skip


def command_of(case, parameters):
    """The command that computes a point: `mufe verify hertz-point --set element=p1 …`."""
    changes = (f"--set {key}={shown(value)}" for key, value in parameters.items())
    return shlex.join(["mufe", "verify", case + SUFFIX]) + "".join(f" {c}" for c in changes)


def shown(value):
    """A parameter as it stands in a command."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def read_points(path=TABLE):
    """All points of a table, a list of :class:`Point`.

    Raises:
        InputError: There is no such file, or a row is not a point.
    """
    path = Path(path)
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [_point(row) for row in csv.DictReader(file)]
    except OSError as error:
        raise InputError(
            f"table {path}: {error.strerror}, expected that of `mufe chart`"
        ) from error
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"table {path} has a row that is no point ({error})") from error


def append_point(path, point):
    """Write one more row; the head first where the file is new."""
    path = Path(path)
    new = not path.exists()
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow([field.name for field in fields(Point)])
        writer.writerow([_text(getattr(point, field.name)) for field in fields(Point)])


def write_points(path, points):
    """Write a table anew."""
    Path(path).unlink(missing_ok=True)
    for point in points:
        append_point(path, point)


def _text(value):
    if isinstance(value, tuple):
        return " ".join(f"{v:.5g}" for v in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _point(row):
    kinds = {field.name: field.type for field in fields(Point)}
    values = {}
    for name, kind in kinds.items():
        text = row[name]
        values[name] = tuple(float(v) for v in text.split()) if kind is tuple else kind(text)
    return Point(**values)


def read_elsewhere(path=ELSEWHERE):
    """{command of a point: {parameter: {value: error}}}, its own values and others.

    A point's errors along a parameter are those with all other parameters as in the table.

    Raises:
        InputError: There is no such table, or a row is not one of it.
    """
    found = {}
    try:
        with Path(path).open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                along = found.setdefault(row["command"], {}).setdefault(row["parameter"], {})
                along[float(row["value"])] = float(row["error"])
    except OSError as error:
        raise InputError(
            f"table {path}: {error.strerror}, expected that of demos/plan_accuracy.py"
        ) from error
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"table {path} has a row that is no error ({error})") from error
    return found


def write_elsewhere(path, errors):
    """Write a table of errors as :func:`read_elsewhere` returns them, whole or not at all."""
    new = Path(f"{path}.new")
    with new.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["command", "parameter", "value", "error"])
        for command, along in errors.items():
            for name, values in along.items():
                for value, error in sorted(values.items()):
                    writer.writerow([command, name, f"{value:g}", f"{error:.4g}"])
    new.replace(path)


def usable(points, case):
    """Those of a case that were computed."""
    return [p for p in points if p.status == DONE and math.isfinite(p.error) and p.case == case]


def pareto(points, cost="seconds"):
    """Those that no other is both cheaper and nearer than, from the cheapest on.

    Args:
        points: With finite errors.
        cost: "seconds" or "element_steps".
    """
    front, known = [], [p for p in points if math.isfinite(getattr(p, cost))]
    for point in sorted(known, key=lambda p: (getattr(p, cost), p.error)):
        if not front or point.error < front[-1].error:
            front.append(point)
    return front


def cheapest(points, accuracy, cost="seconds"):
    """The cheapest point with an error of at most ``accuracy``, or None."""
    good = [p for p in pareto(points, cost) if p.error <= accuracy]
    return good[0] if good else None


def cost_at(points, error, cost="seconds"):
    """Least cost of some points for an error: between those of their front in logarithms.

    nan where none is as near: nothing is extrapolated.
    """
    front = pareto(points, cost)
    if front and error >= front[0].error:
        return getattr(front[0], cost)
    for cheap, near in itertools.pairwise(front):
        if near.error <= error <= cheap.error:
            part = math.log(cheap.error / error) / math.log(cheap.error / near.error)
            return getattr(cheap, cost) * (getattr(near, cost) / getattr(cheap, cost)) ** part
    return math.nan


def distance(curve, other):
    """Mean distance of two curves over the mean of the second one [-]."""
    return sum(abs(a - b) for a, b in zip(curve, other, strict=True)) / sum(map(abs, other))


def read_curve(path=REFERENCE, column="stress"):
    """Strain [-] and stress [Pa] of a stored oedometer test, and its head: how it was made.

    Args:
        path: Table of stresses over strain.
        column: Name of one of them.

    Raises:
        InputError: There is no such file, or no such column.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InputError(
            f"table {path}: {error.strerror}, expected that of demos/speed_accuracy.py --reference"
        ) from error
    head = [line[2:] for line in lines if line.startswith("# ")]
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    names = [name for name in rows[0] if name != "strain"]
    if column not in names:
        raise InputError(f"reference of {column}, expected one of {'; '.join(names)}")
    return [float(r["strain"]) for r in rows], [float(r[column]) for r in rows], head


def columns_of(path):
    """Names of the stresses in a table that :func:`read_curve` reads."""
    with Path(path).open(encoding="utf-8") as file:
        head = next(line for line in file if not line.startswith("#"))
    return [name for name in head.strip().split(",") if name != "strain"]
