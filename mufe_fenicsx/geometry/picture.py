"""Pictures to judge a segmentation and meshes by eye."""

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

STYLE = {
    "font.size": 9,
    "font.family": "sans-serif",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "savefig.dpi": 200,
}
BLUE, RED = "#33658a", "#e4572e"


def draw_segmentation(path, grey, labels, voxel_size, inside=None):
    """Three slices through the middle, grey levels with outlines above, labels below.

    Args:
        path: PNG file.
        grey: Grey image on the voxels of the labels, (z, y, x).
        labels: 0 void, grains from 1.
        voxel_size: [m].
        inside: True in the field of view; the rest is left white. None: all of the image.
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
        low, high = np.percentile(grey if inside is None else grey[inside], [0.5, 99.5])
        colours = label_colours(int(labels.max()))
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
                axis.set(xlabel=f"{across} [{name}]", ylabel=f"{up} [{name}]")
                axis.spines[:].set_visible(True)
            position = (middle["zyx".index("xyz".replace(across, "").replace(up, ""))] + 0.5) * size
            normal = "xyz".replace(across, "").replace(up, "")
            top.set_title(f"{normal} = {position:.3g} {name}", fontsize=9)
        figure.savefig(path)


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
        ("tets", "tetrahedra per grain [-]"),
        ("volume_ratio", "mesh volume / voxel volume [-]"),
        ("min_altitude_over_h", "smallest altitude / $h$ [-]"),
        ("min_dihedral_deg", "smallest dihedral angle [°]"),
    )
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 5.0), layout="constrained")
        FigureCanvasAgg(figure)
        for axis, (column, label) in zip(figure.subplots(2, 2).ravel(), panels, strict=True):
            values = np.array([row[column] for row in rows], dtype=float)
            # Grains that all agree to round-off still get a bar of some width.
            spread = max(np.ptp(values), 1e-3 * abs(values.mean()))
            middle = (values.min() + values.max()) / 2
            axis.hist(
                values,
                bins=min(30, max(8, len(values) // 5)),
                range=(middle - spread / 2, middle + spread / 2),
                color=BLUE,
                edgecolor="white",
                linewidth=0.4,
            )
            axis.axvline(values.mean(), color=RED, linewidth=1.2)
            axis.set(xlabel=label, ylabel="grains [-]")
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


def label_colours(num_labels):
    """RGB a label: void white, grains in different pale colours, the same in every run."""
    rng = np.random.default_rng(1)
    hue = rng.permutation(num_labels + 1) / (num_labels + 1)
    hsv = np.column_stack(
        [hue, 0.35 + 0.4 * rng.random(num_labels + 1), np.full(num_labels + 1, 0.85)]
    )
    colours = matplotlib.colors.hsv_to_rgb(hsv)
    colours[0] = 1
    return colours
