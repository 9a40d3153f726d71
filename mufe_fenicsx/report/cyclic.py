"""The figure of a cyclic test: loops, secant stiffness and damping ratio of each cycle."""

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from mufe_fenicsx.analysis.cycles import find_cycles
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import shared_legend
from mufe_fenicsx.report.curves import STRESS, shade_dynamic
from mufe_fenicsx.report.figure import Drawing

NAME = "cycles"
#: So many cycles have a line of the legend each; more have a scale of colours.
FEW = 6


def draw_cycles(source):
    """Loops of stress over strain with their secants; stiffness and damping ratio by cycle."""
    history = source.loading
    cycles = find_cycles(history["strain"], history["stress"])
    if not cycles:
        raise InputError("the strain does not turn back twice, expected a cycle of loading")
    figure, axes = style.new_figure(style.PAGE, 2.7, ncols=3, width_ratios=[1.5, 1, 1])
    numbers = np.arange(1, len(cycles) + 1)
    colours = _colours(len(cycles))
    factor, unit = style.unit_of(history["stress"], "Pa")
    strain, stress = history["strain"], history["stress"] / factor
    axes[0].plot(strain, stress, color="0.75", linewidth=0.7, label="whole test")
    for number, cycle, colour in zip(numbers, cycles, colours, strict=True):
        rows = slice(cycle.start, cycle.end + 1)
        label = f"cycle {number}" if len(cycles) <= FEW else None
        axes[0].plot(strain[rows], stress[rows], color=colour, label=label)
        tips = [cycle.start, cycle.turn]
        axes[0].plot(strain[tips], stress[tips], "--", color=colour, linewidth=0.7)
    axes[0].plot([], [], "--", color=style.GREY, linewidth=0.7, label="secant")
    shade_dynamic(axes[0], source, strain, stress, span=False)
    axes[0].set(xlabel=style.STRAIN, ylabel=f"{STRESS}: {unit}")
    stiffness = np.array([cycle.stiffness for cycle in cycles])
    damping = np.array([cycle.damping for cycle in cycles])
    scale, symbol = style.unit_of(stiffness, "Pa")
    for axis, values, label in (
        (axes[1], stiffness / scale, rf"Secant stiffness, $E_{{\mathrm{{sec}}}}$: {symbol}"),
        (axes[2], 100 * damping, "Damping ratio, $D$: %"),
    ):
        axis.plot(numbers, values, color="0.75", linewidth=0.8, zorder=1)
        axis.scatter(numbers, values, 14, color=colours, zorder=2)
        axis.set(xlabel="Cycle", ylabel=label, xlim=(0.5, len(cycles) + 0.5))
        axis.set_ylim(0, 1.15 * np.nanmax(values))
        axis.xaxis.set_major_locator(MaxNLocator(6, integer=True, min_n_ticks=1))
    for i, axis in enumerate(axes):
        style.panel_letter(axis, i)
    if len(cycles) > FEW:
        scale = ScalarMappable(Normalize(1, len(cycles)), style.GRAIN_MAP)
        bar = figure.colorbar(scale, ax=axes[0], location="right", pad=0.02, label="Cycle")
        bar.outline.set_linewidth(0.6)
        bar.locator = MaxNLocator(6, integer=True)
    shared_legend(axes[0], 5)
    return Drawing(
        NAME,
        figure,
        "Cyclic loading: (a) loops of vertical stress over vertical strain, (b) secant stiffness, "
        "(c) damping ratio of each cycle",
        "A cycle goes from one turning point of the strain over the next back to the same strain. "
        "The secant stiffness is that between turning points, mean of both branches: Young's "
        "modulus where the lateral stress is held, constrained modulus where side walls rest. D is "
        "the area of the loop over 4π times the elastic energy of that stiffness (ASTM D3999).",
        {"cycles": _table(history, cycles), "": _curve(history)},
        "wide",
    )


def _colours(number):
    """A colour each: of the series while there are few, of a map where there are many."""
    if number <= FEW:
        return style.SERIES[:number]
    return list(matplotlib.colormaps[style.GRAIN_MAP](np.linspace(0, 1, number)))


def _table(history, cycles):
    at = {name: [getattr(c, name) for c in cycles] for name in ("start", "turn", "end")}
    columns = {"cycle": np.arange(1, len(cycles) + 1)}
    for name, rows in at.items():
        columns[f"strain at its {name} [-]"] = history["strain"][rows]
        columns[f"vertical stress at its {name} [Pa]"] = history["stress"][rows]
    return columns | {
        "secant stiffness [Pa]": [c.stiffness for c in cycles],
        "work of the loop [J/m³]": [c.work for c in cycles],
        "damping ratio [-]": [c.damping for c in cycles],
    }


def _curve(history):
    return {
        "strain [-]": history["strain"],
        "vertical stress [Pa]": history["stress"],
        "stage": history["stage"],
    }
