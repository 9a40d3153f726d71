"""The figure of a run's profile: what a step costs, part by part, as the test goes on."""

import numpy as np

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.output.run_folder import PROFILE
from mufe_fenicsx.report import style
from mufe_fenicsx.report.figure import Drawing

NAME = "time-by-parts"
#: Bars, each of the same number of steps.
BARS = 20


def draw_profile(source):
    """Time of a step by parts as the test goes on, and of all steps."""
    table = read_history(source.folder / PROFILE)
    strain, steps = table.pop("strain"), table.pop("steps")
    if len(steps) < 2 or steps[-1] <= steps[0]:
        raise InputError(f"{PROFILE} has {len(steps)} rows, expected two of different steps")
    order = sorted(table, key=lambda part: -table[part][-1])
    shown = {part: table[part] for part in order[: len(style.SERIES) - 1]}
    shown["all else"] = sum(table[part] for part in order[len(shown) :])
    edges = np.linspace(steps[0], steps[-1], BARS + 1)
    scale, unit = style.unit_of(sum(table.values())[-1] / steps[-1], "s")
    figure, axes = style.new_figure(style.PAGE, 2.7, ncols=2, width_ratios=[2, 1])
    below = np.zeros(BARS)
    for (part, seconds), colour in zip(shown.items(), style.SERIES, strict=True):
        cost = np.diff(np.interp(edges, steps, seconds)) / np.diff(edges) / scale
        axes[0].bar(edges[:-1], cost, np.diff(edges), below, align="edge", color=colour)
        below += cost
        axes[1].barh(part, seconds[-1], color=colour)
    axes[0].set(xlabel="Step", ylabel=f"Time of a step: {unit}", xlim=(edges[0], edges[-1]))
    axes[1].set(xlabel="Time of all steps: s")
    axes[1].invert_yaxis()
    for i, axis in enumerate(axes):
        style.panel_letter(axis, i)
    return Drawing(
        NAME,
        figure,
        "Where the time went: (a) of a step as the test goes on, (b) of all steps, colours alike",
        "Means over ranks. The time of a part that another one calls counts for the inner one.",
        {"": {"strain": strain, "steps": steps} | {f"{p} [s]": table[p] for p in order}},
        "wide",
    )
