"""Figures and table of selected grains: fields on them, their evolution, energies, inertia."""

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import ListedColormap

from mufe_fenicsx.analysis.inertia import grain_inertia, unphysical
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import shared_legend
from mufe_fenicsx.report.curves import PAPER, shade
from mufe_fenicsx.report.figure import Drawing
from mufe_fenicsx.report.render import Camera, Layer, render
from mufe_fenicsx.report.views import VON_MISES, colour_bar

AXES = "xyz"
TENSOR = ("xx", "yy", "zz", "xy", "yz", "xz")


def words(label, why):
    """A chosen grain in words."""
    return f"grain {label}" if why == "chosen" else f"grain {label}, {why}"


# --- fields on chosen grains ------------------------------------------------------------------


#: Fields on chosen grains: name, words, unit, whether values go beyond the colours.
SHOWN = (
    ("contact_pressure", "contact pressure", "Pa", "neither"),
    ("von_mises", VON_MISES, "Pa", "max"),
    ("displacement", "displacement", "m", "neither"),
)


def draw_chosen(source):
    """Contact pressure, von Mises stress and displacement of chosen grains, a row a grain."""
    end, chosen = source.end, source.chosen
    source.need_rendering()
    if not end.has("contact_pressure"):
        raise InputError(f"state {end.index} has no field contact_pressure")
    surfaces, limits = _surfaces(source, chosen)
    maps = {
        "contact_pressure": _void_grey(style.PRESSURE_MAP),
        "von_mises": style.STRESS_MAP,
        "displacement": style.LENGTH_MAP,
    }
    height = 1.75 * len(chosen) + 0.65
    figure, axes = style.new_figure(style.PAGE, height, nrows=len(chosen), ncols=3, squeeze=False)
    tables = {}
    for row, (label, surface) in enumerate(surfaces.items()):
        camera = _towards_pressure(surface)
        for axis, (name, limit) in zip(axes[row], limits.items(), strict=True):
            layer = Layer(surface, None, name, maps[name], (0, limit), edges=True)
            axis.imshow(render([layer], camera, (520, 520)))
            axis.set_axis_off()
        style.panel_letter(axes[row, 0], row)
        style.heading(axes[row, 1], words(label, chosen[label]))
        style.scale_bar(axes[row, 0], 2 * camera.half_height)
        nodes = surface.point_data["node"]
        tables[f"grain{label}"] = {
            **{f"{a} [m]": end.points[nodes, i] for i, a in enumerate(AXES)},
            "contact pressure [Pa]": np.asarray(surface.point_data["contact_pressure"]),
            "von Mises stress of the facets around [Pa]": _at_nodes(surface),
            "displacement [m]": np.asarray(surface.point_data["displacement"]),
        }
    for column, (name, label, symbol, extend) in enumerate(SHOWN):
        colour_bar(
            figure,
            list(axes[:, column]),
            limits[name],
            maps[name],
            label,
            symbol,
            extend,
            location="bottom",
            shrink=0.85,
            pad=0.01,
        )
    return Drawing(
        "chosen-grains",
        figure,
        "Contact pressure, von Mises stress and displacement (from left) of selected grains at "
        f"strain {end.strain:.3f} (Fig. 14 {PAPER})",
        f"{_how_chosen(source)} Each is seen towards its largest contact pressure; grey in the "
        "left column is free surface, lines are facets of the mesh. A resolved contact spans "
        f"several facets. Displacement counts from strain {source.start.strain:.3f}.",
        tables,
        "wide",
        vector=False,
    )


def _surfaces(source, chosen):
    """Surfaces of grains with what is drawn on them, by label; upper limits of the colours."""
    end = source.end
    pressure = end.field("contact_pressure")
    moved = np.linalg.norm(end.points - source.at_zero, axis=1)
    surfaces = {label: end.surface(label) for label in chosen}
    for surface in surfaces.values():
        nodes = surface.point_data["node"]
        surface.point_data["contact_pressure"] = pressure[nodes]
        surface.point_data["displacement"] = moved[nodes]
    limits = {
        "contact_pressure": max(s.point_data["contact_pressure"].max() for s in surfaces.values()),
        "von_mises": max(np.percentile(s.cell_data["von_mises"], 99) for s in surfaces.values()),
        "displacement": max(s.point_data["displacement"].max() for s in surfaces.values()),
    }
    return surfaces, {name: style.round_limit(value) for name, value in limits.items()}


def _how_chosen(source):
    if "chosen" in source.chosen.values():
        return "The grains were given by the user."
    return (
        "By the volume mean of their von Mises stress: the most loaded, the median and the lower "
        "quartile of the grains with at least 1 % of the sample's mean."
    )


def _at_nodes(surface):
    """Mean of the facets' stress around each node, by number of facets."""
    faces = surface.regular_faces
    values = np.repeat(np.asarray(surface.cell_data["von_mises"]), 3)
    count = np.bincount(faces.ravel(), minlength=surface.n_points)
    return np.bincount(faces.ravel(), values, surface.n_points) / count


def _towards_pressure(surface):
    """A camera that looks at the place of the largest pressure."""
    pressure, points = surface.point_data["contact_pressure"], np.asarray(surface.points)
    towards = points[np.argmax(pressure)] - points.mean(axis=0)
    towards /= np.linalg.norm(towards)
    # Straight from above has no upward direction.
    up = (0, 0, 1) if abs(towards[2]) < 0.95 else (0, 1, 0)
    return Camera.around(points, towards, 1.0, up, 1.12)


def _void_grey(name):
    """A colour map whose lowest step, no contact, is light grey."""
    colours = colormaps[name](np.linspace(0, 1, 256))
    colours[:2] = (0.86, 0.86, 0.86, 1)
    return ListedColormap(colours)


# --- the course of points and grains ----------------------------------------------------------


def draw_course(source):
    """Von Mises stress and displacement of points and grains through all stored states."""
    chosen, points, series = source.chosen, source.points, _series(source)
    figure, axes = style.new_figure(style.PAGE, 2.9, ncols=2)
    moved = [_length(table) for _, table in series]
    factors = (
        style.unit_of(np.concatenate([t["von_mises"] for _, t in series]), "Pa"),
        style.unit_of(np.concatenate(moved), "m"),
    )
    tables = {}
    for k, ((name, table), length) in enumerate(zip(series, moved, strict=True)):
        for axis, values, (factor, _) in zip(
            axes, (table["von_mises"], length), factors, strict=True
        ):
            axis.plot(
                source.over(table["strain"], table["time"])[0],
                np.asarray(values) / factor,
                style.MARKERS[k % 8] + ("-" if k < len(chosen) else "--"),
                color=style.SERIES[k % 8],
                markersize=3,
                label=name,
            )
        columns = {"strain [-]": table["strain"], "time [s]": table["time"]}
        columns |= {"von Mises stress [Pa]": table["von_mises"]}
        columns |= {f"stress {e} [Pa]": table[f"tensile_stress_{e}"] for e in TENSOR}
        moved = {a: table[f"displacement_{a}"].to_numpy() for a in AXES}
        columns |= {f"displacement {a} [m]": own - own[0] for a, own in moved.items()}
        columns |= {"plastic strain [-]": table["plastic_strain"]}
        tables[name.replace(", ", "-").replace(" ", "-")] = columns
    over = source.over((), ())[1]
    shade(source, *axes)
    axes[0].set(xlabel=over, ylabel=f"von Mises stress: {factors[0][1]}")
    axes[1].set(xlabel=over, ylabel=f"Displacement: {factors[1][1]}")
    for i, axis in enumerate(axes):
        style.panel_letter(axis, i)
    columns = 3 if len(series) > 4 else 2
    shared_legend(axes[0], columns)
    places = "; ".join(
        f"{name} at ({', '.join(style.quantity(c, 'm') for c in x)})" for name, x in points.items()
    )
    return Drawing(
        "course",
        figure,
        "Evolution of (a) von Mises stress and (b) displacement of selected grains (means over the "
        f"volume, solid) and points (dashed) through the stored states (Fig. 15 {PAPER})",
        "Displacement counts from the first stored state. Points move with the grain; in the "
        f"reference configuration: {places}. "
        + (
            "The first is where the stress is largest at the end, the second the grain's middle."
            if "peak" in points
            else ""
        ),
        tables,
        "wide",
    )


def _series(source):
    """Tables of chosen grains and of points through the stored states, each with its name."""
    chosen, points = source.chosen, source.points
    of_grains = source.run.probe(grains=list(chosen))
    of_points = source.run.probe(points=np.array(list(points.values())))
    first = next(iter(chosen))
    series = []
    for label, why in chosen.items():
        series.append((words(label, why), of_grains[of_grains["probe"] == label]))
    for k, name in enumerate(points):
        table = of_points[of_points["probe"] == k]
        inside = f" of grain {first}" if name in ("peak", "centre") else ""
        series.append((f"{name}{inside}", table))
    return series


def _length(table):
    moved = table[[f"displacement_{a}" for a in AXES]].to_numpy(float)
    return np.linalg.norm(moved - moved[0], axis=1)


# --- energies of one grain --------------------------------------------------------------------


#: Colours and lines of energies.
LOOKS = {
    "elastic": (style.BLUE, "-"),
    "plastic": (style.RED, "--"),
    "kinetic": (style.GREEN, ":"),
}


def draw_energies(source):
    """Energies of the most loaded grain beside those of the whole sample."""
    source.material  # noqa: B018  that of all grains, or why not
    course, history = source.course, source.loading
    if "energy" not in course:
        raise InputError(f"element is {source.summary['element']!r}, expected averaged or p1")
    label = next(iter(source.chosen))
    at = int(np.searchsorted(course["labels"], label))
    figure, axes = style.new_figure(style.PAGE, 2.6, ncols=2)
    energies = {name: values[:, at] for name, values in course["energy"].items()}
    whole = {name: history[name] for name in energies}
    sums = {name: values.sum(axis=1) for name, values in course["energy"].items()}
    tables = {
        f"grain{label}": {"strain [-]": course["strain"]}
        | {f"{name} [J]": values for name, values in energies.items()},
        "sum": {"strain [-]": course["strain"]}
        | {f"{name}, sum of all grains [J]": values for name, values in sums.items()},
        "whole": {"strain [-]": history["strain"]}
        | {f"{name} [J]": values for name, values in whole.items()},
    }
    at_states, over = source.over(course["strain"], course["time"])
    for axis, along, values, points in (
        (axes[0], at_states, energies, None),
        (axes[1], source.over(history["strain"], history["time"])[0], whole, sums),
    ):
        _draw_energies(axis, along, values, at_states, points)
        axis.set_xlabel(over)
    shade(source, *axes)
    shared_legend(axes[0])
    style.heading(axes[0], f"grain {label}")
    style.heading(axes[1], "whole sample")
    for i, axis in enumerate(axes):
        style.panel_letter(axis, i)
    lie = " They lie on the lines."
    if course["without_work"]:
        lie = (
            " They lie on the lines, but those of plastic energy below by the work of dents, which "
            "states of earlier versions do not have."
        )
    return Drawing(
        "energies-of-a-grain",
        figure,
        f"Elastic, plastic and kinetic energy of (a) grain {label} ({source.chosen[label]}) and "
        f"(b) the whole sample (Fig. 7 {PAPER})",
        "Lines of (b) are the run's history. Points are computed from the fields of the stored "
        f"states, without added mass: circles of (b) are their sum over all grains.{lie}",
        tables,
        "wide",
    )


def _draw_energies(axis, along, values, at_states, points):
    """Lines of energies ``values`` [J], and where given ``points`` at the stored states."""
    factor, unit = style.unit_of(np.concatenate(list(values.values())), "J")
    for name, (colour, line) in LOOKS.items():
        marker = "o" if points is None else ""
        axis.plot(
            along,
            values[name] / factor,
            line + marker,
            color=colour,
            markersize=3,
            label=name,
        )
        if points is not None:
            axis.plot(
                at_states,
                points[name] / factor,
                "o",
                color=colour,
                markersize=3.5,
                markerfacecolor="none",
                markeredgewidth=0.8,
            )
    axis.set_yscale("log")
    style.few_decades(axis, [v / factor for v in values.values()], 7)
    axis.set_ylabel(f"Energy: {unit}")


# --- Table 1 ----------------------------------------------------------------------------------


def table_of_inertia(source):
    """Inertia of the chosen grains at the first and the last shown state, as numbers.

    Returns:
        dict column -> list, a row a grain and state: tensor and principal moments [kg m²], or
        for unit density [m⁵] where the density is not known, and axes.
    """
    try:
        rho, unit = source.material["rho"], "kg m²"
    except InputError:
        rho, unit = 1.0, "m⁵"
    states = [source.start, source.end] if source.start is not source.end else [source.end]
    columns = {}

    def add(name, value):
        columns.setdefault(name, []).append(value)

    for label, why in source.chosen.items():
        for state in states:
            mine = state.grain == label
            found = grain_inertia(state.points, state.cells[mine], state.grain[mine], rho)
            add("grain", label)
            add("why", why)
            add("strain [-]", state.strain)
            add("mass [kg]" if unit == "kg m²" else "volume [m³]", found.mass[0])
            for e in TENSOR:
                tensor = found.tensor[0][AXES.index(e[0]), AXES.index(e[1])]
                add(f"I_{e} [{unit}]", tensor)
            for k in range(3):
                add(f"I_{k + 1} [{unit}]", found.moments[0, k])
            for k in range(3):
                for i, a in enumerate(AXES):
                    add(f"axis {k + 1} {a} [-]", found.axes[0, k, i])
            add("N_cA [-]", _active(source, state.index, label))
    return columns


def _active(source, index, label):
    """Active contacts of a grain with others; nan where they were not stored."""
    try:
        grains = source.run.grains(index)
    except InputError:
        return np.nan
    return float(grains.loc[grains["grain"] == label, "num_active_contacts"].iloc[0])


def inertia_rows(columns):
    """Rows of the page for :func:`table_of_inertia`, and the names of their columns."""
    unit = next(k for k in columns if k.startswith("I_xx")).split("[")[1][:-1]
    tensors = np.array([columns[f"I_{e} [{unit}]"] for e in TENSOR]).T
    power = int(np.floor(np.log10(np.abs(tensors).max())))
    scale = 10.0**power
    names = (
        "Grain",
        "Strain",
        f"I_xx, I_yy, I_zz, I_xy, I_yz, I_xz: {style.power_of_ten(power)} {unit}",
        "Principal moments, the same unit",
        "Their axes (x, y, z)",
        "Active contacts",
    )
    rows = []
    for i, label in enumerate(columns["grain"]):
        moments = [columns[f"I_{k} [{unit}]"][i] for k in (1, 2, 3)]
        axes = [[columns[f"axis {k} {a} [-]"][i] for a in AXES] for k in (1, 2, 3)]
        active = columns["N_cA [-]"][i]
        rows.append(
            (
                words(label, columns["why"][i]),
                style.strain(columns["strain [-]"][i]),
                _numbers(tensors[i] / scale),
                _numbers(np.array(moments) / scale),
                "; ".join(f"({_numbers(a)})" for a in axes),
                "not stored" if np.isnan(active) else f"{active:.0f}",
            )
        )
    moments = np.array([columns[f"I_{k} [{unit}]"] for k in (1, 2, 3)]).T
    wrong = int(unphysical(moments).sum())
    rows.append(
        (
            "Check",
            "",
            "moments are positive and satisfy the triangle inequality"
            if not wrong
            else f"{wrong} rows violate it",
            "",
            "",
            "",
        )
    )
    return rows, names


def _numbers(values):
    # + 0.0: no minus sign before 0
    return ", ".join(f"{round(float(v), 3) + 0.0:.3f}".replace("-", "−") for v in values)
