"""Figures and table of grains that break: when and where they crack, and sizes of fragments."""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.analysis.breakage import (
    ULTIMATE_DIMENSION,
    breakage,
    diameter,
    fragments_of,
    size_at,
)
from mufe_fenicsx.analysis.rows import load, tool_load
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.measure import tet_volumes
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import legends
from mufe_fenicsx.report.curves import STRESS, shade
from mufe_fenicsx.report.figure import Drawing

NAME, SIZES = "breakage", "fragments"
#: What opens facets: colour and line.
MODES = {"tension": (style.BLUE, "-"), "shear": (style.ORANGE, "--")}
#: A crack begins at a contact if it does so within this part of the grain's diameter of it.
NEAR = 0.1
#: Sizes below this part of the largest are not drawn; the data have them.
SEEN = 1e-2


@dataclass(frozen=True)
class Cracked:
    """Grains with a crack, in the order of their first ones."""

    grain: np.ndarray  #: labels, shape (num_cracked,)
    row: np.ndarray  #: of the table of events, of their first opening
    near: np.ndarray  #: whether that is at a contact, 1 or 0; nan: no contact of theirs is known
    coordination: np.ndarray  #: contacts in the stored state before; nan: not known
    of_all: np.ndarray  #: the same, mean of all grains


def sizes(source):
    """Volumes [m³] of the grains and of the fragments of the last stored state, and their grains.

    Raises:
        InputError: Grains cannot break.
    """
    state = source.end
    volume = tet_volumes(state.reference, state.cells)
    own, grain = fragments_of(volume, state.grain, state.field("fragment"))
    labels, of = np.unique(grain, return_inverse=True)
    return labels, np.bincount(of, own), own, grain


def bearing(history):
    """What the sample bears a row, the symbol of its unit, and its name.

    The vertical stress, or where tools load their force.
    """
    if tool_load(history) is None:
        return history["stress"], "Pa", STRESS
    return load(history), "N", "Force"


def until(table, state):
    """Rows of a table, dict column -> array, up to a stored state; the first one at least."""
    # Times of tables are rounded to nine digits and more.
    num = np.searchsorted(table["time"], state.time * (1 + 1e-8), side="right")
    return {name: values[: max(num, 1)] for name, values in table.items()}


def first_broken(source, time):
    """Grains in several pieces at the first stored state from a time [s] on, a list of labels."""
    for listed in source.run.stored_states:
        if listed["time"] >= time * (1 - 1e-8):
            state = source.run.state(listed["index"])
            pieces = np.unique(np.stack([state.grain, state.field("fragment")]), axis=1)
            labels, num = np.unique(pieces[0], return_counts=True)
            return labels[num > 1].tolist()
    return []


def cracked_grains(source, events, labels, volume):
    """:class:`Cracked` of a run.

    Args:
        source: :class:`~mufe_fenicsx.report.source.Source`.
        events: Its table of them, dict column -> array.
        labels: Of the grains, increasing, shape (num_grains,).
        volume: Theirs [m³].
    """
    stored = source.run.with_contacts()
    grain, row = np.unique(events["grain"].astype(int), return_index=True)  # rows are by time
    grain, row = grain[np.argsort(row)], np.sort(row)
    near, coordination, of_all = np.full((3, row.size), np.nan)
    reach = NEAR * diameter(volume)[np.searchsorted(labels, grain)]
    for k in range(row.size if len(stored) else 0):
        after = int(np.searchsorted(stored["time"], events["time"][row[k]], side="right"))
        before = source.run.grains(stored.index[max(after - 1, 0)])
        number = before["num_active_contacts"] + before["num_active_walls"]
        coordination[k] = number[before["grain"] == grain[k]].sum()
        of_all[k] = number.mean()
        place = np.array([events[axis][row[k]] for axis in "xyz"])
        for state in stored.index[max(after - 1, 0) : after + 1]:
            contacts = source.run.contacts(state)
            own = (contacts["grain_a"] == grain[k]) | (contacts["grain_b"] == grain[k])
            own = contacts[own & (contacts["num_points"] > 0)]
            if len(own):
                away = own[[f"centroid_{axis}" for axis in "xyz"]].to_numpy() - place
                radius = np.sqrt(own["area_deformed"].to_numpy() / np.pi)
                near[k] = (np.linalg.norm(away, axis=1) - radius).min() <= reach[k]
                break
    return Cracked(grain, row, near, coordination, of_all)


def draw_breakage(source):
    """Stress with marks where grains crack and come apart; opened, failed area; fragments."""
    history, events = source.loading, source.events
    if not events["time"].size:
        raise InputError("no facet of a grain has opened")
    x, over = source.over(history["strain"], history["time"])
    values, symbol, name = bearing(history)
    factor, unit = style.unit_of(values, symbol)
    figure, axes = style.new_figure(style.PAGE, 2.5, ncols=3)
    axes[0].plot(x, values / factor, color=style.GREY)
    first = np.unique(events["grain"], return_index=True)[1]
    at = np.searchsorted(history["time"], events["time"][first])
    seated = f" Before, in the seating, {n} had cracked." if (n := np.sum(at == 0)) else ""
    broken, pieces = history["broken_grains"], history["num_fragments"]
    whole, pieces = (np.diff(number, prepend=number[0]) > 0 for number in (broken, pieces))
    marks = (
        ("first crack of a grain", np.unique(at[(at > 0) & (at < x.size)]), style.SKY, "^", 14),
        ("more fragments", np.flatnonzero(pieces & ~whole), style.ORANGE, ".", 14),
        ("first piece of a grain", np.flatnonzero(whole), style.RED, "o", 16),
    )
    for label, rows, colour, marker, size in marks:
        if rows.size:
            look = {"color": colour, "marker": marker, "label": label, "zorder": 3}
            axes[0].scatter(x[rows], values[rows] / factor, size, linewidths=0, **look)
    bears = "vertical stress" if symbol == "Pa" else "force"
    columns = {"time [s]": history["time"], "strain [-]": history["strain"]}
    columns[f"{bears} [{symbol}]"] = values
    done = np.searchsorted(events["time"], history["time"], side="right")
    areas = {"failed": (history["failed_area"], style.GREY, "-.")}
    for mode, look in MODES.items():
        area = np.append(0.0, np.cumsum(events["area"] * (events["mode"] == mode)))[done]
        areas[f"opened by {mode}"] = area, *look
    for label, (area, colour, line) in areas.items():
        axes[1].plot(x, 1e6 * area, line, color=colour, drawstyle="steps-post", label=label)
        columns[f"area {label} [m²]"] = area
    for column, label, colour, line in (
        ("num_fragments", "fragments", style.RED, "-"),
        ("broken_grains", "broken grains", style.BLACK, "--"),
    ):
        look = {"color": colour, "drawstyle": "steps-post", "label": label}
        axes[2].plot(x, history[column], line, **look)
        columns[f"{label} [-]"] = history[column]
    axes[2].yaxis.get_major_locator().set_params(integer=True)
    shade(source, *axes)
    for i, label in enumerate((f"{name}: {unit}", "Area of facets: mm²", "Number")):
        axis = axes[i]
        axis.set(xlabel=over, ylabel=label, ylim=(min(0, axis.get_ylim()[0]), None))
        style.panel_letter(axis, i)
    legends(*axes)
    return Drawing(
        NAME,
        figure,
        f"Breakage: (a) {bears} with what happens to grains, (b) area of facets that opened, by "
        "what bore more, and that failed, (c) fragments of broken grains",
        "An open facet softens, and has failed when it has taken its fracture energy: opened area "
        "that has not failed still bears. A grain counts as broken from its first loose piece on, "
        f"a crumb too.{seated}",
        {"": columns},
        "wide",
    )


def draw_fragments(source):
    """Sizes of grains and of fragments, cumulative by volume."""
    _, whole, own, grain = sizes(source)
    numbers = breakage(own, grain)
    figure, axis = style.new_figure()
    largest = diameter(whole.max())
    factor, unit = style.unit_of([largest], "m")
    tables = {}
    for label, volume, colour, line in (
        ("grains at the start", whole, style.BLUE, "--"),
        ("fragments and whole grains at the end", own, style.RED, "-"),
    ):
        size, part = np.sort(diameter(volume)), np.sort(volume)
        finer = np.cumsum(part) / part.sum()
        ends = np.r_[SEEN * largest, size, 1.2 * largest] / factor, np.r_[0.0, finer, 1.0]
        axis.plot(*ends, line, color=colour, drawstyle="steps-post", label=label)
        tables[label.split()[0]] = {"diameter [m]": size, "finer by volume [-]": finer}
    at = np.geomspace(SEEN, 1.0, 50)
    look = {"color": style.GREY, "linewidth": 0.8, "label": "ultimate (Einav)"}
    axis.plot(at * largest / factor, at ** (3.0 - ULTIMATE_DIMENSION), ":", **look)
    axis.set_xscale("log")
    low = max(min(0.7 * diameter(own.min()), 0.5 * largest), SEEN * largest)
    axis.set_xlim(low / factor, 1.2 * largest / factor)
    style.plain_log_ticks(axis.xaxis)
    axis.set(xlabel=f"Diameter of the ball of the same volume: {unit}", ylim=(0, 1.02))
    axis.set_ylabel("Finer by volume: –")
    legends(axis)
    return Drawing(
        SIZES,
        figure,
        f"Sizes before and after: Hardin's B_r = {style.number(numbers.hardin)}, Einav's B = "
        f"{style.number(numbers.einav)}",
        "Areas between the curves are what both numbers measure. B_r is that over the area down to "
        "74 µm, where silt begins (Hardin 1985), B that over the area down to the ultimate sizes, "
        f"of fractal dimension {ULTIMATE_DIMENSION:g} (Einav 2007). The last stored state counts.",
        tables,
    )


def _when(history, row):
    """Stage, strain and what the sample bears at a row, in words."""
    values, symbol, _ = bearing(history)
    strain, bears = style.strain(history["strain"][row]), style.quantity(values[row], symbol)
    return f"{history['stage'][row]}, strain {strain}, {bears}"


def _loose_rows(source, history, whole):
    """Rows about the first piece that came loose, of a single grain its strength, too."""
    broken = np.flatnonzero(history["broken_grains"])
    if not broken.size:
        return []
    grains = first_broken(source, history["time"][broken[0]])
    named = ("grain " if len(grains) == 1 else "one of grains ") + ", ".join(map(str, grains))
    rows = [("First piece loose", f"{named}, {_when(history, broken[0])}")]
    if whole.size == 1:
        bears, size = load(history), diameter(whole[0])
        most = int(np.argmax(bears))
        strain = style.strain(history["strain"][most])
        for name, force in (
            (f"Largest force over the diameter squared, at strain {strain}", bears[most]),
            ("The same until a first piece came loose", bears[: broken[0] + 1].max()),
        ):
            rows.append((name, style.quantity(force / size**2, "Pa")))
    return rows


def breakage_rows(source):
    """Rows (name, value) about grains that break, up to the last stored state.

    Raises:
        InputError: There is no table of events, no stored state or no history of loading.
    """
    history, events = (until(table, source.end) for table in (source.history, source.events))
    labels, whole, own, grain = sizes(source)
    numbers, number = breakage(own, grain), labels.size
    parts = [round(number * part) for part in (numbers.split, numbers.chipped)]
    cracked = cracked_grains(source, events, labels, whole)
    last = f"{source.end.stage}, strain {style.strain(source.end.strain)}"
    rows = [
        ("At the last stored state", last),
        ("Grains that are split, chipped, cracked, without a crack",
         f"{parts[0]}, {parts[1]}, {cracked.grain.size - sum(parts)}, "
         f"{number - cracked.grain.size}"),
        ("Fragments of broken grains", style.number(numbers.num_fragments)),
        ("Relative breakage B_r (Hardin 1985)", style.number(numbers.hardin)),
        ("Breakage B (Einav 2007)", style.number(numbers.einav)),
        ("d10 and d50, start → end", " and ".join(
            f"{style.quantity(size_at(whole, p), 'm')} → {style.quantity(size_at(own, p), 'm')}"
            for p in (0.1, 0.5))),
    ]  # fmt: skip
    for mode in MODES:
        by = events["mode"] == mode
        area = events["area"][by].sum()
        text = f"{style.number(by.sum())} openings, {style.number(1e6 * area)} mm²"
        rows.append((f"Opened by {mode}", text))
    failed = history["failed_area"][-1] / max(history["opened_area"][-1], 1e-300)
    rows.append(("Failed of the opened area", f"{failed:.1%}"))
    if not cracked.grain.size:
        return rows
    opened = events["time"][cracked.row[0]]
    row = min(int(np.searchsorted(history["time"], opened)), len(history["time"]) - 1)
    rows.append(("First crack", f"grain {cracked.grain[0]}, {_when(history, row)}"))
    rows += _loose_rows(source, history, whole)
    near, known = int(np.nansum(cracked.near)), int(np.isfinite(cracked.near).sum())
    if known:
        rows.append(
            ("Where grains cracked first",
             f"{near} within a tenth of the diameter of a contact, {known - near} elsewhere")
        )  # fmt: skip
    if np.isfinite(cracked.coordination).any():
        text = " and ".join(
            style.number(np.nanmean(v)) for v in (cracked.coordination, cracked.of_all)
        )
        rows.append(("Contacts of grains before they cracked, and of all grains", text))
    return rows
