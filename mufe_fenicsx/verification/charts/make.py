"""Charts of some cases: their table, figures, and how much cheaper than the seed's method."""

import math
import time
from pathlib import Path

from ...analysis.evidence import read_points
from ...errors import InputError
from .draw import draw_chart, draw_side_by_side, gain_over_seed
from .grid import grid
from .measure import fill


def make_charts(cases, folder, table=None, full=False, draw_only=False, minutes=None, say=print):
    """Compute what the table lacks and draw. One rank.

    Args:
        cases: Names out of grid.CHARTS.
        folder: Where figures go; it is made.
        table: CSV to go on with; None: ``points.csv`` in the folder.
        full: As of :func:`~.grid.grid`.
        draw_only: Compute nothing.
        minutes: Stop computing after so long; None: never.
        say: Called with lines to print.

    Returns:
        {"table", "figures", "missing": number of points, "gains": {case: rows of
        gain_over_seed}}.

    Raises:
        InputError: There is nothing to draw.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / "points.csv" if table is None else Path(table)
    missing, start = 0, time.perf_counter()
    for case in cases:
        if not draw_only:
            left = math.inf if minutes is None else 60 * minutes - time.perf_counter() + start
            missing += fill(table, grid(case, full), case, say, left)
    points = read_points(table)
    known = [case for case in cases if any(p.case == case for p in points)]
    if not known:
        raise InputError(f"table {table} has no points of {', '.join(cases)}, expected some")
    figures = [path for case in known for path in draw_chart(points, case, folder)]
    if len(known) > 1:
        figures += draw_side_by_side(points, known, folder)
    if missing:
        say(f"{missing} points are missing: the same command goes on")
    return {
        "table": str(table),
        "figures": [str(path) for path in figures],
        "missing": missing,
        "gains": {case: gain_over_seed(points, case) for case in cases},
    }
