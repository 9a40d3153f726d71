"""Figures and tables of several runs together, as of a sweep of the yield stress."""

from pathlib import Path

import numpy as np

from mufe_fenicsx.analysis import energy_check, quasi_static, stress_strain
from mufe_fenicsx.analysis.contact_forces import force_distribution
from mufe_fenicsx.analysis.rows import largest, loaded_rows
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.curves import PAPER, STRAIN, STRESS
from mufe_fenicsx.report.figure import Drawing
from mufe_fenicsx.report.network import LARGEST, between_grains, bins_for

#: Tables and keys of a scene that say nothing of the physics.
OF_NO_INTEREST = ("title", "image", "output", "sample.grains")
#: So many differences fit into a name, and so many letters.
MOST, LONGEST = 2, 60


def name_runs(sources):
    """Names of runs by what differs in their scenes, else by their folders.

    Args:
        sources: List of :class:`mufe_fenicsx.report.source.Source`.

    Returns:
        List of different texts.
    """
    folders = [source.folder.resolve() for source in sources]
    by_folder = [folder.name for folder in folders]
    if len(set(by_folder)) < len(by_folder):
        by_folder = [str(Path(folder.parent.name, folder.name)) for folder in folders]
    if len(set(by_folder)) < len(by_folder):
        by_folder = [f"{k}: {name}" for k, name in enumerate(by_folder, start=1)]
    try:
        scenes = [_flat(source.run.scene) for source in sources]
    except InputError:
        return by_folder
    keys = dict.fromkeys(key for scene in scenes for key in scene)
    keys = [k for k in keys if len({str(scene.get(k)) for scene in scenes}) > 1]
    if not 1 <= len(keys) <= MOST:
        return by_folder
    names = [", ".join(_words(key, scene.get(key)) for key in keys) for scene in scenes]
    fit = len(set(names)) == len(names) and max(map(len, names)) <= LONGEST
    return names if fit else by_folder


def _flat(table, before=""):
    """A scene as one dict "contact.friction" -> value."""
    found = {}
    for key, value in table.items():
        name = f"{before}{key}"
        if name in OF_NO_INTEREST:
            continue
        found |= _flat(value, f"{name}.") if isinstance(value, dict) else {name: value}
    return found


def _words(key, value):
    if key == "material.yield_stress" and value:
        return f"yield {style.quantity(value[0][1], 'Pa')}"
    units = {"E": "Pa", "speed": "m/s", "size": "m", "seating_stress": "Pa"}
    last = key.rsplit(".", 1)[-1]
    if isinstance(value, float) and last in units:
        return f"{last} {style.quantity(value, units[last])}"
    return f"{last} {'not set' if value is None else value}"


def _lines(sources, names):
    """(source, name, look) of each run."""
    for k, (source, name) in enumerate(zip(sources, names, strict=True)):
        look = {"color": style.SERIES[k % 8], "linestyle": style.LINES[k % 4], "label": name}
        yield source, name, look


def draw_stress_strain(sources, names):
    """Stress-strain curves and e-log σ' curves."""
    figure, (left, right) = style.new_figure(style.PAGE, 3.0, ncols=2)
    factor, unit = style.unit_of(np.concatenate([s.loading["stress"] for s in sources]), "Pa")
    tables = {}
    for source, name, look in _lines(sources, names):
        history = source.loading
        left.plot(100 * history["strain"], history["stress"] / factor, **look)
        tables[_file(name)] = {
            "strain [-]": history["strain"],
            "vertical stress [Pa]": history["stress"],
        }
        try:
            curves = source.run.curves()
        except InputError:
            continue
        curves = curves[(curves["stage"] != "seating")]
        tables[_file(name)]["void ratio [-]"] = curves["void_ratio"].to_numpy()
        curves = curves[curves["stress"] > 0]
        right.plot(curves["stress"] / factor, curves["void_ratio"], **look)
    left.set(xlabel=STRAIN, ylabel=f"{STRESS}: {unit}")
    left.set_ylim(bottom=0)
    right.set_xscale("log")
    style.plain_log_ticks(right.xaxis)
    right.set(xlabel=f"{STRESS}: {unit}", ylabel="Void ratio, $e$: –")
    _finish(figure, (left, right))
    return Drawing(
        "runs-stress-strain",
        figure,
        f"Runs compared: (a) vertical stress against strain (Figs 9, 10 {PAPER}), (b) compression "
        "curves e–log σ′",
        "Stress is the mean force of both platens over the cross-section.",
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
        axis.plot(travel / scale, history["force_z_max"] / factor, **look)
        tables[_file(name)] = {"displacement [m]": travel, "force [N]": history["force_z_max"]}
    axis.set(xlabel=f"Displacement of top platen: {unit_u}", ylabel=f"Force: {unit}")
    axis.set_ylim(bottom=0)
    _finish(figure, (axis,))
    return Drawing(
        "runs-forces",
        figure,
        f"Runs compared: force on the top platen against its displacement (as Fig. 8 {PAPER})",
        "For one ball between platens and several yield stresses this is their figure.",
        tables,
    )


def draw_energies(sources, names):
    """Kinetic over internal energy, plastic and frictional dissipation."""
    figure, axes = style.new_figure(style.PAGE, 2.9, ncols=3)
    both = [np.append(s.loading["plastic"], s.loading["friction"]) for s in sources]
    factor, unit = style.unit_of(np.concatenate(both), "J")
    tables = {}
    for source, name, look in _lines(sources, names):
        history = source.loading
        strain, ratio = 100 * history["strain"], quasi_static.kinetic_ratio(history)
        positive = ratio > 0
        axes[0].plot(strain[positive], 100 * ratio[positive], **look)
        axes[1].plot(strain, history["plastic"] / factor, **look)
        axes[2].plot(strain, history["friction"] / factor, **look)
        tables[_file(name)] = {
            "strain [-]": history["strain"],
            "kinetic over internal energy [-]": ratio,
            "plastic dissipation [J]": history["plastic"],
            "frictional dissipation [J]": history["friction"],
        }
    axes[0].set_yscale("log")
    for axis, label in zip(
        axes,
        ("Kinetic / internal energy: %", f"Plastic dissipation: {unit}", f"Friction: {unit}"),
        strict=True,
    ):
        axis.set(xlabel=STRAIN, ylabel=label)
    _finish(figure, axes)
    return Drawing(
        "runs-energies",
        figure,
        "Runs compared: (a) kinetic over internal energy, (b) plastic and (c) frictional "
        f"dissipation (Figs 11, 12 {PAPER})",
        "(a) says whether the runs are quasi-static, without which they should not be compared.",
        tables,
        "wide",
    )


def draw_networks(sources, names):
    """Active contacts in the course of the tests, distribution of forces at their ends."""
    figure, (left, right) = style.new_figure(style.PAGE, 3.0, ncols=2)
    tables = {}
    for source, name, look in _lines(sources, names):
        try:
            network, force = source.network, between_grains(source, source.contact_states[-1])
        except InputError:
            continue
        left.plot(100 * network["strain"], network["N_cA"], **look, marker="o", markersize=3)
        force = force["normal_force"].to_numpy(float)
        found = force_distribution(force, bins_for(force), LARGEST)
        middle, some = 0.5 * (found.edges[1:] + found.edges[:-1]), found.density > 0
        right.plot(middle[some], found.density[some], **look, marker="o", markersize=3)
        tables[f"{_file(name)}-contacts"] = {
            "strain [-]": network["strain"],
            "mean active contacts [-]": network["N_cA"],
        }
        tables[f"{_file(name)}-forces"] = {"f/<f> [-]": middle, "P [-]": found.density}
    if not tables:
        raise InputError("no run has stored contacts")
    left.set(xlabel=STRAIN, ylabel=r"Mean active contacts, $N_{\mathrm{cA}}$: –")
    right.set(xlabel="Normal force over its mean, f/⟨f⟩: –", ylabel="Probability density: –")
    left.set_ylim(bottom=0)
    right.set_yscale("log")
    right.set_ylim(1e-3, 3)
    _finish(figure, (left, right))
    return Drawing(
        "runs-networks",
        figure,
        "Runs compared: (a) mean number of active contacts of a grain, (b) distribution of the "
        "normal forces between grains in the last stored state",
        "What does not depend on the yield stress falls on one line in (b).",
        tables,
        "wide",
    )


FIGURES = (draw_stress_strain, draw_forces, draw_energies, draw_networks)


def rows(sources, names):
    """A table of the runs, the first row its heading."""
    found = [
        (
            "Run",
            "Grains",
            "Tetrahedra",
            "Strain at the end",
            "Vertical stress there",
            "Constrained modulus, last fifth",
            "Friction over plastic dissipation",
            "Kinetic over internal energy, largest while loaded",
        )
    ]
    for source, name in zip(sources, names, strict=True):
        history, run = source.loading, source.summary
        strain, end = history["strain"], history["strain"][-1]
        modulus = stress_strain.tangent_modulus(strain, history["stress"], 0.9 * end, 0.2 * end)
        kinetic = largest(quasi_static.kinetic_ratio(history)[loaded_rows(history)])
        found.append(
            (
                name,
                style.number(run.get("num_grains")),
                style.number(run.get("num_cells")),
                f"{100 * end:.3g} %",
                style.quantity(history["stress"][-1], "Pa", 4),
                style.quantity(modulus, "Pa"),
                style.number(energy_check.friction_share(history)),
                f"{kinetic:.2%}" if np.isfinite(kinetic) else "not known",
            )
        )
    return found


def _file(name):
    """A name as part of a file's name."""
    return "".join(c if c.isalnum() or c in ".-" else "-" for c in name).strip("-")


def _finish(figure, axes):
    handles = axes[0].get_legend_handles_labels()
    columns = max(1, min(4, len(handles[0])))
    if len(axes) == 1:
        columns = min(2, columns)
    figure.legend(*handles, loc="outside lower center", ncols=columns)
    if len(axes) > 1:
        for i, axis in enumerate(axes):
            style.panel_letter(axis, i)
