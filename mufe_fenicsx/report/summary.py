"""Tables of the report: what was run, and the largest values."""

import csv
import shlex

import numpy as np

from mufe_fenicsx.analysis import energy_check, stress_strain
from mufe_fenicsx.analysis.checkerboard import checkerboard
from mufe_fenicsx.analysis.grain_means import sample_stress, void_ratio
from mufe_fenicsx.analysis.macro import inner_lengths
from mufe_fenicsx.analysis.rows import is_constrained, loading_rows, tool_load
from mufe_fenicsx.container import container_of_history
from mufe_fenicsx.geometry.measure import tet_volumes
from mufe_fenicsx.machine.files import regular
from mufe_fenicsx.report.curves import SEEN_DENTS
from mufe_fenicsx.report.style import listed, number, quantity


def failed_grains(quality_csv):
    """Labels of the grains that could not be meshed, by the table of the mesher.

    None where there is no such table.
    """
    try:
        with regular(quality_csv).open(newline="", encoding="utf-8") as file:
            return [int(r["label"]) for r in csv.DictReader(file) if r["status"] != "ok"]
    except (OSError, KeyError, ValueError):
        return None


def run_rows(run):
    """Rows (name, value) about the run, from run.json; empty without it."""
    if not run:
        return []
    rows = [
        ("Grains", _count(run, "num_grains")),
        ("Tetrahedra", _count(run, "num_cells")),
        ("Nodes", _count(run, "num_nodes")),
        ("Steps", _count(run, "num_steps")),
        ("Wall-clock time", _duration(run.get("wall_s"))),
        ("Throughput", _speed(run)),
        ("MPI ranks", _count(run, "num_ranks")),
        ("Peak memory, all ranks", _memory(run)),
        ("Strain definition", run.get("strain_definition") or "not recorded"),
        ("Height at strain 0", quantity(run.get("reference_height"), "m", 4)),
        ("Cross-section at the start", _area(run.get("area"))),
        ("Separation of overlaps", _separation(run.get("separation"))),
        ("Initial overlaps", _adopted(run.get("contact"))),
        ("Grains without a mesh", _failed(run.get("failed_grains"))),
        ("Stages", _stages(run.get("stages"))),
        ("Quasi-static speed control", _quasi_static(run.get("quasi_static"))),
        ("Mass scaling", _mass_scaling(run.get("mass_scaling"))),
        ("Retries", _retries(run.get("retries"))),
        ("Stop reason", _end(run)),
        ("Command", _command(run.get("command"))),
        ("Versions", ", ".join(f"{k} {v}" for k, v in (run.get("versions") or {}).items())),
    ]
    return [(name, value) for name, value in rows if value]


def largest_values(history, last, at_zero=None):
    """Rows (name, value, where) of the largest values.

    Args:
        history: dict column -> array with at least one row, or None.
        last: Last stored State, or None.
        at_zero: Its nodes at strain 0 [m], shape (num_nodes, 3); None: in the reference
            configuration.
    """
    rows = []
    if history is not None:
        loading = loading_rows(history)
        strain, stress = history["strain"][loading], history["stress"][loading]
        if strain.size:
            by_platens = tool_load(history) is None
            if by_platens:
                rows += [_at("Vertical stress", history, "stress", "Pa", loading)]
            rows += [
                _at(f"Force on the {name}", history, column, "N", loading)
                for name, column in (("top platen", "force_z_max"), ("bottom", "force_z_min"))
            ]
            side = np.max(list(stress_strain.side_forces(history).values()), axis=0)
            rows += [_at("Force on a side wall", {**history, "side": side}, "side", "N", loading)]
            if by_platens:
                end = strain[-1]
                modulus = stress_strain.tangent_modulus(strain, stress, 0.9 * end, 0.2 * end)
                slope = "Constrained modulus" if is_constrained(history) else "Tangent modulus"
                rows.append((f"{slope}, last fifth of the strain", quantity(modulus, "Pa"), ""))
            rows += [
                _at(name, history, column, "J", loading)
                for name, column in (
                    ("Work of the walls", "work"),
                    ("Plastic dissipation", "plastic"),
                    ("Frictional dissipation", "friction"),
                    ("Elastic energy", "elastic"),
                    ("Kinetic energy", "kinetic"),
                    ("Fracture work", "cracks_fracture"),
                    ("Friction in cracks", "cracks_friction"),
                    ("Stored in springs of cracks", "cracks_stored"),
                    ("Damping in cracks", "cracks_damping"),
                    ("Lost where fragments became rigid", "cracks_dust"),
                )
                if column in history
            ]
            if "cracks_fracture" in history:
                for name, column in (
                    ("Lost where nodes parted", "parting"),
                    ("Springs of cracks as they opened, which nothing gave", "cracks_opening"),
                ):
                    gone = quantity(history[column][loading][-1], "J", 4)
                    rows.append((name, gone, "at the end"))
            share = energy_check.friction_share(history)
            rows.append(("Frictional over plastic dissipation", number(share), "at the end"))
            share = energy_check.dents_share(history)
            if share >= SEEN_DENTS:
                rows.append(("Plastic dissipation in dents over all", number(share), "at the end"))
            rows.append(_at("Closed contact points", history, "num_contacts", None, loading))
            rows.append(_at("Grains in contact", history, "num_active_grains", None, loading))
    if last is not None:
        rows += _state_rows(last, at_zero)
    return rows


def _state_rows(state, at_zero):
    where = f"last stored state, strain {state.strain:.4f}"
    grain = state.grain[int(np.argmax(state.von_mises))]
    label, mean = state.most_loaded_grain()
    # The law limits τ = J σ: with J of the element, so that σ may exceed the table by 1/J.
    ratio = state.volume / tet_volumes(state.reference, state.cells)
    limited = state.von_mises * ratio
    worst = state.grain[int(np.argmax(limited))]
    rows = [
        ("von Mises stress of σ", quantity(state.von_mises.max(), "Pa"), f"grain {grain}, {where}"),
        (
            "von Mises stress of Jσ, which yield_stress limits",
            quantity(limited.max(), "Pa"),
            f"grain {worst}, {where}",
        ),
        ("von Mises stress, mean of a grain", quantity(mean, "Pa"), f"grain {label}, {where}"),
    ]
    if state.has("plastic_strain"):
        values = state.field("plastic_strain")
        worst = state.grain[int(np.argmax(values))]
        rows.append(("Plastic strain", number(values.max()), f"grain {worst}, {where}"))
        share = state.volume[values > 0].sum() / state.volume.sum()
        rows.append(("Volume that has yielded", f"{share:.1%}", where))
    if state.has("contact_pressure"):
        pressure = state.field("contact_pressure").max()
        rows.append(("Contact pressure", quantity(pressure, "Pa"), where))
    start = state.reference if at_zero is None else at_zero
    moved = np.linalg.norm(state.points - start, axis=1).max()
    since = "" if at_zero is None else " since strain 0"
    rows.append((f"Displacement{since}", quantity(moved, "m"), where))
    return rows


def contact_rows(source):
    """Table of contacts by how finely they are meshed: (heading, rows, names of the columns).

    Args:
        source: :class:`mufe_fenicsx.report.source.Source`.

    Raises:
        InputError: There are no tables of patches.
    """
    rows = []
    for k in source.classes:
        name = f"more than {k.low:g}" if np.isinf(k.high) else f"{k.low:g} to {k.high:g}"
        pressure = quantity(k.pressure, "Pa") if k.num_patches else "–"
        flow = number(k.flow) if np.isfinite(k.flow) else "–"
        rows.append((name, number(k.num_patches), f"{k.force_share:.1%}", pressure, flow))
    columns = (
        "Elements per contact radius", "Patches", "Normal force, part of all", "Mean pressure",
        "Mean pressure over 2.8 times the yield stress reached",
    )  # fmt: skip
    return f"How finely contacts are meshed ({source.patches[1]})", rows, columns


def sample_rows(start, last, run, history):
    """Rows (name, value) about the sample, from its stored states.

    Among them the vertical stress by the mean stress of the grains beside that of the
    platens, which are two independent numbers. Volumes are those between the walls at the time
    of each state.
    """
    boxes = [_box_volume(state, run, history) for state in (start, last)]
    if not all(boxes):
        return []
    solid = tet_volumes(start.reference, start.cells).sum()
    ratios = [void_ratio(solid, volume) for volume in boxes]
    rows = [("Void ratio, start → end", f"{ratios[0]:.3f} → {ratios[1]:.3f}")]
    if last.has("stress") and tool_load(history) is None:
        inside = -sample_stress(last.field("stress"), last.volume, boxes[1])[2]
        walls = float(np.interp(last.time, history["time"], history["stress"]))
        rows.append(
            (
                "Vertical stress at the end, by the platens and by the stress in the grains",
                f"{quantity(walls, 'Pa', 4)} and {quantity(inside, 'Pa', 4)}: independent, and "
                "equal in equilibrium",
            )
        )
    if last.has("pressure"):
        part = checkerboard(last.cells, last.field("pressure"), last.volume)
        rows.append(
            (
                "Checkerboard of the pressure at the end",
                f"{number(part, 2)}: 1 where it alternates between tetrahedra, as in elements that "
                "lock; small where it is smooth",
            )
        )
    return rows


def _box_volume(state, run, history):
    """Volume between the walls at the time of a state [m³]; None where that is not known."""
    if not state.height:
        return None
    lengths = inner_lengths(history)
    if lengths is None:  # of earlier versions, where side walls stood still
        return run["area"] * state.height if run.get("area") else None
    volume = container_of_history(history).volume(lengths)
    return float(np.interp(state.time, history["time"], volume))


def _at(name, history, column, symbol, rows):
    values, strain = history[column][rows], history["strain"][rows]
    i = int(np.argmax(values))
    text = number(values[i], 4) if symbol is None else quantity(values[i], symbol, 4)
    return name, text, f"at strain {strain[i]:.4f}"


def _count(run, name):
    return None if run.get(name) is None else number(run[name])


def _duration(seconds):
    if seconds is None:
        return None
    hours, rest = divmod(round(seconds), 3600)
    minutes, whole = divmod(rest, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {whole} s" if minutes else f"{seconds:.1f} s"


def _speed(run):
    if not run.get("wall_s") or not run.get("num_cells") or not run.get("num_steps"):
        return None
    seconds = run["wall_s"] - (run.get("setup_s") or 0)
    rate = run["num_cells"] * run["num_steps"] / seconds if seconds > 0 else np.nan
    return f"{number(rate / 1e6)} million element-steps a second, output included"


def _memory(run):
    if not run.get("peak_memory_bytes"):
        return None
    text = f"{run['peak_memory_bytes'] / 1e9:.2f} GB"
    if run.get("num_cells"):
        text += f" ({run['peak_memory_bytes'] / run['num_cells'] / 1e3:.2f} kB a tetrahedron)"
    return text


def _area(area):
    return None if not area else f"{area * 1e6:.4g} mm²"


def _separation(separation):
    if not separation:
        return "not recorded"
    change = separation.get("volume_change")
    closed = ""
    if separation.get("close_gaps"):
        before, after = (separation[f"contact_area{when}"] for when in ("_before", ""))
        closed = (
            f"gaps up to {quantity(separation['close_gaps'], 'm')} were closed, which took the "
            f"area of contacts from {_area(before) or 0} to {_area(after) or 0}; "
        )
    inside = separation.get("overlap_nodes", np.nan)
    depth = f", at most {quantity(separation.get('max_depth'), 'm')} deep" if inside else ""
    return (
        f"{number(inside)} nodes were inside a neighbour{depth}; {closed}"
        f"moving surfaces changed the volume of solids by "
        f"{'an unknown share' if change is None else number(100 * change) + ' %'}"
    )


def _adopted(contact):
    if not contact:
        return None
    begun = contact.get("num_overlaps_at_start")
    text = f"{number(begun)} overlapped at the start and have their depth as offset"
    if begun:
        text += f", the deepest {quantity(contact.get('deepest_at_start'), 'm')}"
    now = (number(contact.get(name)) for name in ("num_closed", "num_with_offset"))
    text += "; of {} closed at the end {} have one".format(*now)
    return f"{text}, {number(contact.get('num_at_largest_force'))} carry their largest force"


def _failed(labels):
    if labels is None:
        return "not recorded"
    if not labels:
        return "none"
    return f"{len(labels)}, not in the test: {', '.join(str(label) for label in labels)}"


def _stages(stages):
    return listed(
        [
            f"{s.get('name')} from step {s.get('step')}, t = {quantity(s.get('time'), 's')}, "
            f"strain {number(s.get('strain'))}"
            for s in stages or ()
        ],
        "; ",
    )


def _quasi_static(found):
    if not found or not found.get("slowest"):
        return None
    return (
        f"{found['slowest']:.3g} to {found['fastest']:.3g} m/s; largest kinetic "
        f"over internal energy {found['largest_kinetic']:.2%}, force difference "
        f"{found['largest_unbalanced']:.2%} (means over half the travel time of a wave)"
    )


def _mass_scaling(found):
    if not found:
        return None
    return (
        f"{found['added']:.2%} of all, at most {found['added_to_grain']:.2%} of one grain, in "
        f"{number(found['num_elements'])} tetrahedra; stable step {found['gain']:.2f} times as long"
    )


def _retries(done):
    if not done:
        return None
    return "; ".join(
        f"from step {r['from_step']} with time step factor {r['time_step_factor']:g} after step "
        f"{r['failed_at_step']}: {r['cause']}"
        for r in done
    )


def _end(run):
    reason = run.get("stop_reason") or "no reason recorded"
    return reason if run.get("finished") else f"stopped early: {reason}"


def _command(command):
    return shlex.join(command) if isinstance(command, list) else command
