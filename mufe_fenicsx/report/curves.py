"""Figures from the history: stress, forces, energies, monitors, compression."""

import numpy as np

from mufe_fenicsx.analysis import energy_check, quasi_static, stress_strain
from mufe_fenicsx.analysis.check_targets import TARGETS
from mufe_fenicsx.analysis.checks import judged_rows
from mufe_fenicsx.analysis.rows import (
    branches,
    is_constrained,
    largest,
    loading_rows,
    waiting_rows,
)
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import legends, shared_legend, without_spikes
from mufe_fenicsx.report.figure import Drawing
from mufe_fenicsx.report.reference import about as about_measured
from mufe_fenicsx.report.reference import draw_measured

STRAIN = style.STRAIN
STRESS = r"Vertical stress, $\sigma_{\mathrm{v}}$"
PAPER = "of Nadimi & Fonseca (2018)"

#: Words about :func:`shade_dynamic`.
DYNAMIC = (
    "Grey: not quasi-static, inertia shows in the forces; its end is that of the last row in which "
    "kinetic energy or unbalanced force exceeds its target."
)
#: Energies below this part of the work are not drawn; the data have them.
SEEN = 1e-6
#: Dents below this part of the plastic dissipation are not drawn; the data have them.
SEEN_DENTS = 0.01
#: What cracks dissipate.
OF_CRACKS = "cracks_fracture", "cracks_friction", "cracks_damping", "cracks_dust"
#: Stages of a test that turns back that have an arrow.
ARROWS = 8
#: label, colour and line of each energy.
ENERGIES = {
    "plastic": ("plastic", style.RED, "-"),
    "friction": ("friction", style.ORANGE, "-"),
    "elastic": ("elastic", style.BLUE, "-"),
    "switching": ("facet switching", style.BLACK, "-."),
    "contact": ("contact springs", style.SKY, "--"),
    "damping": ("damping", style.PINK, "-."),
    "parting": ("parting of nodes", style.GREY, "--"),
    "kinetic": ("kinetic", style.GREEN, ":"),
    "cracks_fracture": ("fracture", style.PINK, "-"),
    "cracks_friction": ("friction in cracks", style.ORANGE, ":"),
    "cracks_stored": ("springs of cracks", style.SKY, "-."),
    "cracks_damping": ("damping in cracks", style.PINK, ":"),
    "cracks_opening": ("springs of cracks as they opened", style.GREY, "-."),
    "cracks_dust": ("fragments that became rigid", style.BLACK, ":"),
}
#: Energy of a term whose parts are drawn instead.
IN_PARTS = "energy_cracks"


def draw_stress_strain(source):
    """Vertical stress against strain; the seating stage in grey; stress of the contacts."""
    history, loading = source.history, loading_rows(source.history)
    source.loading  # noqa: B018  there has to be some
    figure, axis = style.new_figure()
    factor, unit = style.unit_of(history["stress"], "Pa")
    strain, stress = history["strain"], history["stress"] / factor
    if (~loading).any() and "strain_z" not in history:  # by stages strain starts anew after it
        axis.plot(
            strain[~loading], stress[~loading], color=style.GREY, linewidth=0.9, label="seating"
        )
    waits = waiting_rows(history)
    draw_branches(axis, strain, np.where(waits, np.nan, stress), branches(history), "platens")
    if waits.any():
        axis.plot(strain[waits], stress[waits], ",", color=style.BLUE)
    tables = {
        "": {
            "strain [-]": history["strain"],
            "vertical stress [Pa]": history["stress"],
            "stage": history["stage"],
        }
    }
    contacts = _contact_stress(source)
    if contacts is not None:
        look = {"color": style.RED, "markersize": 3.5, "markerfacecolor": "none"}
        over, inner = contacts["strain"], contacts["contact_zz"] / factor
        axis.plot(over, inner, "o", markeredgewidth=0.8, label="contacts", **look)
        tables["contacts"] = {
            "strain [-]": contacts["strain"],
            "vertical stress of the contacts [Pa]": contacts["contact_zz"],
            "vertical stress of the platens [Pa]": contacts["wall_zz"],
        }
    shaded = shade_dynamic(axis, source, strain[loading], stress[loading])
    measured = draw_measured(axis, source.references, "strain", "stress", (1.0, factor))
    tables |= measured
    axis.set(xlabel=STRAIN, ylabel=f"{STRESS}: {unit}")
    axis.set_ylim(bottom=min(0, 1.05 * stress.min()))
    shown = [np.column_stack(list(data.values())) / (1.0, factor) for data in measured.values()]
    without_spikes(axis, *np.vstack([np.column_stack([strain, stress]), *shown]).T)
    legends(axis)
    about = (
        "The line is the mean force of both platens over the cross-section, compression positive. "
        "Strain counts from the end of seating, or from where stages set it to zero, so that gaps "
        "left by the segmentation do not count."
    )
    about += _about_branches(source) + about_measured(measured)
    if waits.any():
        about += " Points without a line: the test waits for a stress at a strain that is reached."
    if shaded:
        about += f" {DYNAMIC}"
    if contacts is not None:
        about += (
            " Circles are the mean stress from forces and branch vectors of the contacts (Love, "
            "Weber), independent of the line."
        )
    title = f"Vertical stress against vertical strain (Fig. 9 {PAPER})"
    return Drawing("stress-strain", figure, title, about, tables)


def shade_dynamic(axis, source, x, y, span=None):
    """Grey where the test is not quasi-static yet; whether there is such a part.

    Args:
        axis: To draw into.
        source: :class:`~mufe_fenicsx.report.source.Source`.
        x, y: Of the rows of loading, as plotted.
        span: Shade all of the height, or underlay the curve; None: unless strain turns back.
    """
    last = source.last_dynamic
    if last is None:
        return False
    x, y = x[: last + 2], y[: last + 2]  # up to the first row that is trusted
    look = {"color": "0.88", "zorder": 0, "label": "not quasi-static"}
    if not source.turns_back if span is None else span:
        axis.axvspan(x.min(), x.max(), linewidth=0, **look)
    else:
        axis.plot(x, y, linewidth=5, solid_capstyle="butt", **look)
    return True


def shade(source, *axes):
    """:func:`shade_dynamic` in axes over what :meth:`Source.over` gives, all of their height."""
    history = source.get("loading")
    if history is None:
        return
    x, _ = source.over(history["strain"], history["time"])
    for axis in axes:
        shade_dynamic(axis, source, x, x, span=True)


def _contact_stress(source):
    """A row a state, or None where the run does not have what it takes."""
    try:
        if len(source.run.with_contacts()):
            return source.run.stresses()
    except InputError:
        pass  # contacts are drawn, or said to be absent, by figures of their own
    return None


def draw_branches(axis, x, y, parts, label=None):
    """A curve through the stages of a test: unloading and reloading differ by line and colour.

    Args:
        axis: To draw into.
        x, y: Values a row, as plotted.
        parts: Of :func:`mufe_fenicsx.analysis.rows.branches`; where none unloads, one line.
        label: Of that line; with unloading each kind has its name.
    """
    if not any(part.kind == "unloading" for part in parts):
        start = min(part.rows.start for part in parts)
        axis.plot(x[start:], y[start:], color=style.BLUE, label=label)
        return
    x, y, named = np.asarray(x), np.asarray(y), set()
    for number, part in enumerate(parts):
        line, colour = style.BRANCHES[part.kind]
        name = part.kind if part.kind not in named else None
        named.add(part.kind)
        axis.plot(x[part.rows], y[part.rows], line, color=colour, label=name)
        if number < ARROWS:
            _arrow(axis, x[part.rows], y[part.rows], np.ptp(x), np.ptp(y), colour)


def _arrow(axis, x, y, width, height, colour):
    """The direction of a curve, half-way along it, in a picture of some width and height."""
    steps = np.hypot(np.diff(x) / (width or 1), np.diff(y) / (height or 1))
    way = np.append(0, np.cumsum(np.nan_to_num(steps)))
    if way[-1] < 0.05:
        return
    start, end = (np.searchsorted(way, part * way[-1]) for part in (0.48, 0.54))
    look = {"arrowstyle": "-|>", "color": colour, "linewidth": 0, "mutation_scale": 9}
    axis.annotate(
        "", (x[end], y[end]), (x[start], y[start]), arrowprops=look | {"shrinkA": 0, "shrinkB": 0}
    )


def _about_branches(source):
    """Words about the stages of a test that turns back."""
    if not source.turns_back:
        constrained = is_constrained(source.history)
        return " The slope is the constrained modulus." if constrained else ""
    kinds = [(part.stage, part.kind) for part in branches(source.history)]
    stages = style.listed([f"{stage} ({kind})" for stage, kind in kinds])
    first = f" of its first {ARROWS} stages" if len(kinds) > ARROWS else ""
    return f" Arrows show the course of the test{first}; its stages: {stages}."


def draw_forces(source):
    """Forces on all walls against the displacement of the top platen."""
    figure, (left, right) = style.new_figure(style.PAGE, 2.6, ncols=2)
    history = source.loading
    travel = stress_strain.displacement(history, source.reference_height)
    platens = {"top platen": history["force_z_max"], "bottom": history["force_z_min"]}
    sides = stress_strain.side_forces(history)
    scale, unit_u = style.unit_of(travel, "m")
    over, label_x = travel / scale, f"Displacement of top platen: {unit_u}"
    if source.turns_back or "strain_z" in history:
        over, label_x = source.over(history["strain"], history["time"])
    for axis, forces, colours in (
        (left, platens, (style.BLUE, style.ORANGE)),
        (right, sides, (style.BLUE, style.SKY, style.RED, style.ORANGE)),
    ):
        factor, unit = style.unit_of(np.concatenate(list(forces.values())), "N")
        lines = zip(forces.items(), colours, strict=False)
        for i, ((name, force), colour) in enumerate(lines):
            label = _of_wall(name) if axis is right else name
            axis.plot(over, force / factor, "--" if i % 2 else "-", color=colour, label=label)
        axis.set(xlabel=label_x, ylabel=f"Normal force: {unit}")
        axis.set_ylim(bottom=min(0, *(1.05 * f.min() / factor for f in forces.values())))
        shade_dynamic(axis, source, over, over, span=True)
        without_spikes(axis, over, *(force / factor for force in forces.values()))
    legends(left, right)
    style.panel_letter(left, 0)
    style.panel_letter(right, 1)
    columns = {"displacement [m]": travel, "strain [-]": history["strain"]}
    columns |= {f"force {n} [N]": history[f"force_{n}"] for n in (*sides, "z_min", "z_max")}
    return Drawing(
        "forces",
        figure,
        "Normal forces (a) on the platens and (b) on the side walls",
        "Top and bottom coincide in equilibrium: they differ by inertia or by friction on the side "
        "walls. Side walls that differ show a heterogeneous packing or a small sample.",
        {"": columns},
        "wide",
    )


def _of_wall(name):
    """Name of a wall as a legend has it: a plane's axis with its side."""
    axis, _, side = name.partition("_")
    return rf"${axis}_{{\mathrm{{{side}}}}}$" if side else name


def draw_energies(source):
    """Energy balance: work of the walls and its parts; kinetic beside internal energy."""
    figure, (left, right) = style.new_figure(style.PAGE, 2.6, ncols=2)
    history = source.loading
    (strain, over), work = source.over(history["strain"], history["time"]), history["work"]
    factor, unit = style.unit_of(work, "J")
    left.plot(strain, work / factor, color=style.BLACK, label="work of the walls")
    there = {name: look for name, look in ENERGIES.items() if name in history}
    for name in history:
        if name.startswith(energy_check.OF_TERM) and name != IN_PARTS:
            there[name] = (name.removeprefix(energy_check.OF_TERM), style.GREY, "-.")
    for name, (label, colour, line) in there.items():
        if np.abs(history[name]).max() > SEEN * work.max():
            left.plot(strain, history[name] / factor, line, color=colour, label=label)
    left.set(xlabel=over, ylabel=f"Energy: {unit}")
    internal = history["elastic"] + history["plastic"]
    for values, label, colour, line in (
        (internal, "internal (elastic + plastic)", style.BLUE, "-"),
        (history["kinetic"], "kinetic", style.GREEN, ":"),
    ):
        positive = values > 0
        right.plot(strain[positive], values[positive] / factor, line, color=colour, label=label)
    right.set_yscale("log")
    style.few_decades(right, [internal / factor, history["kinetic"] / factor])
    right.set(xlabel=over, ylabel=f"Energy: {unit}")
    shade(source, left, right)
    legends(left, right)
    for i, axis in enumerate((left, right)):
        style.panel_letter(axis, i)
    columns = {"strain [-]": history["strain"], "work [J]": work}
    columns |= {f"{name} [J]": history[name] for name in there}
    return Drawing(
        "energies",
        figure,
        f"Energy balance (Fig. 11 {PAPER}): (a) work of the walls, stored and dissipated "
        "energies, (b) kinetic beside internal energy, logarithmic",
        "The coloured curves of (a) add up to the black one if the balance closes. The test is "
        "quasi-static where the kinetic energy is a small part of the internal one.",
        {"": columns},
        "wide",
    )


def draw_dissipation(source):
    """Plastic and frictional dissipation, and their ratio."""
    figure, (left, right) = style.new_figure(style.PAGE, 2.6, ncols=2)
    history = source.loading
    strain, over = source.over(history["strain"], history["time"])
    factor, unit = style.unit_of(np.append(history["plastic"], history["friction"]), "J")
    least = SEEN * history["work"].max()
    lines = {"plastic": "-", "friction": "--", "damping": "-.", "plastic_dents": ":"}
    lines |= {name: ENERGIES[name][2] for name in OF_CRACKS}
    names = [n for n in ("plastic", "friction", "damping", *OF_CRACKS) if n in history]
    shown = {name: history[name] for name in names if history[name].max() > least}
    looks = {name: ENERGIES[name][:2] for name in names}
    in_dents = energy_check.dents_share(history)
    if in_dents >= SEEN_DENTS:
        shown["plastic_dents"] = history["plastic_dents"]
        looks["plastic_dents"] = "plastic, in dents", style.RED
    for name, values in shown.items():
        label, colour = looks[name]
        look = {"color": colour, "label": label}
        left.plot(strain, values / factor, lines[name], **look)
        positive = values > 0
        right.plot(strain[positive], values[positive] / factor, lines[name], **look)
    for i, axis in enumerate((left, right)):
        axis.set(xlabel=over, ylabel=f"Dissipated energy: {unit}")
        style.panel_letter(axis, i)
    shade(source, left, right)
    if any((values > 0).any() for values in shown.values()):
        right.set_yscale("log")
        style.few_decades(right, [values / factor for values in shown.values()])
        shared_legend(left)
    else:
        for axis in (left, right):
            axis.text(0.5, 0.5, "nothing was dissipated", transform=axis.transAxes, ha="center")
    columns = {"strain [-]": history["strain"]}
    columns |= {f"{name} [J]": history[name] for name in lines if name in history}
    share = energy_check.friction_share(history)
    at_end = f" Here it is {share:.1%} of it at the end." if np.isfinite(share) else ""
    if in_dents >= SEEN_DENTS:
        at_end += (
            f" Dents, which flow under contacts smaller than an element, have {in_dents:.1%} of "
            "the plastic one at the end."
        )
    return Drawing(
        "dissipation",
        figure,
        f"Plastic and frictional dissipation (Fig. 12 {PAPER}), (a) linear, (b) logarithmic",
        "Nadimi & Fonseca found the frictional dissipation an order of magnitude below the "
        f"plastic one.{at_end} Damping, if used, should be far below both.",
        {"": columns},
        "wide",
    )


def draw_monitors(source):
    """Kinetic ratio, balance of the platens and energy residual, each with its target."""
    history = source.history
    figure, axes = style.new_figure(style.PAGE, 2.6, ncols=3)
    rows, loaded = loading_rows(history), judged_rows(history)
    source.loading  # noqa: B018  there has to be some
    kinetic, difference = quasi_static.judged(history, source.mass)
    single = quasi_static.kinetic_ratio(history), quasi_static.force_difference(history)
    panels = (
        ("kinetic", kinetic, single[0], "Kinetic / internal energy"),
        ("platens", difference, single[1], "Unbalanced force / load"),
        ("residual", energy_check.residual_ratio(history), None, "|Energy residual| / work"),
    )
    strain, over = source.over(history["strain"], history["time"])
    columns = {"strain [-]": history["strain"][rows]}
    for i, (axis, (name, values, of_rows, label)) in enumerate(zip(axes, panels, strict=True)):
        columns[f"{label.replace('−', '-')} [-]"] = values[rows]
        target = TARGETS[name]
        positive = rows & (values > 0)
        if of_rows is not None:
            columns[f"{label.replace('−', '-')} of single rows [-]"] = of_rows[rows]
            shown = rows & (of_rows > 0)
            look = {"color": style.SKY, "linewidth": 0.5, "alpha": 0.6, "label": "single rows"}
            axis.plot(strain[shown], of_rows[shown], **look)
        look = {"color": style.BLUE, "linewidth": 0.9, "label": "mean over half a travel time"}
        axis.plot(strain[positive], values[positive], **look)
        axis.axhline(target, color=style.RED, linestyle="--", linewidth=0.9, label="target")
        judged = np.where(loaded, target, np.nan)
        axis.plot(strain, judged, color=style.RED, linewidth=2, label="target where it counts")
        shade_dynamic(axis, source, strain[rows], values[rows], span=True)
        axis.set_yscale("log")
        worst = largest(values[loaded & positive])
        top = 10 * max(target, worst if np.isfinite(worst) else 0)
        bottom = values[positive].min() if positive.any() else 1e-3 * target
        axis.set_ylim(max(bottom / 2, 1e-4 * target), top)
        axis.set_title(f"target {100 * target:g} %", loc="right", color=style.RED, fontsize=7.5)
        style.plain_log_ticks(axis.yaxis, lambda x: f"{_plain(100 * x)} %")
        axis.set(xlabel=over, ylabel=label)
        style.panel_letter(axis, i)
    shared_legend(axes[0], 5)
    return Drawing(
        "quasi-static",
        figure,
        "Quasi-static monitors: (a) kinetic over internal energy, (b) unbalanced force "
        "over the load, (c) energy residual over work",
        "Dark curves are the mean (a) and the root mean square (b) over half the travel time of a "
        "wave through the sample, (c) has single rows; pale curves are single rows, which shake "
        "where a grain slips. The checks apply where the target is solid, beyond a tenth of the "
        f"test. {DYNAMIC}",
        {"": columns},
        "wide",
    )


def _plain(value):
    """A number without a power of ten."""
    return f"{value:.8f}".rstrip("0").rstrip(".")


def draw_compression(source):
    """e-log σ' curve, constrained modulus and K0 over the vertical stress."""
    history = source.loading
    width = 0.2 * np.ptp(history["strain"])
    curves = source.run.curves(width)
    curves = curves[loading_rows(source.history)].reset_index(drop=True)
    if not (curves["stress"] > 0).any():
        raise InputError("the walls were never loaded")
    parts = branches(history)
    curves.loc[curves["stress"] <= 0, ["stress", "modulus", "K0"]] = np.nan
    oedometer = is_constrained(history)
    figure, axes = style.new_figure(style.PAGE, 2.4, ncols=3)
    factor, unit = style.unit_of(curves["stress"], "Pa")
    modulus, unit_m = style.unit_of(curves["modulus"], "Pa")
    slope = (
        "Constrained modulus, $M$"
        if oedometer
        else r"Tangent modulus, d$\sigma_{\mathrm{v}}$/d$\varepsilon$"
    )
    ratio = r"$\sigma_{\mathrm{h}} / \sigma_{\mathrm{v}}$: –"
    measured = {}
    for axis, values, label, quantity in (
        (axes[0], curves["void_ratio"], "Void ratio, $e$: –", "void_ratio"),
        (axes[1], curves["modulus"] / modulus, f"{slope}: {unit_m}", ""),
        (axes[2], curves["K0"], r"$K_{\mathrm{0}}$ = " + ratio if oedometer else ratio, "k0"),
    ):
        draw_branches(axis, curves["stress"] / factor, values, parts, "loading")
        shaded = shade_dynamic(axis, source, curves["stress"] / factor, values, span=False)
        drawn = draw_measured(axis, source.references, "stress", quantity, (factor, 1.0))
        measured |= {f"{name}-{quantity}": data for name, data in drawn.items()}
        axis.set_xscale("log")
        style.plain_log_ticks(axis.xaxis)
        axis.set(xlabel=f"{STRESS}: {unit}", ylabel=label)
    for axis, values in ((axes[1], curves["modulus"] / modulus), (axes[2], curves["K0"])):
        axis.set_ylim(bottom=min(0, *axis.get_ylim()))
        without_spikes(axis, curves["stress"] / factor, values)
    if source.turns_back or shaded or measured:
        shared_legend(axes[0], more=axes[2:])
    for i, axis in enumerate(axes):
        style.panel_letter(axis, i)
    return Drawing(
        "compression",
        figure,
        "(a) Compression curve e–log σ′, (b) "
        + (
            "constrained modulus and (c) coefficient of earth pressure at rest"
            if oedometer
            else "tangent modulus and (c) ratio of side to axial stress"
        )
        + " against the vertical stress",
        "Void ratio with the grains' own volume at the start as solids. The slope is that "
        "of a line fitted over a fifth of the range of strains, within a stage. The ratio is the "
        "mean stress of the side walls over that of the platens." + about_measured(measured),
        {**measured, "": _compression_data(curves, oedometer)},
        "wide",
    )


def _compression_data(curves, oedometer):
    """Columns of the data beside the figure."""
    return {
        "strain [-]": curves["strain"],
        "vertical stress [Pa]": curves["stress"],
        "void ratio [-]": curves["void_ratio"],
        f"{'constrained' if oedometer else 'tangent'} modulus [Pa]": curves["modulus"],
        "K0 [-]" if oedometer else "ratio of side to axial stress [-]": curves["K0"],
    }
