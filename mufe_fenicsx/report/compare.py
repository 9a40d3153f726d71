"""Figures and tables of several runs together, as of a sweep of the yield stress."""

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from mufe_fenicsx.analysis import energy_check, quasi_static, stress_strain
from mufe_fenicsx.analysis.check_targets import TARGETS
from mufe_fenicsx.analysis.checks import check_run
from mufe_fenicsx.analysis.rows import is_constrained
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import legends, shared_legend, without_spikes
from mufe_fenicsx.report.curves import PAPER, STRAIN, STRESS
from mufe_fenicsx.report.figure import Drawing, file_name
from mufe_fenicsx.report.network import between_grains
from mufe_fenicsx.report.reference import about as about_measured
from mufe_fenicsx.report.reference import draw_measured
from mufe_fenicsx.report.run_names import MOST, UNITS, YIELD, differences, value_text, words
from mufe_fenicsx.units import base_number

#: Stresses at a strain are means over this part of the largest one to both sides.
HALF_WINDOW = 0.02
#: What the table says of each check.
CHECKED = {
    "kinetic": "Kinetic over internal energy",
    "platens": "Unbalanced force over load",
    "residual": "Energy residual over work",
    "overlap": "Overlap over volume of grains",
    "load": "Stress lost over stress added",
}

#: A number that says nothing by its size: its points are not joined.
SEED = "pack.seed"
#: So many runs have a line of the legend each.
FEW = 8
#: Parts of the strain at which stresses are compared.
PARTS = (0.25, 0.5, 0.75, 0.98)
#: How lines look as far as a test is dynamic, and what captions say of it.
FAINT, DYNAMIC = 0.3, "Lines are faint as far as a test is dynamic. "


def _lines(sources, names):
    """(source, name, look) of each run: few have names, many a scale of colours."""
    colours = matplotlib.colormaps[style.GRAIN_MAP](np.linspace(0, 1, len(names)))
    for k, (source, name) in enumerate(zip(sources, names, strict=True)):
        look = {"color": style.SERIES[k % 8], "linestyle": style.LINES[k % 4], "label": name}
        if len(names) > FEW:
            look = {"color": colours[k], "linewidth": 0.8, "label": None}
        yield source, name, look


def _plot(axis, source, x, y, look):
    """A line over the rows of the loading, faint as far as the test is dynamic."""
    last = source.last_dynamic
    start = 0 if last is None else last + 1
    axis.plot(x[start:], y[start:], **look)
    axis.plot(x[: start + 1], y[: start + 1], **look | {"label": None, "alpha": FAINT})


def draw_stress_strain(sources, names):
    """Stress-strain curves and e-log σ' curves."""
    figure, (left, right) = style.new_figure(style.PAGE, 3.0, ncols=2)
    factor, unit = style.unit_of(np.concatenate([s.loading["stress"] for s in sources]), "Pa")
    tables = {}
    for source, name, look in _lines(sources, names):
        history = source.loading
        _plot(left, source, history["strain"], history["stress"] / factor, look)
        tables[file_name(name)] = {
            "strain [-]": history["strain"],
            "vertical stress [Pa]": history["stress"],
        }
        try:
            curves = source.run.curves()
        except InputError:
            continue
        curves = curves[(curves["stage"] != "seating")]
        tables[file_name(name)]["void ratio [-]"] = curves["void_ratio"].to_numpy()
        stress = curves["stress"].where(curves["stress"] > 0).to_numpy()
        _plot(right, source, stress / factor, curves["void_ratio"].to_numpy(), look)
    references = {r.label: r for source in sources for r in source.references}.values()
    measured = draw_measured(left, references, "strain", "stress", (1.0, factor))
    by_stress = draw_measured(right, references, "stress", "void_ratio", (factor, 1.0))
    tables |= measured | {f"{name}-void-ratio": data for name, data in by_stress.items()}
    left.set(xlabel=STRAIN, ylabel=f"{STRESS}: {unit}")
    left.set_ylim(bottom=0)
    strain = np.concatenate([source.loading["strain"] for source in sources])
    without_spikes(left, strain, np.concatenate([s.loading["stress"] for s in sources]) / factor)
    right.set_xscale("log")
    style.plain_log_ticks(right.xaxis)
    right.set(xlabel=f"{STRESS}: {unit}", ylabel="Void ratio, $e$: –")
    _finish((left, right), names)
    return Drawing(
        "runs-stress-strain",
        figure,
        f"Runs compared: (a) vertical stress against strain (Figs 9, 10 {PAPER}), (b) compression "
        "curves e–log σ′",
        f"Stress is the mean force of both platens over the cross-section. {DYNAMIC}"
        f"{_where_strain_begins(sources)}{about_measured(tables.keys() & measured)}",
        tables,
        "wide",
    )


def draw_forces(sources, names):
    """Force on the top platen against its displacement."""
    figure, axis = style.new_figure(style.COLUMN, 2.9)
    scale, unit_u = style.unit_of(
        np.concatenate([s.reference_height - s.loading["height"] for s in sources]), "m"
    )
    factor, unit = style.unit_of(np.concatenate([s.loading["force_z_max"] for s in sources]), "N")
    tables = {}
    for source, name, look in _lines(sources, names):
        history = source.loading
        travel = stress_strain.displacement(history, source.reference_height)
        _plot(axis, source, travel / scale, history["force_z_max"] / factor, look)
        tables[file_name(name)] = {"displacement [m]": travel, "force [N]": history["force_z_max"]}
    axis.set(xlabel=f"Displacement of top platen: {unit_u}", ylabel=f"Force: {unit}")
    axis.set_ylim(bottom=0)
    travel, force = (
        np.concatenate([table[name] for table in tables.values()])
        for name in ("displacement [m]", "force [N]")
    )
    without_spikes(axis, travel / scale, force / factor)
    _finish((axis,), names)
    return Drawing(
        "runs-forces",
        figure,
        f"Runs compared: force on the top platen against its displacement (as Fig. 8 {PAPER})",
        "For one ball between platens and several yield stresses this is their figure. "
        f"{DYNAMIC}{_where_strain_begins(sources)}",
        tables,
    )


def draw_parameter(sources, names):
    """Stress at four strains against the first number in which the scenes differ.

    Where they differ in more, points of the same strain are joined where all else is the same.

    Raises:
        InputError: they differ in more than three things, or in none, or not in a number.
    """
    found = differences(sources)
    numbers = {key: [_number_of(key, v) for v in values] for key, values in found.items()}
    numeric = sorted((k for k in numbers if None not in numbers[k]), key=lambda k: k == SEED)
    if not numeric or len(found) > MOST:
        raise InputError(f"their scenes differ in more than {MOST} things, or in no number")
    key, others = numeric[0], [k for k in found if k != numeric[0]]
    last = min(source.loading["strain"].max() for source in sources)
    if not last > 0:
        raise InputError("their vertical strain does not grow")
    order = np.argsort(numbers[key], kind="stable")
    strains = last * np.arange(1, 5) / 4
    stress = np.array(
        [_stress_at(*_course(source.loading, "strain"), strains, last) for source in sources]
    )[order]
    values = np.array(numbers[key])[order]
    alike = [", ".join(words(k, found[k][i]) for k in others) for i in order]
    unit = "Pa" if key == YIELD else UNITS.get(key.rsplit(".", 1)[-1], "")
    scale, prefixed = style.unit_of(values, unit) if unit else (1.0, "–")
    factor, stress_unit = style.unit_of(stress, "Pa")
    figure, axis = style.new_figure()
    _plot_points(axis, values / scale, stress / factor, alike, strains, joined=key != SEED)
    columns = {f"{key} [{unit or '-'}]": values}
    columns |= {k: [value_text(k, found[k][i]) for i in order] for k in others}
    columns |= {
        f"vertical stress at strain {strain:.4g} [Pa]": stress[:, k]
        for k, strain in enumerate(strains)
    }
    name = "Yield stress" if key == YIELD else key
    axis.set(xlabel=f"{name}: {prefixed}", ylabel=f"{STRESS}: {stress_unit}")
    axis.set_ylim(bottom=0)
    legends(axis)
    return Drawing(
        "runs-parameter",
        figure,
        f"Runs compared: vertical stress at four strains against {name.lower()}",
        f"Each point is the mean over {style.strain(2 * HALF_WINDOW * last)} of strain. "
        + ("The yield stress is that without plastic strain. " if key == YIELD else "")
        + (f"Lines join runs that are alike in all else: {', '.join(others)}. " if others else ""),
        {"": columns},
    )


def _plot_points(axis, values, stress, alike, strains, joined):
    """Points of each strain in a colour; those of runs alike in all else have a line and marker.

    Args:
        axis: To draw into.
        values: Of the parameter, growing, shape (num_runs,).
        stress: Shape (num_runs, 4).
        alike: What else differs, in words; runs with the same are joined.
        strains: Shape (4,).
        joined: Whether there are lines at all.
    """
    groups = {words: np.array([a == words for a in alike]) for words in dict.fromkeys(alike)}
    named = 1 < len(groups) <= FEW
    for number, (group, rows) in enumerate(groups.items()):
        for k, strain in enumerate(strains):
            look = number if named else k
            axis.plot(
                values[rows], stress[rows, k],
                style.MARKERS[look % len(style.MARKERS)],
                linestyle=style.LINES[look % 4] if joined and rows.sum() > 1 else "none",
                color=style.SERIES[k], markersize=4,
                label=None if number else rf"$\varepsilon$ = {style.strain(strain)}",
            )  # fmt: skip
        if named:
            axis.plot([], [], style.MARKERS[number % len(style.MARKERS)], label=group,
                      linestyle=style.LINES[number % 4] if joined and rows.sum() > 1 else "none",
                      color=style.BLACK, markersize=4)  # fmt: skip


def _number_of(key, value):
    """The number that a value of a scene stands for; None where it is none."""
    if key == YIELD and value:
        return float(value[0][1])
    if isinstance(value, str):
        return base_number(value)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number else None


def _stress_at(way, stress, places, size):
    """Mean stress about places on a way, where the loading first comes by [Pa].

    Args:
        way: What grows with the loading, such as strain, shape (num_rows,).
        stress: [Pa], the same.
        places: On that way, shape (num_places,).
        size: Of what means are taken over a part of.
    """
    first = way == np.maximum.accumulate(way)
    near = np.abs(way[None, first] - places[:, None]) <= HALF_WINDOW * size
    stress = stress[first]
    return [
        stress[rows].mean() if rows.any() else np.interp(at, way[first], stress)
        for at, rows in zip(places, near, strict=True)
    ]


def draw_energies(sources, names):
    """Kinetic over internal energy, plastic and frictional dissipation."""
    figure, axes = style.new_figure(style.PAGE, 2.9, ncols=3)
    both = [np.append(s.loading["plastic"], s.loading["friction"]) for s in sources]
    factor, unit = style.unit_of(np.concatenate(both), "J")
    tables = {}
    for source, name, look in _lines(sources, names):
        history = source.loading
        strain, ratio = history["strain"], quasi_static.kinetic_ratio(history)
        positive = ratio > 0
        axes[0].plot(strain[positive], 100 * ratio[positive], **look)
        axes[1].plot(strain, history["plastic"] / factor, **look)
        axes[2].plot(strain, history["friction"] / factor, **look)
        tables[file_name(name)] = {
            "strain [-]": history["strain"],
            "kinetic over internal energy [-]": ratio,
            "plastic dissipation [J]": history["plastic"],
            "frictional dissipation [J]": history["friction"],
        }
    axes[0].set_yscale("log")
    axes[0].axhline(100 * TARGETS["kinetic"], color=style.GREY, linestyle=":", linewidth=0.8)
    for axis, label in zip(
        axes,
        ("Kinetic / internal energy: %", f"Plastic dissipation: {unit}", f"Friction: {unit}"),
        strict=True,
    ):
        axis.set(xlabel=STRAIN, ylabel=label)
    _finish(axes, names)
    return Drawing(
        "runs-energies",
        figure,
        "Runs compared: (a) kinetic over internal energy, (b) plastic and (c) frictional "
        f"dissipation (Figs 11, 12 {PAPER})",
        "(a) shows whether the runs are quasi-static and may be compared: below the dotted line "
        "beyond the first tenth.",
        tables,
        "wide",
    )


def draw_networks(sources, names):
    """Active contacts in the course of the tests, distribution of forces at their ends."""
    figure, (left, right) = style.new_figure(style.PAGE, 3.0, ncols=2)
    tables, counts = {}, []
    for source, name, look in _lines(sources, names):
        try:
            network, force = source.network, between_grains(source, source.contact_states[-1])
        except InputError:
            continue
        left.plot(network["strain"], network["N_cA"], **look, marker="o", markersize=3)
        force = np.sort(force["normal_force"].to_numpy(float))
        share = np.arange(len(force), 0, -1) / len(force)
        right.step(force / force.mean(), share, **look, where="pre")
        counts.append(len(force))
        tables[f"{file_name(name)}-contacts"] = {
            "strain [-]": network["strain"],
            "mean active contacts [-]": network["N_cA"],
        }
        tables[f"{file_name(name)}-forces"] = {
            "f/<f> [-]": force / force.mean(),
            "share [-]": share,
        }
    if not tables:
        raise InputError("no run has stored contacts")
    left.set(xlabel=STRAIN, ylabel="Coordination number, $Z$: –")
    right.set(xlabel="Normal force over its mean, f/⟨f⟩: –", ylabel="Share of larger forces: –")
    left.set_ylim(bottom=0)
    right.set_yscale("log")
    _finish((left, right), names)
    return Drawing(
        "runs-networks",
        figure,
        "Runs compared: (a) coordination number, (b) share of the contacts "
        "between grains whose normal force is at least f, in the last stored state",
        f"(b) is a cumulative distribution without bins, of {_range(counts)} forces per run; runs "
        "of the same distribution fall on one line.",
        tables,
        "wide",
    )


#: Name of each figure, and what draws it from sources and names of runs, in the page's order.
FIGURES = (
    ("runs-stress-strain", draw_stress_strain),
    ("runs-parameter", draw_parameter),
    ("runs-forces", draw_forces),
    ("runs-energies", draw_energies),
    ("runs-networks", draw_networks),
)
#: All that may be chosen, or left out.
NAMES = tuple(name for name, _ in FIGURES)


def tables(sources, names):
    """Tables of the page: list of (heading, rows, names of the columns)."""
    columns = (
        "Run",
        "Grains",
        "Tetrahedra",
        "Height at strain 0",
        "Strain at the end",
        "Vertical stress there",
        f"{_slope(sources)}, last fifth",
        "Friction over plastic dissipation",
    )
    rows, checked = [], []
    for source, name in zip(sources, names, strict=True):
        history, run = source.loading, source.summary
        strain, end = history["strain"], history["strain"][-1]
        modulus = stress_strain.tangent_modulus(strain, history["stress"], 0.9 * end, 0.2 * end)
        rows.append(
            (
                name,
                style.number(run.get("num_grains")),
                style.number(run.get("num_cells")),
                style.quantity(source.reference_height, "m", 4),
                style.strain(end),
                style.quantity(history["stress"][-1], "Pa", 4),
                style.quantity(modulus, "Pa"),
                style.number(energy_check.friction_share(history)),
            )
        )
        checks = {check.name: check for check in check_run(source.history, source.mass)}
        since = checks["trusted"].since
        trusted = f"strain {since:.4f}" if np.isfinite(since) else "nowhere"
        checked.append((name, trusted, *_reached(checks)))
    first, *others = sources
    ratios = [
        (name, *_ratios(source, first, "strain"), *_ratios(source, first, "height"))
        for source, name in zip(others, names[1:], strict=True)
    ]
    at = [style.percent(part) for part in PARTS]
    found = differences(sources)
    scenes = [(key, *(value_text(key, v) for v in values)) for key, values in found.items()]
    return [
        ("Runs", rows, columns),
        (
            "How quasi-static they are: largest (mean) beyond the first tenth",
            checked,
            ("Run", "Trusted from", *CHECKED.values()),
        ),
        (
            f"Stress over that of {names[0]}, at parts of the strains and heights of both",
            ratios,
            ("Run", *(f"Same {what}, {p}" for what in ("strain", "height") for p in at)),
        ),
        ("What differs in their scenes and meshes", scenes, ("Key", *names)),
    ]


def _course(history, column):
    """Strain, or how far the top is down from where heights begin, and stress [Pa]."""
    return (-1.0 if column == "height" else 1.0) * history[column], history["stress"]


def _ratios(source, other, column):
    """Stress over that of another run at parts of the strains, or heights, of both, as texts."""
    runs = [_course(each.loading, column) for each in (source, other)]
    start, end = max(way.min() for way, _ in runs), min(way.max() for way, _ in runs)
    if not end > start:
        return ["–"] * len(PARTS)
    places = start + np.array(PARTS) * (end - start)
    stress = [np.array(_stress_at(*run, places, end - start)) for run in runs]
    return [style.number(ratio, 3) for ratio in stress[0] / stress[1]]


def _reached(checks):
    """What each check of the table reached; where tools load, theirs stand for the platens'."""
    found = {**checks, "platens": checks.get("tool", checks.get("platens"))}
    return [found[key].reached if key in found else "–" for key in CHECKED]


def _slope(sources):
    """What the slope of vertical stress over strain is called."""
    constrained = all(is_constrained(source.loading) for source in sources)
    return "Constrained modulus" if constrained else "Tangent modulus"


def _where_strain_begins(sources):
    """From where strains and displacements count."""
    heights = [source.reference_height for source in sources]
    factor, unit = style.unit_of(heights, "m")
    at = _range([float(f"{h / factor:.4g}") for h in heights])
    return f"Strain and displacement count from the end of the seating, at a height of {at} {unit}."


def _range(values):
    """Numbers in words: "15 to 18"."""
    low, high = min(values), max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _finish(axes, names):
    """Legend or scale of colours, and letters of panels."""
    shared_legend(axes[0], 2 if len(axes) == 1 else 4, axes[1:])
    if len(names) > FEW:
        scale = ScalarMappable(Normalize(1, len(names)), style.GRAIN_MAP)
        bar = axes[0].figure.colorbar(scale, ax=axes[-1], pad=0.02, label="Run, as in the table")
        bar.outline.set_linewidth(0.6)
        bar.locator = MaxNLocator(6, integer=True)
    if len(axes) > 1:
        for i, axis in enumerate(axes):
            style.panel_letter(axis, i)
