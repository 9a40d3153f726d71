"""Pictures to judge a segmentation and meshes by eye."""

import matplotlib
import networkx
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from .compare_labels import touching_labels
from .threshold import NUM_BINS, candidates

STYLE = {
    "font.size": 9,
    "font.family": "sans-serif",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "savefig.dpi": 200,
}
BLUE, RED, CYAN = "#33658a", "#e4572e", "#00b7c7"
#: Colours of grains, RGB: those that the colour-blind tell apart (Okabe & Ito 2008), and brown.
PALETTE = tuple(
    matplotlib.colors.to_rgb(colour)
    for colour in (
        "#56b4e9", "#e69f00", "#009e73", "#f0e442", "#cc79a7", "#d55e00", "#0072b2", "#8c6d4f"
    )
)  # fmt: skip


def draw_segmentation(path, grey, labels, voxel_size, inside=None, cylinder=None):
    """Three slices through the middle, grey levels with outlines above, labels below.

    Args:
        path: PNG file.
        grey: Grey image on the voxels of the labels, (z, y, x).
        labels: 0 void, grains from 1.
        voxel_size: [m].
        inside: True in the field of view; the rest is left white. None: all of the image.
        cylinder: `Cylinder` of the sample [m], which is drawn; or None.
    """
    with matplotlib.rc_context(STYLE):
        unit, name = length_unit(max(labels.shape) * voxel_size)
        size = voxel_size / unit
        middle = [n // 2 for n in labels.shape]
        planes = (
            ("x", "y", np.s_[middle[0], :, :]),
            ("x", "z", np.s_[:, middle[1], :]),
            ("y", "z", np.s_[:, :, middle[2]]),
        )
        figure = Figure(figsize=(9.6, 6.6), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(2, 3)
        ours = inside
        if cylinder is not None:
            ours = cylinder.scaled(1 / voxel_size).inside(labels.shape)
        low, high = np.percentile(grey if ours is None else grey[ours], [0.5, 99.5])
        pairs = set().union(*(touching_labels(labels[where][None]) for _, _, where in planes))
        colours = label_colours(int(labels.max()), pairs)
        for column, (across, up, where) in enumerate(planes):
            part, part_labels = grey[where], labels[where]
            if inside is not None:
                part = np.ma.masked_where(~inside[where], part)
            extent = (0, part.shape[1] * size, 0, part.shape[0] * size)
            shown = {"extent": extent, "origin": "lower", "interpolation": "nearest"}
            top, bottom = axes[:, column]
            top.imshow(part, cmap="gray", vmin=low, vmax=high, **shown)
            lines = outlines(part_labels) * size
            top.add_collection(LineCollection(lines, colors=RED, linewidths=0.9))
            bottom.imshow(colours[part_labels], **shown)
            for axis in (top, bottom):
                axis.set(xlabel=f"{across}: {name}", ylabel=f"{up}: {name}")
                axis.spines[:].set_visible(True)
            normal = "xyz".replace(across, "").replace(up, "")
            position = (middle["zyx".index(normal)] + 0.5) * size
            if cylinder is not None:
                for axis, colour in ((top, CYAN), (bottom, "black")):
                    _draw_cylinder(axis, across + up, cylinder.scaled(1 / unit), position, colour)
                # The image shows where the cylinder is; its labels fill their panel.
                _frame(bottom, across + up, cylinder.scaled(1 / unit))
            top.set_title(f"{normal} = {position:.3g} {name}", fontsize=9)
        figure.savefig(path)


def draw_refusal(path, refusal):
    """The histogram of an image whose threshold was refused, and its middle slice along z.

    Args:
        path: PNG file.
        refusal: `threshold.NoThreshold`.
    """
    grey, inside = refusal.image, refusal.inside
    values = grey.ravel() if inside is None else grey[inside]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 4.2), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2)
        left.stairs(*np.histogram(values, NUM_BINS), fill=True, color=BLUE)
        levels = candidates(values)
        levels |= {} if refusal.level is None else {"given": refusal.level}
        for (name, level), style in zip(levels.items(), ("-", "--", ":", "-."), strict=False):
            left.axvline(level, color=RED, linestyle=style, label=f'"{name}": {level:.6g}')
        left.set(xlabel="grey level", ylabel="voxels [-]", yscale="log")
        left.legend(frameon=False) if levels else left.set_title("no method finds a threshold")
        middle = len(grey) // 2
        low, high = np.percentile(values, [0.5, 99.5])
        right.imshow(grey[middle], cmap="gray", vmin=low, vmax=high, origin="lower")
        right.set(xlabel="x [voxels]", ylabel="y [voxels]", title=f"z = {middle} voxels")
        figure.savefig(path)


def _draw_cylinder(axis, plane, cylinder, position, colour):
    """The outline of a cylinder in a slice of a plane ("xy", "xz" or "yz") at a position."""
    style = {"color": colour, "linewidth": 1.1, "linestyle": (0, (4, 2))}
    if plane == "xy":
        place = (cylinder.x, cylinder.y)
        axis.add_patch(Circle(place, cylinder.radius, fill=False, **style))
        return
    across, beside = (cylinder.x, cylinder.y) if plane == "xz" else (cylinder.y, cylinder.x)
    half = cylinder.radius**2 - (position - beside) ** 2
    for sign in (-1, 1) if half > 0 else ():
        axis.axvline(across + sign * half**0.5, **style)


def _frame(axis, plane, cylinder):
    """Limit a slice of a plane ("xy", "xz" or "yz") to the surroundings of a cylinder."""
    reach, across = 1.08 * cylinder.radius, cylinder.y if plane == "yz" else cylinder.x
    axis.set_xlim(across - reach, across + reach)
    if plane == "xy":
        axis.set_ylim(cylinder.y - reach, cylinder.y + reach)


def draw_quality(path, rows, h):
    """Histograms of the quality table of meshes.

    Args:
        path: PNG file.
        rows: Rows of the quality table.
        h: Wanted length of edges [m].
    """
    rows = [row for row in rows if row["status"] == "ok"]
    unit, name = length_unit(h)
    panels = (
        ("tets", "tetrahedra per grain: –"),
        ("volume_ratio", "mesh volume off that given: %"),
        ("min_altitude_over_h", "smallest altitude / $h$: –"),
        ("min_dihedral_deg", "smallest dihedral angle [°]"),
    )
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 5.0), layout="constrained")
        FigureCanvasAgg(figure)
        for axis, (column, label) in zip(figure.subplots(2, 2).ravel(), panels, strict=True):
            values = np.array([row[column] for row in rows], dtype=float)
            least = 1e-3 * abs(values.mean())
            if column == "volume_ratio":
                values, least = np.round(100 * (values - 1), 4), 0.01
            # Grains that all agree to round-off still get a bar of some width.
            spread = max(np.ptp(values), least)
            middle = (values.min() + values.max()) / 2
            # Round-off must not leave out the least or the largest value.
            low = min(values.min(), middle - spread / 2)
            high = max(values.max(), middle + spread / 2)
            axis.hist(
                values,
                bins=min(30, max(8, len(values) // 5)),
                range=(low, high),
                color=BLUE,
                edgecolor="white",
                linewidth=0.4,
            )
            axis.axvline(values.mean(), color=RED, linewidth=1.2)
            axis.set(xlabel=label, ylabel="grains: –")
            axis.xaxis.get_major_locator().set_params(nbins=5)
            axis.yaxis.get_major_locator().set_params(integer=True)
            low, mean, high = (
                f"{v:,.0f}" if v >= 100 else f"{v:.3g}"
                for v in (values.min(), values.mean(), values.max())
            )
            axis.set_title(f"min {low}, mean {mean} (line), max {high}", fontsize=8, loc="left")
        title = f"{len(rows)} grains, wanted edge length $h$ = {h / unit:.3g} {name}"
        figure.suptitle(title, fontsize=10)
        figure.savefig(path)


def length_unit(length):
    """A unit in which a length [m] is a handy number, and its name."""
    for unit, name in ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm")):
        if length >= unit:
            return unit, name
    return 1e-9, "nm"


def outlines(labels):
    """Edges between pixels of different labels, as segments (n, 2, 2) of (x, y) in pixels."""
    y, x = np.nonzero(labels[1:] != labels[:-1])
    level = np.stack([np.stack([x, y + 1], axis=1), np.stack([x + 1, y + 1], axis=1)], axis=1)
    y, x = np.nonzero(labels[:, 1:] != labels[:, :-1])
    upright = np.stack([np.stack([x + 1, y], axis=1), np.stack([x + 1, y + 1], axis=1)], axis=1)
    return np.concatenate([level, upright]).astype(float)


def label_colours(num_labels, pairs):
    """RGB a label, shape (num_labels + 1, 3): void white, labels that touch in other colours.

    Args:
        num_labels: The largest label.
        pairs: Of labels that touch.
    """
    colour_of = networkx.greedy_color(networkx.Graph(list(pairs)))
    # Those without neighbours take turns, so that all colours are used.
    number = np.arange(-1, num_labels) % len(PALETTE)
    number[list(colour_of)] = list(colour_of.values())
    palette = np.array(PALETTE)
    more = number.max(initial=0) + 1 - len(PALETTE)
    if more > 0:  # beyond the palette greys, from dark to light
        palette = np.concatenate([palette, np.linspace(0.25, 0.75, more)[:, None].repeat(3, 1)])
    colours = palette[number]
    colours[0] = 1
    return colours
