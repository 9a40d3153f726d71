"""Figures 1 to 5: curves from the history."""

import numpy as np
from matplotlib.ticker import FuncFormatter

from mufe_fenicsx.analysis import energy_check, quasi_static, stress_strain
from mufe_fenicsx.analysis.rows import largest, loaded_rows, loading_rows
from mufe_fenicsx.report import style
from mufe_fenicsx.report.checks import TARGETS

STRAIN = r"Vertical strain, $\varepsilon$"


def draw_stress_strain(history):
    """Vertical stress against strain; the seating stage in grey."""
    figure, axis = style.new_figure()
    factor, unit = style.unit_of(history["stress"], "Pa")
    strain, stress, loading = history["strain"], history["stress"] / factor, loading_rows(history)
    if (~loading).any():
        axis.plot(
            strain[~loading], stress[~loading], color=style.GREY, linewidth=0.9, label="seating"
        )
    axis.plot(strain[loading], stress[loading], color=style.BLUE, label="loading")
    axis.set(xlabel=STRAIN, ylabel=rf"Vertical stress, $\sigma_{{\mathrm{{v}}}}$: {unit}")
    axis.set_ylim(bottom=min(0, 1.05 * stress.min()))
    axis.legend(loc="upper left")
    return figure


def draw_forces(history, reference_height):
    """Forces on all walls against the displacement of the top platen."""
    figure, (left, right) = style.new_figure(style.PAGE, 2.6, ncols=2)
    rows = loading_rows(history)
    travel = stress_strain.displacement(history, reference_height)[rows]
    platens = {"top platen": history["force_z_max"][rows], "bottom": history["force_z_min"][rows]}
    sides = {name: force[rows] for name, force in stress_strain.side_forces(history).items()}
    scale, unit_u = style.unit_of(travel, "m")
    for axis, forces, colours in (
        (left, platens, (style.BLUE, style.ORANGE)),
        (right, sides, (style.BLUE, style.SKY, style.RED, style.ORANGE)),
    ):
        factor, unit = style.unit_of(np.concatenate(list(forces.values())), "N")
        lines = zip(forces.items(), colours, strict=True)
        for i, ((name, force), colour) in enumerate(lines):
            label = rf"${name[0]}_{{\mathrm{{{name[2:]}}}}}$" if axis is right else name
            axis.plot(
                travel / scale, force / factor, "--" if i % 2 else "-", color=colour, label=label
            )
        axis.set(xlabel=f"Displacement of top platen: {unit_u}", ylabel=f"Normal force: {unit}")
        axis.set_ylim(bottom=min(0, *(1.05 * f.min() / factor for f in forces.values())))
        axis.legend(loc="upper left", title="side walls" if axis is right else None)
    style.panel_letter(left, 0)
    style.panel_letter(right, 1)
    return figure


def draw_energies(history):
    """Work of the walls and what it became, against strain."""
    figure, axis = style.new_figure()
    rows = loading_rows(history)
    factor, unit = style.unit_of(history["work"][rows], "J")
    axis.plot(
        history["strain"][rows],
        history["work"][rows] / factor,
        color=style.BLACK,
        label="work of the walls",
    )
    names = {
        "plastic": ("plastic", style.RED, "-"),
        "friction": ("friction", style.ORANGE, "-"),
        "elastic": ("elastic", style.BLUE, "-"),
        "contact": ("contact springs", style.SKY, "--"),
        "damping": ("damping", style.PINK, "-."),
        "kinetic": ("kinetic", style.GREEN, ":"),
    }
    for name, (label, colour, line) in names.items():
        if not history[name][rows].any():
            continue
        axis.plot(
            history["strain"][rows], history[name][rows] / factor, line, color=colour, label=label
        )
    axis.set(xlabel=STRAIN, ylabel=f"Energy: {unit}")
    axis.legend(loc="upper left")
    return figure


def draw_dissipation(history):
    """Dissipated energies on a logarithmic axis."""
    figure, axis = style.new_figure()
    rows = loading_rows(history)
    strain = history["strain"][rows]
    factor, unit = style.unit_of(history["plastic"][rows], "J")
    top = 0.0
    for name, colour, line in (
        ("plastic", style.RED, "-"),
        ("friction", style.ORANGE, "--"),
        ("damping", style.PINK, "-."),
    ):
        values = history[name][rows] / factor
        if (values > 0).any():
            axis.plot(strain[values > 0], values[values > 0], line, color=colour, label=name)
            top = max(top, values.max())
    if top > 0:
        axis.set_yscale("log")
        # What dissipated before the grains yield would stretch the axis.
        axis.set_ylim(max(axis.get_ylim()[0], 1e-5 * top), 2 * top)
        axis.legend(loc="lower right")
    else:
        axis.text(0.5, 0.5, "nothing was dissipated", transform=axis.transAxes, ha="center")
    axis.set(xlabel=STRAIN, ylabel=f"Dissipated energy: {unit}")
    return figure


def draw_monitors(history):
    """Kinetic ratio, balance of the platens and energy residual, each with its target."""
    figure, axes = style.new_figure(style.PAGE, 2.4, ncols=3)
    rows, loaded = loading_rows(history), loaded_rows(history)
    panels = (
        ("kinetic", quasi_static.kinetic_ratio(history), "Kinetic / internal energy"),
        ("platens", quasi_static.force_difference(history), "|top − bottom| / mean force"),
        ("residual", energy_check.residual_ratio(history), "|Energy residual| / work"),
    )
    strain = history["strain"]
    for i, (axis, (name, values, label)) in enumerate(zip(axes, panels, strict=True)):
        target = TARGETS[name]
        positive = rows & (values > 0)
        axis.plot(strain[positive], values[positive], color=style.BLUE, linewidth=0.9)
        axis.axhline(target, color=style.RED, linestyle="--", linewidth=0.9)
        axis.set_yscale("log")
        worst = largest(values[loaded & positive])
        top = 10 * max(target, worst if np.isfinite(worst) else 0)
        bottom = values[positive].min() if positive.any() else 1e-3 * target
        axis.set_ylim(max(bottom / 2, 1e-4 * target), top)
        if loaded.any():
            axis.axvspan(
                strain[loaded].min(), strain[loaded].max(), color="0.93", linewidth=0, zorder=0
            )
        axis.set_title(f"- - target {100 * target:g} %", loc="right", color=style.RED, fontsize=7)
        axis.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{100 * y:g} %"))
        axis.set(xlabel=STRAIN, ylabel=label)
        style.panel_letter(axis, i)
    return figure
