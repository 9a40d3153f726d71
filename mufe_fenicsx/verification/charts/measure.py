"""Computes the points of a chart, one row of a table each: what is there is not done again."""

import math
import statistics
import time

from mpi4py import MPI

from ...analysis.evidence import DONE, SUFFIX, Point, append_point, command_of, read_points
from ...errors import InputError, SolverError
from .points import POINTS

#: Below this time [s] of the steps a point is computed so many times, and the median kept.
SHORT, TIMES = 2.0, 3


def measure(case, series, parameters):
    """A :class:`~.Point`; a computation that fails is one too. One rank."""
    command, seconds = command_of(case, parameters), []
    try:
        while True:
            answer = POINTS[case + SUFFIX](MPI.COMM_SELF, **parameters)
            results = answer["results"]
            seconds.append(results["time of the processor [s]"]["computed"])
            if seconds[0] > SHORT or len(seconds) == TIMES:
                break
    except (InputError, SolverError, FloatingPointError) as error:
        text = " ".join(str(error).split())
        return Point(case, series, math.nan, math.nan, math.nan, 0, 0, f"failed: {text}", command)
    return Point(
        case,
        series,
        results["error"]["computed"],
        statistics.median(seconds),
        results["element-steps"]["computed"],
        answer["num_cells"],
        answer["num_steps"],
        DONE,
        command,
        tuple(row["computed"] for name, row in results.items() if name.startswith("stress at")),
    )


def fill(path, rows, case, say, limit=math.inf):
    """Compute the points of a grid that a table has not yet; each is in it as soon as it is done.

    Args:
        path: Table (CSV).
        rows: Of :func:`~.grid.grid`.
        case: Their case.
        say: Called with a line for each point.
        limit: Stop after so many seconds of the clock.

    Returns:
        Number of points that are still missing.
    """
    known = {(p.series, p.command): p for p in read_points(path)} if path.exists() else {}
    by_command = {command: p for (_, command), p in known.items()}
    missing, warm, start = 0, False, time.perf_counter()
    for series, parameters, command in rows:
        if (series, command) in known:
            continue
        if time.perf_counter() - start > limit:
            missing += 1
            continue
        if not warm:  # kernels are compiled or read once, not within a measurement
            measure(case, series, rows[0][1])
            warm = True
        point = by_command.get(command) or measure(case, series, parameters)
        point = Point(**{**vars(point), "series": series})
        by_command[command] = point
        append_point(path, point)
        say(
            f"{case:15} {series:24} error {point.error:8.4f}  {point.seconds:8.2f} s  "
            f"{point.num_cells:7d} tets {point.num_steps:7d} steps  {point.status[:60]}"
        )
    return missing
