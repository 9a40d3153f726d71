"""Pictures to judge a segmentation and meshes by eye."""

import matplotlib
import networkx
import numpy as np
import scipy.ndimage
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
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
#: Line of the cylinder of a sample.
DASHED = {"linewidth": 1.1, "linestyle": (0, (4, 2))}
#: Colours of grains, RGB: those that the colour-blind tell apart (Okabe & Ito 2008), and brown.
PALETTE = tuple(
    matplotlib.colors.to_rgb(colour)
    for colour in (
        "#56b4e9", "#e69f00", "#009e73", "#f0e442", "#cc79a7", "#0072b2", "#8c6d4f", "#d55e00"
    )
)  # fmt: skip


def draw_segmentation(path, grey, labels, voxel_size, inside=None, cylinder=None, contacts=()):
    """Six slices, two across each axis: grey levels with outlines, and below each its labels.

    They are at a third and at two thirds of the image, or of its cylinder. Both panels of a slice
    show the same part of it. Necks that are doubted are drawn thick. A legend says what is what.

    Args:
        path: PNG file.
        grey: Grey image on the voxels of the labels, (z, y, x).
        labels: 0 void, grains from 1.
        voxel_size: [m].
        inside: True in the field of view; the rest is left white. None: all of the image.
        cylinder: `Cylinder` of the sample [m], which is drawn; or None.
        contacts: Rows of `quality_flags.mark_doubts`: label_a, label_b, doubt.
    """
    with matplotlib.rc_context(STYLE):
        unit, name = length_unit(max(labels.shape) * voxel_size)
        size, ours = voxel_size / unit, inside
        doubted = [(row["label_a"], row["label_b"]) for row in contacts if row["doubt"]]
        spans = np.array([[0, n] for n in labels.shape])
        if cylinder is not None:
            round_part, cylinder = cylinder.scaled(1 / voxel_size), cylinder.scaled(1 / unit)
            ours = round_part.inside(labels.shape)
            reach = 1.08 * round_part.radius
            for axis, middle in ((1, round_part.y), (2, round_part.x)):
                spans[axis] = np.clip([middle - reach, middle + reach], 0, labels.shape[axis])
        low, high = np.percentile(grey if ours is None else grey[ours], [0.5, 99.5])
        slices = [
            (axis, int(first + part * (last - first) / 3))
            for part in (1, 2)
            for axis, (first, last) in enumerate(spans)
        ]
        cuts = [labels.take(place, axis) for axis, place in slices]
        pairs = set().union(*(neighbours(cut) for cut in cuts))
        colours = label_colours(int(labels.max()), pairs)
        z, y, x = np.ptp(spans, axis=1)
        height = 8.4 * 4 * max(y, z) / (2 * x + y) + 2.4
        figure = Figure(figsize=(9.6, min(16.0, height)), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(4, 3, gridspec_kw={"width_ratios": (x, x, y)})
        for number, ((normal, place), cut) in enumerate(zip(slices, cuts, strict=True)):
            up, across = (axis for axis in range(3) if axis != normal)
            part = grey.take(place, normal)
            if inside is not None:
                part = np.ma.masked_where(~inside.take(place, normal), part)
            extent = (0, part.shape[1] * size, 0, part.shape[0] * size)
            shown = {"extent": extent, "origin": "lower", "interpolation": "nearest"}
            row, column = divmod(number, 3)
            top, bottom = panels[2 * row : 2 * row + 2, column]
            top.imshow(part, cmap="gray", vmin=low, vmax=high, **shown)
            lines = outlines(cut) * size
            top.add_collection(LineCollection(lines, colors=RED, linewidths=0.6))
            bottom.imshow(colours[cut], **shown)
            necks, position = outlines(cut, doubted) * size, (place + 0.5) * size
            for axis, colour in ((top, CYAN), (bottom, "black")):
                axis.add_collection(LineCollection(necks, colors=colour, linewidths=2.0))
                if cylinder is not None:
                    _draw_cylinder(axis, "zyx"[across] + "zyx"[up], cylinder, position, colour)
                axis.set(xlim=spans[across] * size, ylim=spans[up] * size)
                axis.set(xlabel=f"{'zyx'[across]}: {name}", ylabel=f"{'zyx'[up]}: {name}")
                axis.spines[:].set_visible(True)
            top.set_title(f"{'zyx'[normal]} = {position:.3g} {name}", fontsize=9)
        figure.suptitle(f"{len(np.unique(labels[labels > 0]))} grains", fontsize=9)
        _add_legend(figure, len(doubted), cylinder is not None)
        figure.savefig(path)


def _add_legend(figure, num_doubted, is_round):
    """What outlines and colours of a segmentation mean, below its slices."""
    marks = [
        (RED, "above: outlines of the grains found", {"linewidth": 0.6}),
        (PALETTE[0], "below: a colour a grain; which one means nothing", {"linewidth": 6.0}),
    ]
    if num_doubted:
        text = f"necks in doubt, black below: {num_doubted}, listed with the contacts"
        marks.append((CYAN, text, {"linewidth": 2.0}))
    if is_round:
        marks.append((CYAN, "side of the cylinder, black below", DASHED))
    handles = [Line2D([], [], color=colour, label=text, **look) for colour, text, look in marks]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)


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
        left.set(xlabel="grey level: –", ylabel="voxels: –", yscale="log")
        left.legend(frameon=False) if levels else left.set_title("no method finds a threshold")
        middle = len(grey) // 2
        low, high = np.percentile(values, [0.5, 99.5])
        right.imshow(grey[middle], cmap="gray", vmin=low, vmax=high, origin="lower")
        right.set(xlabel="x: voxels", ylabel="y: voxels", title=f"z = {middle} voxels")
        figure.savefig(path)


def _draw_cylinder(axis, plane, cylinder, position, colour):
    """The outline of a cylinder in a slice of a plane ("xy", "xz" or "yz") at a position."""
    style = {"color": colour, **DASHED}
    if plane == "xy":
        place = (cylinder.x, cylinder.y)
        axis.add_patch(Circle(place, cylinder.radius, fill=False, **style))
        return
    across, beside = (cylinder.x, cylinder.y) if plane == "xz" else (cylinder.y, cylinder.x)
    half = cylinder.radius**2 - (position - beside) ** 2
    for sign in (-1, 1) if half > 0 else ():
        axis.axvline(across + sign * half**0.5, **style)


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
        ("min_dihedral_deg", "smallest dihedral angle: °"),
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


def outlines(labels, pairs=None):
    """Edges between pixels of different labels, as segments (n, 2, 2) of (x, y) in pixels.

    Args:
        labels: Of a slice.
        pairs: Of labels; only edges between these. None: all.
    """
    found, base = [], int(labels.max(initial=0)) + 1
    for ahead, steps in ((labels, (1, 0)), (labels.T, (0, 1))):
        below, above = (part.astype(np.int64) for part in (ahead[:-1], ahead[1:]))
        meet = below != above
        if pairs is not None:
            wanted = [min(pair) * base + max(pair) for pair in pairs]
            meet &= np.isin(np.minimum(below, above) * base + np.maximum(below, above), wanted)
        along, across = np.nonzero(meet)
        x, y = (across, along + 1) if steps == (1, 0) else (along + 1, across)
        ends = [np.stack([x, y], axis=1), np.stack([x, y], axis=1) + steps]
        found.append(np.stack(ends, axis=1))
    return np.concatenate(found).astype(float)


def neighbours(labels):
    """Pairs of grains of a slice that touch, or that only void parts: a set of (a, b), a < b."""
    nearest = scipy.ndimage.distance_transform_edt(
        labels == 0, return_distances=False, return_indices=True
    )
    return touching_labels(labels[tuple(nearest)][None])


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
