"""Figures 6 to 8: stress in 3D, a cut, contact pressure on one grain."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap, Normalize

from mufe_fenicsx.report import style
from mufe_fenicsx.report.render import Camera, render

FROM = (1.0, -1.35, 0.75)  #: the corner that the sample is seen from
VON_MISES = "von Mises stress"


def stress_limit(states):
    """Upper end of the one colour scale: 99 % of each state's cells are below it [Pa]."""
    return style.round_limit(max(np.percentile(s.von_mises, 99) for s in states))


def draw_stress_3d(states):
    """Deformed samples side by side, one camera and one colour scale for all."""
    limit = stress_limit(states)
    boxes = [state.box(states[0]) for state in states]
    corners = np.concatenate(boxes)
    corners = np.array(
        [[x, y, z] for x in corners[:, 0] for y in corners[:, 1] for z in corners[:, 2]]
    )
    aspect = 0.92
    camera = Camera.around(corners, FROM, aspect)
    width = 2 * camera.half_height * aspect
    pixels = (int(1000 * aspect), 1000)

    figure, axes = style.new_figure(style.PAGE, 2.75, ncols=len(states), squeeze=False)
    axes = axes[0]
    for i, (axis, state, box) in enumerate(zip(axes, states, boxes, strict=True)):
        image = render(
            state.surface(), "von_mises", style.STRESS_MAP, (0, limit), camera, pixels, box=box
        )
        axis.imshow(image)
        axis.set_axis_off()
        style.panel_letter(axis, i)
        axis.text(
            0.5,
            1.02,
            rf"$\varepsilon$ = {state.strain:.3f}",
            transform=axis.transAxes,
            ha="center",
            va="bottom",
            fontsize=8,
        )
        if i == 0:
            style.scale_bar(axis, width)
    _colour_bar(figure, axes, limit, style.STRESS_MAP, VON_MISES)
    return figure


def draw_cut(start, end):
    """Von Mises stress in the vertical plane through the middle of the sample, grains outlined."""
    box = end.box(start)
    across = 0
    middle = box.mean(axis=0)
    axis_normal = (0, 1, 0)
    cut = end.grid().slice(normal=axis_normal, origin=middle)
    outline = end.surface().slice(normal=axis_normal, origin=middle)
    scale, unit = style.unit_of(np.ptp(box, axis=0), "m")
    limit = style.round_limit(np.percentile(end.von_mises, 99))

    def plane(points):
        return (np.asarray(points)[:, [across, 2]] - box[0, [across, 2]]) / scale

    size = np.ptp(box, axis=0)
    width = 4.4
    figure, axis = style.new_figure(width, 0.5 + (width - 1.3) * size[2] / size[across])
    polygons = [plane(cut.points[face]) for face in _faces(cut.faces)]
    axis.add_collection(
        PolyCollection(
            polygons,
            array=np.asarray(cut.cell_data["von_mises"]),
            linewidths=0.05,
            cmap=style.STRESS_MAP,
            norm=Normalize(0, limit),
            edgecolors="face",
            rasterized=True,
            antialiased=False,
            clip_on=False,
        )
    )
    segments = [plane(outline.points[line]) for line in _faces(outline.lines)]
    axis.add_collection(LineCollection(segments, colors=style.BLACK, linewidths=0.6, clip_on=False))
    # The frame of the axes is the walls.
    axis.spines[:].set(visible=True, color=style.GREY, linewidth=0.8)
    axis.tick_params(direction="out")
    axis.set(
        xlim=(0, size[across] / scale),
        ylim=(0, size[2] / scale),
        aspect="equal",
        xlabel=f"{'xyz'[across]}: {unit}",
        ylabel=f"z: {unit}",
    )
    _colour_bar(figure, [axis], limit, style.STRESS_MAP, VON_MISES)
    return figure


def draw_contact_pressure(state, grain):
    """Contact pressure on the surface of one grain, seen from two opposite sides."""
    surface = state.surface(grain)
    pressure = np.asarray(surface.point_data["contact_pressure"])
    limit = style.round_limit(pressure.max())
    # Look at the place of the largest pressure; straight from above has no upward direction.
    towards = surface.points[np.argmax(pressure)] - surface.points.mean(axis=0)
    towards /= np.linalg.norm(towards)
    up = (0, 0, 1) if abs(towards[2]) < 0.95 else (0, 1, 0)
    points = np.asarray(surface.points)
    cameras = [Camera.around(points, sign * towards, 1.0, up, 1.15) for sign in (1, -1)]
    half = max(camera.half_height for camera in cameras)

    colours = _void_grey(style.PRESSURE_MAP)
    figure, axes = style.new_figure(0.8 * style.PAGE, 2.7, ncols=2)
    for i, (axis, camera) in enumerate(zip(axes, cameras, strict=True)):
        camera = Camera(camera.focus, camera.direction, camera.up, half)
        axis.imshow(
            render(surface, "contact_pressure", colours, (0, limit), camera, (900, 900), edges=True)
        )
        axis.set_axis_off()
        style.panel_letter(axis, i)
        axis.text(
            0.5,
            1.02,
            f"seen from {_direction(camera.direction)}",
            transform=axis.transAxes,
            ha="center",
            va="bottom",
            fontsize=8,
        )
    style.scale_bar(axes[0], 2 * half)
    _colour_bar(figure, axes, limit, colours, "Contact pressure", extend="neither")
    return figure


def _void_grey(name, num_colours=256):
    """A colour map whose lowest step, no contact, is light grey."""
    import matplotlib

    colours = matplotlib.colormaps[name](np.linspace(0, 1, num_colours))
    colours[:2] = (0.86, 0.86, 0.86, 1)
    return ListedColormap(colours)


def _direction(vector):
    """A direction in words: "+z", or its components."""
    along = int(np.argmax(np.abs(vector)))
    if abs(vector[along]) > 0.995:
        return ("−" if vector[along] < 0 else "+") + "xyz"[along]
    return "(" + ", ".join(f"{c:.2f}".replace("-", "−") for c in vector) + ")"


def _colour_bar(figure, axes, limit, colours, label, extend="max"):
    factor, unit = (1e6, "MPa") if limit >= 0.1e6 else style.unit_of([limit], "Pa")
    bar = figure.colorbar(
        ScalarMappable(Normalize(0, limit / factor), colours),
        ax=axes,
        shrink=0.8,
        aspect=22,
        pad=0.02,
        extend=extend,
    )
    bar.set_label(f"{label}: {unit}")
    bar.outline.set_linewidth(0.6)


def _faces(flat):
    """Node numbers of polygons or lines stored as n, i₁ … iₙ, n, …"""
    flat = np.asarray(flat)
    polygons, at = [], 0
    while at < flat.size:
        polygons.append(flat[at + 1 : at + 1 + flat[at]])
        at += 1 + flat[at]
    return polygons
