"""Figures of how grains move: arrows of displacement, and translation, rotation and strain."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import legends
from mufe_fenicsx.report.figure import Drawing
from mufe_fenicsx.report.render import Camera, Layer, render
from mufe_fenicsx.report.views import FROM, colour_bar, three_in_a_row

#: So many grain diameters thick is the slab whose grains have arrows.
SLAB = 1.0


def displacement_parts(source):
    """Displacement of each grain from strain 0 to the last stored state, split by kind.

    The best rigid motion moves a place X of a grain by t + (R - 1)(X - X̄); what is left is the
    strain of the grain. The size of each part is its root mean square over the grain's volume.

    Returns:
        dict column -> shape (num_grains,), lengths in m.
    """
    motion, form = source.motion, source.inertia
    turn = motion.rotation - np.eye(3)
    # Second moment of the volume, S = ½ tr(I) 1 - I of the inertia tensor for unit density.
    second = 0.5 * np.trace(form.tensor, axis1=1, axis2=2)[:, None, None] * np.eye(3) - form.tensor
    swept = np.einsum("gij,gjk,gik->g", turn, second, turn)
    strain = motion.remaining_strain
    deviator = strain - np.trace(strain, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    return {
        "grain": motion.labels,
        **{f"centre {a} [m]": motion.centre[:, i] for i, a in enumerate("xyz")},
        **{f"translation {a} [m]": motion.translation[:, i] for i, a in enumerate("xyz")},
        "translation [m]": np.linalg.norm(motion.translation, axis=1),
        "by rotation [m]": np.sqrt(np.maximum(swept, 0) / form.mass),
        "by strain [m]": motion.misfit,
        "rotation [degrees]": np.degrees(motion.angle),
        "shear strain [-]": np.sqrt(2 / 3 * (deviator**2).sum(axis=(1, 2))),
    }


def mean_motion(centre, translation, weight):
    """The linear field a + A x that fits translations best, at the centres [m].

    Least squares with a weight for each grain.
    """
    middle = weight @ centre / weight.sum()
    basis = np.column_stack([np.ones(len(centre)), centre - middle])
    root = np.sqrt(weight)[:, None]
    fit = np.linalg.lstsq(root * basis, root * translation, rcond=None)[0]
    return basis @ fit


def draw_arrows(source):
    """Displacement of grains near the middle plane, and what a linear field leaves of it."""
    form, motion, end = source.inertia, source.motion, source.end
    centre, moved = motion.centre, motion.translation
    diameter = np.cbrt(6 * form.mass / np.pi)  # mass for unit density: volume
    box = end.box(source.start)
    away = np.abs(centre[:, 1] - 0.5 * (box[0, 1] + box[1, 1]))
    near = away <= 0.5 * SLAB * diameter.mean()
    if near.sum() < 3:
        near = np.ones(len(centre), dtype=bool)
    if len(centre) < 5:
        raise InputError(f"{len(centre)} grains, expected 5 or more for a mean motion")
    left_over = moved - mean_motion(centre, moved, form.mass)
    aspect = np.ptp(source.start.box(source.start)[:, 2]) / np.ptp(box[:, 0])
    figure, axes = style.new_figure(style.PAGE, 1.35 + 2.9 * aspect, ncols=2)
    top = source.start.box(source.start)[1, 2]
    # So that three of four arrows stay inside their grain, and all inside the frame.
    seen, at = left_over[near][:, [0, 2]], centre[near][:, [0, 2]]
    usual = np.percentile(np.linalg.norm(seen, axis=1), 75)
    corner = np.array([box[1, 0], top])
    room = np.where(seen > 0, corner - at, at - box[0, [0, 2]])
    moves = (seen != 0) & (room > 0)
    most = (room[moves] / np.abs(seen[moves])).min(initial=np.inf)
    goal = min(0.5 * diameter.mean() / usual if usual > 0 else 1.0, most)
    factors = (1.0, style.round_length(goal) if goal > 0 else 1.0)
    for i, (axis, field, factor) in enumerate(zip(axes, (moved, left_over), factors, strict=True)):
        drawn, length_unit = _arrows(axis, centre[near], field[near], diameter[near], factor, box)
        unit = _frame(axis, box, top)
        axis.set_ylabel(f"z: {unit}" if i == 0 else "")
        bar = figure.colorbar(
            ScalarMappable(drawn.norm, style.LENGTH_MAP),
            ax=axis,
            location="bottom",
            shrink=0.8,
            aspect=28,
            pad=0.02,
        )
        bar.set_label(f"{('displacement', 'non-affine part')[i]}: {length_unit}")
        bar.outline.set_linewidth(0.6)
        style.panel_letter(axis, i)
        length = "true length" if factor == 1 else f"{factor:g} times as long"
        axis.set_title(length, loc="right", fontsize=7.5)
    columns = {"grain": motion.labels, "drawn": near}
    for name, values in (("centre", centre), ("displacement", moved), ("deviation", left_over)):
        columns |= {f"{name} {a} [m]": values[:, i] for i, a in enumerate("xyz")}
    return Drawing(
        "displacement-arrows",
        figure,
        "Displacement of grains near the middle plane, seen along y: (a) total, (b) "
        f"non-affine part, from strain {source.start.strain:.3f} to {end.strain:.3f}",
        "An arrow starts at the grain's centre in the first of both states; circles have the "
        "grain's volume. Colour is the length in space. The affine field, fitted to all grains "
        "by least squares, is the motion of a continuum; (b) is what rearrangement adds to it.",
        {"": columns},
        "wide",
    )


def _arrows(axis, centre, field, diameter, factor, box):
    """Circles of grains and an arrow in each, seen along y.

    Args:
        axis: Where to draw.
        centre: Of the grains [m], shape (n, 3).
        field: What the arrows show [m], shape (n, 3).
        diameter: Of the grains [m], shape (n,).
        factor: Length of the arrows over the true one.
        box: Around the sample [m], shape (2, 3).

    Returns:
        The arrows, and the unit of their colours.
    """
    scale, _ = style.unit_of(np.ptp(box, axis=0), "m")
    size = np.linalg.norm(field, axis=1)
    symbol, unit = style.unit_of(size, "m")
    x = (centre[:, [0, 2]] - box[0, [0, 2]]) / scale
    circles = axis.add_collection(
        EllipseCollection(
            diameter / scale,
            diameter / scale,
            np.zeros(len(centre)),
            units="xy",
            offsets=x,
            offset_transform=axis.transData,
            facecolors="0.95",
            edgecolors="0.75",
            linewidths=0.5,
        )
    )
    arrows = factor * field[:, [0, 2]] / scale
    drawn = axis.quiver(
        *x.T,
        *arrows.T,
        size / symbol,
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.006,
        cmap=style.LENGTH_MAP,
        norm=Normalize(0, size.max() / symbol or 1.0),
    )
    for artist in (circles, drawn):
        artist.set_in_layout(False)  # what reaches out of the frame takes no room
    return drawn, unit


def _frame(axis, box, top):
    """Show the sides of the box and ``top``, its height at the start [m]; the unit of lengths."""
    scale, unit = style.unit_of(np.ptp(box, axis=0), "m")
    axis.spines[:].set(visible=True, color=style.GREY, linewidth=0.8)
    axis.set(
        xlim=(0, np.ptp(box[:, 0]) / scale),
        ylim=(0, (top - box[0, 2]) / scale),
        aspect="equal",
        xlabel=f"x: {unit}",
    )
    return unit


def draw_split(source):
    """Translation, rotation and strain of the grains: pictures, and how they are spread."""
    parts, end = displacement_parts(source), source.end
    shown = (
        ("translation [m]", "translation", "m", 1.0),
        ("rotation [degrees]", "rotation: °", "", 1.0),
        ("shear strain [-]", "shear strain: –", "", 1.0),
    )
    source.need_rendering()
    corners = end.corners(source.start)
    aspect, pixels, height = three_in_a_row(corners, 560)
    height += 0.6  # the colour bars lie below
    figure = style.blank_figure(style.PAGE, height + 2.4)
    upper, lower = figure.subfigures(2, 1, height_ratios=[height, 2.4])
    axes = upper.subplots(ncols=3)
    camera = Camera.around(corners, FROM, aspect)
    surface = end.surface()
    at = np.searchsorted(parts["grain"], surface.cell_data["grain"])
    for i, (axis, (name, label, symbol, factor)) in enumerate(zip(axes, shown, strict=True)):
        values = factor * parts[name]
        limit = style.round_limit(np.percentile(values, 98))
        surface.cell_data[name] = values[at]
        layer = Layer(surface, None, name, style.GRAIN_MAP, (0, limit))
        axis.imshow(render([layer], camera, pixels, end.outline(source.start)))
        axis.set_axis_off()
        style.panel_letter(axis, i)
        colour_bar(
            upper,
            [axis],
            limit,
            style.GRAIN_MAP,
            label,
            symbol,
            "max",
            location="bottom",
            shrink=0.85,
            pad=0.03,
            ticks=MaxNLocator(4),
        )
    style.scale_bar(axes[0], 2 * camera.half_height * aspect)
    left, right = lower.subplots(ncols=2, width_ratios=[2, 1])
    _draw_spread(left, parts)
    _draw_heights(right, parts, source.start.box(source.start))
    return Drawing(
        "displacement-split",
        figure,
        f"Motion of the grains from strain {source.start.strain:.3f} to {end.strain:.3f}: (a) "
        "translation, (b) rotation, (c) mean shear strain; (d) displacement by each, root "
        "mean square over a grain; (e) rotation over height",
        "The rigid motion is that of least squares over a grain's nodes (Kabsch); the rest is its "
        "strain. Two per cent of the grains may exceed a scale.",
        {"": parts},
        "wide",
        vector=False,
    )


def _draw_spread(axis, parts):
    """Cumulative shares of the grains over the size of each part of their displacement."""
    names = ("translation [m]", "by rotation [m]", "by strain [m]")
    factor, unit = style.unit_of(parts["translation [m]"], "m")
    for k, name in enumerate(names):
        values = np.sort(parts[name]) / factor
        share = np.arange(1, values.size + 1) / values.size
        positive = values > 0
        axis.plot(
            values[positive],
            100 * share[positive],
            style.LINES[k],
            color=style.SERIES[k],
            label=name.split(" [")[0],
            drawstyle="steps-post",
        )
    axis.set_xscale("log")
    top = axis.get_xlim()[1]
    axis.set_xlim(left=max(axis.get_xlim()[0], 1e-5 * top))
    axis.set(xlabel=f"Displacement of a grain: {unit}", ylabel="Grains with less: %", ylim=(0, 100))
    legends(axis, grow=False)
    style.panel_letter(axis, 3)


def _draw_heights(axis, parts, box):
    """Rotation over the height of a grain's centre in the box at the start."""
    height, top = parts["centre z [m]"] - box[0, 2], np.ptp(box[:, 2])
    factor, unit = style.unit_of([top], "m")
    axis.plot(parts["rotation [degrees]"], height / factor, ".", markersize=3)
    axis.set(xlabel="Rotation: °", ylabel=f"z: {unit}", xlim=(0, None), ylim=(0, top / factor))
    style.panel_letter(axis, 4)
