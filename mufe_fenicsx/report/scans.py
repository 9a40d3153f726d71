"""Figures and page of a run beside scans of the same sample."""

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Circle

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.machine.files import own_folder, reason
from mufe_fenicsx.report import style
from mufe_fenicsx.report.figure import Drawing, save, write_index
from mufe_fenicsx.report.page import write_page
from mufe_fenicsx.report.write import FOOTER
from mufe_fenicsx.results.columns import vectors

#: Half thickness of the slab whose grains the maps show [median diameters].
SLAB = 0.5
#: Rows of the page's table: key, words, unit, significant digits.
ROWS = (
    ("strain", "Strain of the run", "", 4),
    ("shortening", "Shortening of the grains along z in the scan", "", 4),
    ("run_shortening", "Shortening of the same grains in the run", "", 4),
    ("num_grains", "Grains of the run", "", 6),
    ("num_on_labels", "Grains of the run that lie on labels", "", 6),
    ("num_tracked", "Grains compared", "", 6),
    ("num_lost_in_scan", "Grains of the first scan that are lost", "", 6),
    ("mean_displacement", "Displacement in the scan, mean", "m", 3),
    ("mean_displacement_difference", "Difference of displacement, mean", "m", 3),
    ("rms_displacement_difference", "Difference of displacement, root mean square", "m", 3),
    ("mean_difference_voxels", "Difference of displacement, mean in voxels", "", 3),
    ("common_shift_x", "Motion of all grains beyond that of the run, x", "m", 3),
    ("common_shift_y", "Motion of all grains beyond that of the run, y", "m", 3),
    ("common_shift_z", "Motion of all grains beyond that of the run, z", "m", 3),
    ("num_rotations", "Grains whose rotation the scan tells", "", 6),
    ("mean_rotation_difference", "Angle between rotations, mean", "°", 3),
    ("rms_rotation_difference", "Angle between rotations, root mean square", "°", 3),
    ("mean_strain_zz", "Vertical strain around grains in the scan, mean", "", 3),
    ("mean_run_strain_zz", "Vertical strain around grains in the run, mean", "", 3),
    ("correlation_strain_zz", "Correlation of both over the grains", "", 3),
    ("mean_strain_deviator", "Deviatoric strain around grains in the scan, mean", "", 3),
    ("mean_run_strain_deviator", "Deviatoric strain around grains in the run, mean", "", 3),
    ("correlation_strain_deviator", "Correlation of both over the grains", "", 3),
    ("mean_dice", "Overlap of grains with their labels (Dice), mean", "", 4),
    ("contacts_before", "Contacts in the first scan", "", 6),
    ("contacts_gained", "Contacts gained in the scan", "", 6),
    ("contacts_lost", "Contacts lost in the scan", "", 6),
    ("run_contacts_gained", "Contacts gained in the run", "", 6),
    ("run_contacts_lost", "Contacts lost in the run", "", 6),
    ("contacts_now_in_both", "Contacts now in scan and run", "", 6),
)


def draw_scatter(found, name, voxel_size):
    """Displacements, rotations and strains of grains: those of the run over those of the scan."""
    table = found.table
    figure, axes = style.new_figure(style.PAGE, 2.7, ncols=3)
    scan, run = vectors(table, "displacement"), vectors(table, "run_displacement")
    factor, unit = style.unit_of([scan, run], "m")
    for k, axis in enumerate("xyz"):
        axes[0].plot(
            scan[:, k] / factor, run[:, k] / factor, style.MARKERS[k], markersize=2.5,
            color=style.SERIES[k], label=axis,
        )  # fmt: skip
    turn = [
        np.degrees(np.linalg.norm(vectors(table, n), axis=1)) for n in ("rotation", "run_rotation")
    ]
    axes[1].plot(*turn, "o", markersize=2.5, color=style.BLUE)
    if "strain_zz" in table:
        axes[2].plot(
            table["strain_zz"], table["run_strain_zz"], "o", markersize=2.5, color=style.BLUE
        )
    for k, (axis, what) in enumerate(
        zip(axes, (f"displacement: {unit}", "rotation: °", "vertical strain: –"), strict=True)
    ):
        axis.set(xlabel=f"Scan, {what}", ylabel=f"Run, {what}")
        _one_to_one(axis)
        style.panel_letter(axis, k)
    figure.legend(loc="outside upper left", ncols=3)
    columns = {f"displacement {a} [m]": scan[:, k] for k, a in enumerate("xyz")}
    columns |= {f"run displacement {a} [m]": run[:, k] for k, a in enumerate("xyz")}
    columns |= {"rotation [°]": turn[0], "run rotation [°]": turn[1]}
    return Drawing(
        "scatter",
        figure,
        f"{name}: (a) displacements, (b) rotations and (c) vertical strains of grains, run over "
        "scan",
        "A point a grain, in (a) one for each of x, y and z; on the line both are the same. Round "
        "grains have no point in (b). Strains are those of Delaunay cells of "
        f"centres, compression positive. A voxel is {style.quantity(voxel_size, 'm')}.",
        {"": columns},
        "wide",
    )


def _one_to_one(axis):
    """Equal limits on both axes, and the line on which both are the same."""
    limits = np.array([axis.get_xlim(), axis.get_ylim()])
    ends = limits[:, 0].min(), limits[:, 1].max()
    axis.plot(ends, ends, "-", color=style.GREY, linewidth=0.6, zorder=0)
    axis.set(xlim=ends, ylim=ends, aspect="equal")


def draw_maps(found, name, voxel_size):
    """Vertical displacement and deviatoric strain of grains in a vertical slab, side by side."""
    table = found.table
    centre = vectors(table, "center")
    diameter = np.cbrt(6 / np.pi * table["volume"].to_numpy())
    middle = 0.5 * (centre[:, 1].min() + centre[:, 1].max())
    away = np.abs(centre[:, 1] - middle)
    shown = np.flatnonzero(away <= SLAB * np.median(diameter))
    shown = shown if shown.size else np.array([np.argmin(away)])
    shown = shown[np.argsort(-away[shown])]  # what is nearer to the plane hides what is not
    x, z, size = centre[shown, 0], centre[shown, 2], diameter[shown]
    low = np.array([(x - size / 2).min(), (z - size / 2).min()])
    high = np.array([(x + size / 2).max(), (z + size / 2).max()])
    scale, unit = style.unit_of([low, high], "m")
    moved = [table[n].to_numpy()[shown] for n in ("displacement_z", "run_displacement_z")]
    factor, unit_u = style.unit_of(np.concatenate(moved), "m")
    rows = [([m / factor for m in moved], f"Vertical displacement: {unit_u}")]
    if "strain_deviator" in table:
        strains = [table[n].to_numpy()[shown] for n in ("strain_deviator", "run_strain_deviator")]
        rows.append((strains, "Deviatoric strain: –"))
    span = high - low
    height = 0.75 + 0.28 * style.PAGE * min(max(span[1] / span[0], 0.5), 1.6)
    figure, axes = style.new_figure(style.PAGE, len(rows) * height, nrows=len(rows), ncols=3)
    axes = np.atleast_2d(axes)
    for k, (both, label) in enumerate(rows):
        difference = both[0] - both[1]
        limits = [(np.nanmin(both), np.nanmax(both))] * 2
        most = np.nanmax(np.abs(difference)) if np.isfinite(difference).any() else 1.0
        limits.append((-most or -1.0, most or 1.0))
        for i, (values, what) in enumerate(
            zip((*both, difference), ("scan", "run", "scan less run"), strict=True)
        ):
            axis = axes[k, i]
            circles = x / scale, z / scale, size / scale
            _draw_grains(figure, axis, circles, values, limits[i], label, signed=i == 2)
            axis.set(xlim=(low[0] / scale, high[0] / scale), ylim=(low[1] / scale, high[1] / scale),
                     aspect="equal", xlabel=f"x: {unit}",
                     ylabel=f"z: {unit}" if i == 0 else "")  # fmt: skip
            style.heading(axis, what)
            style.panel_letter(axis, 3 * k + i)
    return Drawing(
        "maps",
        figure,
        f"{name}: vertical displacement and deviatoric strain of the grains in a vertical slab, in "
        "the scan, in the run, and their difference",
        f"Balls of the grains' volumes where the first scan has them, within {SLAB:g} median "
        "diameters of the middle plane. Grey ones have no cell for a strain.",
        {"": {"grain": table["grain"][shown], "x [m]": x, "z [m]": z,
              "displacement z [m]": moved[0], "run displacement z [m]": moved[1]}},
        "wide",
    )  # fmt: skip


def _draw_grains(figure, axis, circles, values, limits, label, signed):
    """Circles coloured by values, with a colour bar below."""
    low, high = limits
    if not np.isfinite([low, high]).all() or low == high:
        low, high = 0.0, 1.0
    colours = matplotlib.colormaps[style.SIGNED_MAP if signed else style.GRAIN_MAP]
    norm = Normalize(low, high)
    for x, z, size, value in zip(*circles, values, strict=True):
        face = colours(norm(value)) if np.isfinite(value) else "0.85"
        axis.add_patch(Circle((x, z), size / 2, facecolor=face, edgecolor="white", linewidth=0.3))
    bar = figure.colorbar(
        ScalarMappable(norm, colours),
        ax=axis,
        location="bottom",
        aspect=22,
        shrink=0.9,
    )
    bar.ax.xaxis.get_major_locator().set_params(nbins=4)
    bar.set_label(label)
    bar.outline.set_linewidth(0.6)


def draw_slices(found, name, voxel_size, labels):
    """Middle slices of the scan's labels with outlines of the run's grains on them.

    Args:
        found: :class:`~mufe_fenicsx.results.scans.Beside`, with the run's labels.
        name: Of the scan.
        voxel_size: [m].
        labels: Of the scan, (z, y, x).
    """
    ends = [
        np.flatnonzero((labels > 0).any(axis=tuple({0, 1, 2} - {k})))[[0, -1]] for k in range(3)
    ]
    parts = [slice(max(a - 2, 0), b + 3) for a, b in ends]
    middle = [int(a + b) // 2 for a, b in ends]
    scale, unit = style.unit_of(np.array(labels.shape) * voxel_size, "m")
    size = [part.stop - part.start for part in parts]
    tall = max(size[0] / size[2], size[0] / size[1], size[1] / size[2])
    figure, axes = style.new_figure(style.PAGE, 0.5 + 0.3 * style.PAGE * min(tall, 2.5), ncols=3)
    for k, (axis, across) in enumerate(zip(axes, (1, 2, 0), strict=True)):
        up, right = (a for a in range(3) if a != across)
        where = [*parts]
        where[across] = middle[across]
        theirs, ours = labels[tuple(where)], found.run_labels[tuple(where)]
        corner = np.array([parts[right].start, parts[up].start])
        unit_of_pixel = voxel_size / scale
        extent = unit_of_pixel * np.array(
            [corner[0], corner[0] + theirs.shape[1], corner[1], corner[1] + theirs.shape[0]]
        )
        axis.imshow(np.where(theirs > 0, 0.75, 1.0), cmap="gray", vmin=0, vmax=1, origin="lower",
                    extent=extent, interpolation="nearest")  # fmt: skip
        for image, colour, width in ((theirs, style.BLACK, 0.5), (ours, style.RED, 0.9)):
            line = [unit_of_pixel * (c + x) for c, x in zip(corner, _outlines(image), strict=True)]
            axis.plot(*line, color=colour, linewidth=width)
        axis.set(xlabel=f"{'zyx'[right]}: {unit}", ylabel=f"{'zyx'[up]}: {unit}",
                 xlim=extent[:2], ylim=extent[2:])  # fmt: skip
        place = style.quantity((middle[across] + 0.5) * voxel_size, "m")
        style.heading(axis, f"{'zyx'[across]} = {place}")
        style.panel_letter(axis, k)
    return Drawing(
        "slices",
        figure,
        f"{name}: labels of the scan (grey, black lines) and the run's grains at the same strain "
        "(orange lines) in three middle slices",
        "Orange lines hide the black ones where both are the same.",
        {},
        "wide",
        vector=False,
    )


def _outlines(image):
    """Edges of pixels between which labels differ, as one line with gaps [pixels]."""
    down, right = np.nonzero(image[1:] != image[:-1])
    row, column = np.nonzero(image[:, 1:] != image[:, :-1])
    across = [(right, right + 1), (column + 1, column + 1)]
    up = [(down + 1, down + 1), (row, row + 1)]
    gaps = [np.full(len(right), np.nan), np.full(len(row), np.nan)]
    return tuple(
        np.concatenate(
            [np.column_stack([*ends, gap]).ravel() for ends, gap in zip(x, gaps, strict=True)]
        )
        for x in (across, up)
    )


def draw_differences(found, name, voxel_size):
    """Shares of the grains whose displacement, rotation and overlap differ by less."""
    table = found.table
    shown = [
        (table["displacement_difference"] / voxel_size, "Difference of displacement: voxels"),
        (np.degrees(table["rotation_difference"]), "Angle between rotations: °"),
    ]
    if "dice" in table:
        shown.append((table["dice"], "Overlap with the label, Dice: –"))
    shown = [(values, label) for values, label in shown if np.isfinite(values).any()]
    figure, axes = style.new_figure(style.PAGE, 2.3, ncols=len(shown), squeeze=False)
    columns = {}
    for k, (axis, (values, label)) in enumerate(zip(axes[0], shown, strict=True)):
        values = np.sort(np.asarray(values, dtype=float)[np.isfinite(values)])
        share = (np.arange(len(values)) + 1) / len(values)
        axis.step(
            np.append(values[:1], values), np.append(0.0, share), where="post", color=style.BLUE
        )
        axis.axvline(values.mean(), color=style.RED, linestyle="--", linewidth=0.9)
        axis.set(xlabel=label, ylabel="Share of grains: –" if k == 0 else "", ylim=(0, 1))
        if not label.startswith("Overlap"):
            axis.set_xlim(left=0)
        style.panel_letter(axis, k)
        columns[label.replace(": ", " [") + "]"] = np.asarray(shown[k][0])
    return Drawing(
        "differences",
        figure,
        f"{name}: shares of the grains up to a difference of displacement and of rotation, and up "
        "to an overlap with the label",
        "Dashed lines are the means.",
        {"": columns},
        "wide",
    )


#: Figures of a scan, in the page's order.
FIGURES = (draw_scatter, draw_maps, draw_differences)


def write_scans(folder, run, scans, voxel_size, about, view=None):
    """Write ``report.html`` and ``figures`` of a run beside scans.

    Args:
        folder: That is there.
        run: :class:`~mufe_fenicsx.results.run.Run`.
        scans: List of (name, :class:`~mufe_fenicsx.results.scans.Beside`, labels or None).
        voxel_size: [m].
        about: Sentences on how the comparison came about.
        view: :class:`~mufe_fenicsx.report.view.View` of surfaces, or None.

    Raises:
        InputError: It cannot be written.
    """
    pictures = []
    try:
        figures = own_folder(folder / "figures")
        with style.look():
            for number, (name, found, labels) in enumerate(scans, start=1):
                drawings = [draw(found, name, voxel_size) for draw in FIGURES]
                if labels is not None:
                    drawings.insert(2, draw_slices(found, name, voxel_size, labels))
                for drawing in drawings:
                    drawing.name = f"scan-{number}-{drawing.name}"
                    pictures.append(save(drawing, figures))
        write_index(figures, pictures)
        write_page(
            folder / "report.html",
            f"Run {run.path.resolve().name} beside scans",
            " ".join(about),
            [],
            [],
            [picture.row for picture in pictures],
            [("All grains together", _rows(scans), ("", *(name for name, _, _ in scans)))],
            FOOTER,
            view,
        )
    except OSError as error:
        raise InputError(f"report in {folder} cannot be written ({reason(error)})") from error


def _rows(scans):
    """Rows of the page's table: a number a line, a column a scan."""
    rows = []
    for key, words, unit, digits in ROWS:
        values = [found.numbers.get(key) for _, found, _ in scans]
        if all(v is None or not np.isfinite(v) for v in values):
            continue
        if unit == "m":
            texts = [style.quantity(v, "m", digits) for v in values]
        elif unit == "°":
            texts = [f"{style.number(np.degrees(v), digits)}°" for v in values]
        else:
            texts = [style.number(v, digits) for v in values]
        rows.append((words, *texts))
    return rows
