"""Figures of a chart: error over time and over element-steps, with the front of the best."""

import math
from pathlib import Path

import matplotlib
from matplotlib.ticker import NullFormatter

from ...analysis.evidence import cost_at, pareto, usable
from ...report import style
from .grid import OURS, SEED

#: Colour, mark and line of each line of the chart.
LOOKS = {
    OURS: (style.BLUE, "o", "-"),
    "four points": (style.GREEN, "o", "--"),
    SEED: (style.RED, "s", "-"),
    "plain P1": (style.RED, "s", ":"),
    "stiff penalty": (style.PINK, "v", "-"),
    "kinematic law": (style.PINK, "D", ":"),
    "kinematic law, loading x 2": (style.PINK, "d", "-."),
    "contact at nodes": (style.PINK, "x", "--"),
    "element's time step": (style.BLUE, "o", ":"),
    "mass 1 %": (style.SKY, "o", "--"),
    "mass 5 %": (style.SKY, "o", "-"),
    "mass 20 %": (style.SKY, "o", ":"),
    "loading x 2": (style.ORANGE, "<", "-"),
    "loading x 4": (style.ORANGE, ">", "--"),
    "mass 1 %, loading x 2": (style.ORANGE, "h", "-."),
    "mass 5 %, loading x 1.5": (style.ORANGE, "H", "-"),
    "mass 5 %, loading x 2": (style.ORANGE, "p", ":"),
    "static": (style.GREY, "P", "-"),
    "implicit": (style.GREY, "X", "--"),
    "rigid": (style.BLACK, "*", "-"),
    "elastic": (style.BLACK, "1", "-"),
    "auto": (style.GREEN, "d", "--"),
    "another rounding": (style.GREY, ".", "-"),
    "one layer": (style.GREEN, "^", "--"),
    "sample 2": (style.BLUE, "^", "--"),
    "sample 3": (style.BLUE, "v", ":"),
}
#: Errors beyond this are not drawn: they would leave no room for the others.
LARGEST = 1.5
COSTS = {"seconds": "time of one processor (s)", "element_steps": "element-steps"}


def draw_chart(points, case, folder):
    """Write CASE.png and CASE.pdf into a folder; errors up to :data:`LARGEST`.

    Args:
        points: Of any cases.
        case: Of which the chart is.
        folder: Where to, which exists.

    Returns:
        The two paths.
    """
    with matplotlib.rc_context(style.RC):
        figure, axes = style.new_figure(style.PAGE, 0.52 * style.PAGE, ncols=2, sharey=True)
        for index, (axis, cost) in enumerate(zip(axes, COSTS, strict=True)):
            _draw_lines(axis, points, case, cost)
            style.panel_letter(axis, index)
        axes[0].set_ylabel(f"{case}: error (%)")
        return _write(figure, axes, folder, case)


def draw_side_by_side(points, cases, folder):
    """Write cases.png and cases.pdf: both costs of each case below each other, three cases abreast.

    Args:
        points: Of any cases.
        cases: Of which the panels are.
        folder: Where to, which exists.

    Returns:
        The two paths.
    """
    across = min(len(cases), 3)
    down = len(COSTS) * math.ceil(len(cases) / across)
    with matplotlib.rc_context(style.RC):
        height = (0.1 + 0.26 * down) * style.PAGE
        figure, axes = style.new_figure(style.PAGE, height, nrows=down, ncols=across, squeeze=False)
        for axis in axes[-len(COSTS) :, (len(cases) - 1) % across + 1 :].flat:
            axis.set_axis_off()
        for k, case in enumerate(cases):
            row, column = len(COSTS) * (k // across), k % across
            for axis, cost in zip(axes[row:, column], COSTS, strict=False):
                _draw_lines(axis, points, case, cost)
                axis.set_ylabel(f"{case}: error (%)")
        return _write(figure, axes.flat, folder, "cases", "outside lower center", ncols=4)


def _draw_lines(axis, points, case, cost):
    """The lines of a case and its front, error over a cost, one of :data:`COSTS`."""
    own = [p for p in usable(points, case) if p.error <= LARGEST]
    for name, (colour, mark, line) in LOOKS.items():
        some = [p for p in own if p.series == name and math.isfinite(getattr(p, cost))]
        if not some:
            continue
        some.sort(key=lambda p: getattr(p, cost))
        x, y = [getattr(p, cost) for p in some], [100 * p.error for p in some]
        axis.plot(x, y, color=colour, marker=mark, linestyle=line, markersize=3.5,
                  linewidth=0.9, label=name)  # fmt: skip
    front = pareto(own, cost)
    axis.plot([getattr(p, cost) for p in front], [100 * p.error for p in front],
              color=style.BLACK, linewidth=2.2, alpha=0.25, zorder=0,
              label="front of all")  # fmt: skip
    axis.set(xscale="log", yscale="log", xlabel=COSTS[cost])
    style.plain_log_ticks(axis.yaxis)
    if cost == "seconds":
        style.plain_log_ticks(axis.xaxis)
    else:  # less than a decade has no room for powers of ten between
        axis.xaxis.set_minor_formatter(NullFormatter())


def _write(figure, axes, folder, name, place="outside right upper", **legend):
    """Write a figure with one legend for all axes; the two paths."""
    looks = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            looks.setdefault(label, handle)
    figure.legend(looks.values(), looks.keys(), loc=place, **legend)
    paths = [Path(folder) / f"{name}.{kind}" for kind in ("png", "pdf")]
    for path in paths:
        figure.savefig(path)
    return paths


def gain_over_seed(points, case, cost="seconds"):
    """How many times cheaper than the seed's method, at each error that this one reaches.

    Returns:
        List of (error, cost of the seed's method over that of the default choices, the same over
        that of the front of all); nan where these do not reach it.
    """
    own = usable(points, case)
    ours = [p for p in own if p.series == OURS]
    return [
        (p.error, *(getattr(p, cost) / cost_at(some, p.error, cost) for some in (ours, own)))
        for p in pareto([p for p in own if p.series == SEED], cost)
    ]
