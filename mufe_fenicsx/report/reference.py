"""Measured curves in the figures of a run, and how far it is from them."""

from dataclasses import asdict
from itertools import cycle

import numpy as np

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.figure import file_name
from mufe_fenicsx.results.reference_curves import (
    BEYOND,
    NO_BRANCH,
    NO_QUANTITY,
    UNITS,
    differences,
)
from mufe_fenicsx.units import with_unit

#: Name of the file with the differences, without ending.
NAME = "differences"
#: A measured curve has at most about so many markers.
MARKS = 25
#: Quantities in words.
WORDS = {
    "strain": "strain",
    "stress": "vertical stress",
    "k0": "K0",
    "void_ratio": "void ratio",
    "p": "mean stress",
    "q": "deviator stress",
    "volumetric_strain": "volumetric strain",
}
#: Heading of the table.
HEADING = f"Beside measured curves: run less measured (figures/{NAME}.csv)"
COLUMNS = (
    "Run", "Measured", "Quantity", "At the same", "Branch", "From", "To",
    "Points compared", "Points measured", "Not compared", "Mean difference", "Largest difference",
    "There",
)  # fmt: skip


def draw_measured(axis, references, x, y, scales=(1.0, 1.0)):
    """Draw those measured curves that have two quantities, black with markers.

    Args:
        axis: To draw into, before its limits are set.
        references: Of :class:`~mufe_fenicsx.results.reference_curves.ReferenceCurves`.
        x, y: Quantities of its axes.
        scales: What values are divided by for the axes.

    Returns:
        dict label -> dict column -> values in SI units, as data of a figure.
    """
    found = {}
    looks = cycle([(m, line) for line in ("-", "--") for m in style.MARKERS[1:]])
    for reference, (marker, line) in zip(references, looks, strict=False):
        if not {x, y} <= set(reference.columns):
            continue
        values = [reference.columns[name] for name in (x, y)]
        known = np.isfinite(values).all(axis=0)
        values = [numbers[known] for numbers in values]
        axis.plot(
            values[0] / scales[0], values[1] / scales[1], line, marker=marker,
            label=reference.label, color=style.BLACK, linewidth=0.7, markersize=3,
            markerfacecolor="none", markeredgewidth=0.7, markevery=max(1, len(values[0]) // MARKS),
        )  # fmt: skip
        found[f"measured-{file_name(reference.label)}"] = {
            f"{WORDS[name]} [{UNITS[name] or '-'}]": column
            for name, column in zip((x, y), values, strict=True)
        }
    return found


def about(drawn):
    """Words about measured curves that :func:`draw_measured` drew; none without any."""
    return " Black with markers: measured." if drawn else ""


def compared(source):
    """How far a run is from each of its measured curves.

    Args:
        source: :class:`~mufe_fenicsx.report.source.Source`.

    Returns:
        List of dicts, fields of :class:`~mufe_fenicsx.results.reference_curves.Difference`; and
        dict label -> why there is none from that curve.
    """
    found, lines = [], {}
    if source.references and source.get("loading") is None:
        return found, {r.label: "the loading stage was not reached" for r in source.references}
    for reference in source.references:
        try:
            found += map(asdict, differences(reference, source.curves))
        except InputError as error:
            lines[reference.label] = str(error)
    return found, lines


def left_out(found):
    """Sentences on the measured points beyond the runs, or of branches or quantities they lack.

    Args:
        found: As :func:`compared` has them, with the name of the ``run``.
    """
    by_run = {}
    for d in found:
        if any(why in d["left_out"] for why in (BEYOND, NO_BRANCH, NO_QUANTITY)):
            words = f"{WORDS[d['quantity']]} of {d['branch']}: {d['left_out']}"
            by_run.setdefault((d["reference"], d["run"]), []).append(words)
    sentences = {}
    for (label, run), parts in by_run.items():
        words = f"Measured points of {label} ({'; '.join(parts)}) are not compared"
        sentences.setdefault(words, []).append(run)
    num_runs = len({d["run"] for d in found})
    return [
        f"{words}{'' if len(runs) == num_runs else ' with ' + '; '.join(runs)}."
        for words, runs in sentences.items()
    ]


def table_of(found):
    """Table of differences for the page: heading, rows of texts, names of the columns.

    Args:
        found: As :func:`compared` has them, with the name of the ``run``.
    """
    rows = [
        (
            d["run"], d["reference"], WORDS[d["quantity"]], WORDS[d["over"]], d["branch"],
            _text(d["low"], d["over"]), _text(d["high"], d["over"]), style.number(d["num_points"]),
            style.number(d["num_measured"]), d["left_out"] or "–",
            _difference(d["mean"], d), _difference(d["largest"], d), _text(d["at"], d["over"]),
        )
        for d in found
    ]  # fmt: skip
    if len({d["run"] for d in found}) == 1:
        return HEADING, [row[1:] for row in rows], COLUMNS[1:]
    return HEADING, rows, COLUMNS


def columns_of(found):
    """The same as columns of a file, SI units."""
    return {name: [row[name] for row in found] for name in found[0]}


def _text(value, quantity):
    return "–" if value is None else with_unit(value, UNITS[quantity] or "-")


def _difference(value, row):
    if value is None:
        return "–"
    return f"{100 * value:+.1f} %" if row["relative"] else f"{value:+.4f}"
