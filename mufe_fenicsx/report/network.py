"""Figures of the contact network: directions, forces, active contacts."""

import numpy as np
from matplotlib.ticker import MaxNLocator

from mufe_fenicsx.analysis.contact_forces import active_contacts, force_distribution
from mufe_fenicsx.analysis.fabric import rose
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import legends, shared_legend
from mufe_fenicsx.report.curves import PAPER, shade
from mufe_fenicsx.report.figure import Drawing
from mufe_fenicsx.results.columns import vectors

#: Bins of the rose.
NUM_BINS = 24


def bins_for(force):
    """Number of bins up to the largest f/<f>: few where few forces would leave them empty."""
    return int(np.clip(np.sqrt(len(force)), 8, 25))


def between_grains(source, index):
    """Active contacts between grains of a state.

    Raises:
        InputError: There is none.
    """
    table = source.active_contacts(index)
    inner = table[table["wall"] == ""]
    if not len(inner):
        raise InputError(f"state {index} has no active contact between grains")
    return inner


def draw_rose(source):
    """Roses of the contacts' directions in three planes, by number and by force."""
    index = source.contact_states[-1]
    inner = between_grains(source, index)
    normals = vectors(inner, "normal")
    force = np.maximum(inner["normal_force"].to_numpy(dtype=float), 0.0)
    figure, axes = style.new_figure(style.PAGE, 2.5, ncols=3, subplot_kw={"projection": "polar"})
    angle = np.linspace(0, 2 * np.pi, NUM_BINS * 20)  # steps round the circle
    tables, planes = {}, ("xz", "yz", "xy")
    for i, (axis, plane) in enumerate(zip(axes, planes, strict=True)):
        columns = {}
        for weights, colour, line, label in (
            (None, style.BLUE, "-", "contacts"),
            (force, style.RED, "-", "by normal force"),
        ):
            found = rose(normals, plane, NUM_BINS, weights)
            steps = np.repeat(np.nan_to_num(found.density), 20)
            axis.plot(
                np.append(angle, 0),
                np.append(steps, steps[0]),
                line,
                color=colour,
                linewidth=1,
                label=label,
            )
            columns |= {"angle [rad]": found.angle, f"{label} [1/rad]": found.density}
        even = np.full(angle.shape, 1 / (2 * np.pi))
        axis.plot(angle, even, ":", color=style.GREY, linewidth=1, label="isotropic")
        axis.set_yticks([])
        axis.set_xticks(np.radians([0, 90, 180, 270]), [plane[0], plane[1], "", ""])
        axis.set_title(f"({'abc'[i]})", loc="left", fontweight="bold", y=0.97)
        tables[plane] = columns
    shared_legend(axes[0])
    return Drawing(
        "fabric-rose",
        figure,
        "Fabric: orientations of the contacts between grains, in the planes (a) x–z, (b) y–z, (c) "
        f"x–y, at strain {source.strain_of(index):.3f}",
        f"{len(inner)} contacts, each with its normal and the opposite one; radius: share for a "
        "radian. In vertical compression contacts along z are more frequent and stronger.",
        tables,
        "wide",
    )


def draw_force_distribution(source):
    """P(f/<f>) of the normal forces to the largest, logarithmic, at up to three stages."""
    figure, axis = style.new_figure()
    tables, largest = {}, 0.0
    for k, index in enumerate(source.contact_states):
        try:
            force = between_grains(source, index)["normal_force"].to_numpy(dtype=float)
        except InputError:
            continue  # before anything touches
        found = force_distribution(force, bins_for(force))
        if not np.isfinite(found.mean):
            continue
        middle = 0.5 * (found.edges[1:] + found.edges[:-1])
        largest = max(largest, found.edges[-1])
        strain = source.strain_of(index)
        axis.plot(
            middle,
            np.where(found.count > 0, found.density, np.nan),  # no line through empty bins
            style.MARKERS[k] + style.LINES[k],
            color=style.SERIES[k],
            markersize=3,
            linewidth=0.8,
            label=rf"$\varepsilon$ = {style.strain(strain)}, ⟨f⟩ = "
            f"{style.quantity(found.mean, 'N')}, {len(force)} contacts",
        )
        tables[f"state{index}"] = {
            "f/<f> [-]": middle, "P [-]": found.density, "contacts [-]": found.count,
        }  # fmt: skip
    if not tables:
        raise InputError("no state has active contacts between grains")
    x = np.linspace(0, largest, 60)
    axis.plot(x, np.exp(-x), "--", color=style.GREY, linewidth=0.9, label="exp(−f/⟨f⟩)")
    axis.axvline(1, color=style.GREY, linestyle=":", linewidth=0.8)
    axis.set_yscale("log")
    least = min(np.min(t["P [-]"][t["contacts [-]"] > 0]) for t in tables.values())
    axis.set_ylim(bottom=0.3 * least)
    axis.set(xlabel="Normal force over its mean, f/⟨f⟩: –", ylabel="Probability density: –")
    legends(axis)
    return Drawing(
        "force-distribution",
        figure,
        "Distribution of the normal forces between grains",
        "The grey line is the exponential tail of random packings; right of the dotted line is the "
        "strong network. Bins go to the largest force; lines break where a bin is empty.",
        tables,
    )


def draw_active_contacts(source):
    """Number of active contacts of a grain: histogram of stages, mean against strain."""
    figure, (left, right) = style.new_figure(style.PAGE, 2.5, ncols=2)
    counts, tables = {}, {}
    for index in source.contact_states:
        table, grains = source.active_contacts(index), source.run.grains(index)
        inner, labels = table[table["wall"] == ""], grains["grain"].to_numpy()
        ends = [np.searchsorted(labels, inner[k].to_numpy()) for k in ("grain_a", "grain_b")]
        counts[index] = active_contacts(*ends, labels.size)
        tables[f"state{index}"] = {"grain": labels, "active contacts [-]": counts[index]}
    top = max(count.max(initial=0) for count in counts.values())
    edges = np.arange(-0.5, top + 1.5)
    for k, (index, count) in enumerate(counts.items()):
        strain = style.strain(source.strain_of(index))
        left.stairs(
            np.histogram(count, edges)[0],
            edges,
            color=style.SERIES[k],
            linestyle=style.LINES[k],
            linewidth=1.2,
            label=rf"$\varepsilon$ = {strain}, mean {count.mean():.2f}",
        )
    left.set(xlabel=r"Active contacts of a grain, $N_{\mathrm{cA}}$: –", ylabel="Grains: –")
    for axis in (left.xaxis, left.yaxis):
        axis.set_major_locator(MaxNLocator(6, integer=True))
    network = source.network
    strain, over = source.over(network["strain"], network["time"])
    for k, (name, label) in enumerate(
        (("N_cA", "all grains"), ("coordination", "without rattlers"))
    ):
        right.plot(
            strain,
            network[name],
            style.MARKERS[k] + style.LINES[k],
            color=style.SERIES[k],
            markersize=3,
            label=label,
        )
    shade(source, right)
    right.set(xlabel=over, ylabel="Coordination number, $Z$: –")
    right.set_ylim(bottom=0)
    legends(left, right)
    tables["mean"] = {
        "strain [-]": network["strain"],
        "mean of all grains [-]": network["N_cA"],
        "mean of grains with two or more [-]": network["coordination"],
    }
    for i, axis in enumerate((left, right)):
        style.panel_letter(axis, i)
    return Drawing(
        "active-contacts",
        figure,
        "Coordination number: (a) its distribution over the grains, (b) its mean in the course of "
        "the test",
        f"Active contacts carry pressure, as N_cA {PAPER}; walls do not count. Without rattlers, "
        "grains of no or one contact, the mean is the mechanical coordination number.",
        tables,
        "wide",
    )


def draw_ages(source):
    """Share of the contacts of the last state that have been active since when."""
    index = source.contact_states[-1]
    ages = source.run.contact_ages(index)
    ages = ages[ages["wall"] == ""]
    if not len(ages):
        raise InputError(f"state {index} has no active contact between grains")
    states = source.run.with_contacts().loc[:index]
    if len(states) < 2:
        raise InputError("there is one state with tables of contacts, expected two or more")
    since, over = source.over(states["strain"].to_numpy(), states["time"].to_numpy())
    force = np.maximum(ages["normal_force"].to_numpy(dtype=float), 0.0)
    figure, axis = style.new_figure()
    table = {"strain [-]": states["strain"], "time [s]": states["time"]}
    for k, (column, label, weights) in enumerate(
        (
            ("contacts", "of the contacts", np.ones_like(force)),
            ("force", "of their normal forces", force),
        )
    ):
        share = [weights[ages["since"] <= i].sum() / weights.sum() for i in states.index]
        axis.plot(
            since,
            100 * np.array(share),
            style.MARKERS[k] + style.LINES[k],
            color=style.SERIES[k],
            markersize=3,
            label=label,
        )
        table[f"share of {column} [-]"] = share
    shade(source, axis)
    axis.set(xlabel=over, ylabel="Active since then or longer: %", ylim=(0, 102))
    legends(axis)
    return Drawing(
        "contact-age",
        figure,
        "Age of the contacts between grains: share of those of the last state that have been "
        "active without interruption since an earlier state",
        f"{len(ages)} contacts at strain {source.strain_of(index):.3f}, resolved by the stored "
        "states. Where the curve by force lies above that by number, old contacts carry more.",
        {"": table},
    )
