"""A plan in words and as plain values."""

import math
from dataclasses import asdict


def lines(plan, cost):
    """Lines that tell a plan and its cost; ``cost`` may be None."""
    edges = f"{1e6 * plan.size:.3g} um near contacts, {1e6 * plan.inner_size:.3g} um inside"
    grains = "the grains as they are"
    if plan.mesh_again:
        sizes = f'mesh.size = "{1e6 * plan.inner_size:.3g} um"'
        if plan.size != plan.inner_size:
            sizes += f', mesh.sizing = "contact", mesh.smallest_size = "{1e6 * plan.size:.3g} um"'
        grains = f"mesh the grains again with {sizes}"
    rows = [
        ("accuracy", percent(plan.accuracy)),
        *_of_errors(plan),
        (
            "mesh",
            f"{plan.elements_per_radius:.2g} elements per contact radius, edges of {edges}, "
            f"{plan.tets:.0f} tetrahedra a grain: {grains}",
        ),
        *((key, _value(value)) for key, value in plan.settings.items()),
        *_of_checks(plan.quasi_static_from),
        *_of_cost(cost),
        ("what costs most", plan.driver),
    ]
    return _written(rows, plan)


def lines_of_present(present, cost):
    """Lines that tell what error a test has as it stands; ``cost`` may be None."""
    rows = [
        ("accuracy", "none stated: this is the test as it stands; --accuracy 0.05 plans one"),
        *_of_errors(present, present.beyond),
        (
            "mesh",
            f"{present.elements:.2g} elements per contact radius, edges of "
            f"{1e6 * present.size:.3g} um at contacts, {present.tets:.0f} tetrahedra a grain",
        ),
        ("contact", f"law {present.law}"),
        ("loading", _loading(present)),
        *_of_checks(present.quasi_static_from),
        *_of_cost(cost),
    ]
    return _written(rows, present)


def _loading(present):
    """How fast walls load the sample, as long as a wave takes; of what else does, nothing."""
    if math.isinf(present.time):
        return "not by walls; tools go at the speeds that the scene gives them"
    return (
        f"{present.speed:.3g} m/s: {present.time:.3g} times as long as a wave takes through the "
        "sample"
    )


def _of_checks(part):
    """A row of the part of the strain from which on the report will trust the test; nan: none."""
    if math.isnan(part):
        return []
    text = f"inertia is within the report's targets from {percent(part)} of the strain on"
    if part >= 1:
        text = "so fast that the report will trust no part of the test"
    return [("checks", text)]


def _of_errors(found, beyond=()):
    """Rows of the error of a plan or of a test as it stands, and of its models.

    Args:
        found: `Plan` or `Present`.
        beyond: Why parts of the error are infinite, in words.
    """
    model = ", ".join(f"{len(labels)} grains {name}" for name, labels in found.fidelity.items())
    parts = ", ".join(
        f"{name} {percent(part)}"
        for name, part in found.parts.items()
        if part and not math.isinf(part)
    )
    total = f"{percent(found.error)} of forces: {parts}"
    if beyond:
        total = f"not known, as {', and '.join(beyond)}" + (f"; known are {parts}" if parts else "")
    return [
        ("expected error", total),
        (
            "path",
            f"two such tests that differ in rounding alone part by about {percent(found.path)}",
        ),
        ("model", f"{model}; solver.element = {found.element}"),
        *([("cracks", found.cracks)] if found.cracks else []),
    ]


def _of_cost(cost):
    """Rows of the cost, none where it is None."""
    if cost is None:
        return []
    return [
        ("size", f"{cost.num_cells} tetrahedra, {cost.num_steps} steps of "
                 f"{1e9 * cost.time_step:.3g} ns (limited by the {cost.limit})"),
        ("cost", f"{duration(cost.wall_s)}, {bytes_of(cost.memory_bytes)} of memory, "
                 f"{bytes_of(cost.disk_bytes)} on disk, on {cost.num_ranks} "
                 f"{'rank' if cost.num_ranks == 1 else 'ranks'} here"),
        *([("seating", "comes before, in neither steps nor time above: how long it takes is not "
            "known before it is run")] if cost.seats else []),
    ]  # fmt: skip


def _written(rows, found):
    width = max(len(name) for name, _ in rows)
    return [
        *(f"{name:{width}}  {text}" for name, text in rows),
        *(f"warning: {text}" for text in found.warnings),
        "not known beforehand:",
        *(f"- {text}" for text in found.unknown),
    ]


def as_dict(plan, cost):
    """Plain values for JSON."""
    return asdict(plan) | {"predicted": None if cost is None else asdict(cost)}


def brief(plan, cost, summary):
    """{"plan": …, "plan_line": …} for the summary of a run that followed a plan."""
    done = {"accuracy": plan.accuracy, "error": plan.error, "settings": plan.settings}
    if cost is None:
        return {"plan": done}
    wall, memory = summary["wall_s"], summary["peak_memory_bytes"]
    text = (
        f"predicted{' without the seating' * cost.seats} {duration(cost.wall_s)}, "
        f"{cost.num_steps} steps, {bytes_of(cost.memory_bytes)}; actual {duration(wall)}, "
        f"{summary['num_steps']} steps, {bytes_of(memory)}"
    )
    return {"plan": done | {"predicted": asdict(cost)}, "predicted_and_actual": text}


def percent(value):
    """A part as a percentage."""
    return f"{100 * value:.2g} %"


def duration(seconds):
    """A time in the unit that it is handy in."""
    for limit, factor, unit in ((120, 1, "s"), (7200, 60, "min"), (float("inf"), 3600, "h")):
        if seconds < limit:
            return f"{seconds / factor:.3g} {unit}"
    return "not known"


def bytes_of(number):
    """A size of memory."""
    factor, unit = (1e9, "GB") if number >= 1e9 else (1e6, "MB")
    return f"{number / factor:.3g} {unit}"


def _value(value):
    return f"{value:g}" if isinstance(value, float) else str(value)
