"""Figures of the whole sample: stress in space and in a cut."""

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.curves import PAPER
from mufe_fenicsx.report.figure import Drawing
from mufe_fenicsx.report.render import Camera, Layer, render
from mufe_fenicsx.report.tools import tool_surfaces

FROM = (1.0, -1.35, 0.75)  #: the corner that the sample is seen from
EDGE = 30.0  #: angle of edges of tools that are drawn [degrees]
VON_MISES = "von Mises stress"
#: Of a figure with its colour bar and the label of that [inch].
LEAST_HEIGHT = 1.9


def stress_limit(states):
    """Upper end of the one colour scale: 99 % of each state's cells are below it [Pa]."""
    return style.round_limit(max(np.percentile(s.von_mises, 99) for s in states))


def three_in_a_row(corners, width=640):
    """How to draw three pictures of a sample beside each other without much white.

    Args:
        corners: What has to be seen [m], shape (num_corners, 3).
        width: Of a picture [pixels].

    Returns:
        Width over height of a picture, its size [pixels], height of the figure [inch].
    """
    right = np.cross((0, 0, 1), FROM) / np.linalg.norm(FROM[:2])
    up = np.cross(FROM, right) / np.linalg.norm(FROM)
    aspect = float(np.clip(np.ptp(corners @ right) / np.ptp(corners @ up), 0.4, 2.5))
    # The colour bar takes a tenth of the page, the letters a line.
    height = max(0.3 * style.PAGE / aspect + 0.45, LEAST_HEIGHT)
    return aspect, (width, round(width / aspect)), height


def draw_stress_3d(source):
    """Deformed samples side by side, one camera and one colour scale for all."""
    states = source.states
    source.need_rendering()
    limit = stress_limit(states)
    corners = np.concatenate([state.corners(states[0]) for state in states])
    aspect, pixels, height = three_in_a_row(corners)
    camera = Camera.around(corners, FROM, aspect)
    figure, axes = style.new_figure(style.PAGE, height, ncols=len(states), squeeze=False)
    axes, columns = axes[0], {"grain": states[0].grain_means[0]}
    for i, (axis, state) in enumerate(zip(axes, states, strict=True)):
        layer = Layer(state.surface(), None, "von_mises", style.STRESS_MAP, (0, limit))
        axis.imshow(render([layer], camera, pixels, _lines(source, state)))
        axis.set_axis_off()
        style.panel_letter(axis, i)
        style.heading(axis, rf"$\varepsilon$ = {style.strain(state.strain)}")
        columns[f"mean von Mises stress at strain {state.strain:.6g} [Pa]"] = state.grain_means[1]
    style.scale_bar(axes[0], 2 * camera.half_height * aspect)
    colour_bar(figure, axes, limit, style.STRESS_MAP, VON_MISES, "Pa", "max")
    strains = ", ".join(f"{state.strain:.3f}" for state in states)
    return Drawing(
        "stress-3d",
        figure,
        f"Von Mises stress in the deformed grains at strain {strains} (Fig. 13 {PAPER})",
        "All views share the colour scale and the camera (parallel projection; the scale "
        f"bar holds for lengths across the view). Lines show {_space(source)}, and "
        "sharp edges of tools. Where a grain's volume has fallen to the part J, σ may exceed the "
        "yield stress, which limits Jσ. "
        "One per cent of the cells of a state may exceed the scale.",
        {"": columns},
        "wide",
        vector=False,
    )


def _lines(source, state):
    """Lines of the walls and sharp edges of the tools, pyvista.PolyData."""
    lines, tools = state.outline(source.start), tool_surfaces(source.folder, state.index)
    if tools is None:
        return lines
    return lines + tools.extract_feature_edges(EDGE, boundary_edges=False)


def _space(source):
    """What the lines around the grains are, in words."""
    if "cell_pressure" in (source.get("history") or {}):
        return "a cylinder of the sample's volume: the membrane itself is not drawn"
    return "the space between the walls"


def draw_cut(source):
    """Von Mises stress in the vertical plane through the most loaded grain, grains outlined."""
    end, box = source.end, source.end.box(source.start)
    across, normal = 0, (0, 1, 0)
    middle = box.mean(axis=0)
    y = end.points[:, 1][end.cells]
    middle[1], through = _most_loaded(end, middle[1])
    crossed = (y.min(axis=1) <= middle[1]) & (y.max(axis=1) >= middle[1])
    if not crossed.any():
        raise InputError(f"no grain reaches the plane through {through}")
    cut = end.grid(crossed, von_mises=end.von_mises, grain=end.grain)
    cut = cut.slice(normal=normal, origin=middle)
    outline = end.surface().slice(normal=normal, origin=middle)
    scale, unit = style.unit_of(np.ptp(box, axis=0), "m")
    limit = style.round_limit(np.percentile(end.von_mises, 99))
    tools = tool_surfaces(source.folder, end.index)

    def plane(points):
        return (np.asarray(points)[:, [across, 2]] - box[0, [across, 2]]) / scale

    size = np.ptp(box, axis=0)
    width = 1.3 * style.COLUMN
    # The colour bar has room for its label beside a flat sample too.
    height = max(0.5 + (width - 1.3) * size[2] / size[across], LEAST_HEIGHT)
    figure, axis = style.new_figure(width, height)
    faces = polygons(cut.faces)
    values = np.asarray(cut.cell_data["von_mises"])
    axis.add_collection(cut_collection([plane(cut.points[f]) for f in faces], values, limit))
    add_outline(axis, [plane(outline.points[line]) for line in polygons(outline.lines)])
    if tools is not None:
        edge = tools.slice(normal=normal, origin=middle)
        lines = [plane(edge.points[line]) for line in polygons(edge.lines)]
        axis.add_collection(LineCollection(lines, colors=style.ORANGE, linewidths=1.2))
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
    colour_bar(figure, [axis], limit, style.STRESS_MAP, VON_MISES, "Pa", "max")
    centres = np.array([np.asarray(cut.points[f]).mean(axis=0) for f in faces]).reshape(-1, 3)
    return Drawing(
        "stress-cut",
        figure,
        f"Von Mises stress in the vertical plane through {through}, strain {end.strain:.3f}",
        f"Black lines are the surfaces of grains, the grey frame is {_space(source)}. "
        f"{'Orange lines are the tools. ' if tools is not None else ''}Force chains "
        "appear as bands of high stress from contact to contact. A stress that jumps between "
        "neighbouring tetrahedra shows that the mesh is too coarse there.",
        {
            "": {
                "grain": cut.cell_data["grain"],
                **{f"{a} [m]": centres[:, i] for i, a in enumerate("xyz")},
                "von Mises stress [Pa]": values,
            }
        },
    )


def _most_loaded(state, middle):
    """Where along y the grain lies that carries most [m], in words too; else the middle."""
    label, mean = state.most_loaded_grain()
    if not mean > 0:
        return middle, "the middle"
    own = state.grain == label
    y = state.points[:, 1][state.cells[own]].mean(axis=1)
    return state.volume[own] @ y / state.volume[own].sum(), f"grain {label}, the most loaded"


def cut_collection(shapes, values, limit, colours=style.STRESS_MAP):
    """Coloured polygons of a cut, as a picture inside a vector file."""
    return PolyCollection(
        shapes,
        array=values,
        linewidths=0.05,
        cmap=colours,
        norm=Normalize(0, limit),
        edgecolors="face",
        rasterized=True,
        antialiased=False,
        clip_on=False,
    )


def add_outline(axis, segments):
    """Surfaces of grains in a cut, black lines."""
    axis.add_collection(LineCollection(segments, colors=style.BLACK, linewidths=0.6, clip_on=False))


def colour_bar(figure, axes, limit, colours, label, symbol, extend="neither", **options):
    """A colour bar from 0 to a limit beside axes; units with a prefix where it has a symbol."""
    factor, unit = 1.0, ""
    if symbol:
        factor, unit = style.unit_of([limit], symbol)
        if symbol == "Pa" and limit >= 0.1e6:
            factor, unit = 1e6, "MPa"
    bar = figure.colorbar(
        ScalarMappable(Normalize(0, limit / factor), colours),
        ax=axes,
        **({"shrink": 0.8, "aspect": 22, "pad": 0.02, "extend": extend} | options),
    )
    bar.set_label(f"{label}: {unit}" if symbol else label)
    bar.outline.set_linewidth(0.6)
    return bar


def polygons(flat):
    """Node numbers of polygons or lines that are stored as n, i₁ to iₙ, n and so on."""
    flat = np.asarray(flat)
    found, at = [], 0
    while at < flat.size:
        found.append(flat[at + 1 : at + 1 + flat[at]])
        at += 1 + flat[at]
    return found
