"""The stability map: each method driven to failure, its limit beside theory, and who notices.

    python demos/stability.py FOLDER                      all subjects, some minutes
    python demos/stability.py FOLDER SUBJECT ...          some of them
    python demos/stability.py FOLDER SUBJECT --draw       figures again, from the numbers there

Writes SUBJECT.json, the numbers, and SUBJECT.png into FOLDER. The page is demos/stability.md; the
sharp ones of its numbers are cases of `mufe verify`, whose names begin with `stability-`.
"""

import argparse
import json
import math
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib
import numpy as np
from mpi4py import MPI

from mufe_fenicsx.contact.laws import COMPLIANCE
from mufe_fenicsx.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PAGE,
    RC,
    RED,
    new_figure,
    panel_letter,
    plain_log_ticks,
)
from mufe_fenicsx.theory.stability import growth_per_step, rebound_bound, rebound_speed
from mufe_fenicsx.verification.stability import (
    friction,
    incompressible,
    inversion,
    newton,
    overlap,
    penalty,
    plastic,
    resting,
    slivers,
    speed,
    time_step,
    tunnelling,
    unequal,
)

COMM = MPI.COMM_SELF
#: The time step of scenes over the limit.
DEFAULT = 0.9
#: Speeds of the noise in a packing that rests [m/s].
RESTING = (0.0, 1e-3)


def numbers(value):
    """Fields of a measurement that JSON can hold; simulations are left out."""
    if isinstance(value, SimpleNamespace):
        value = vars(value)
    if isinstance(value, dict):
        return {k: numbers(v) for k, v in value.items() if k != "simulation"}
    if isinstance(value, list | tuple):
        return [numbers(v) for v in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.item() if isinstance(value, np.generic) else value


# --- measurements: what is in SUBJECT.json ----------------------------------------------------


def measure_time_step():
    factors = np.concatenate([np.linspace(0.5, 1.0, 6), np.linspace(1.02, 1.5, 13)])
    omega_dt = np.linspace(0.3, 1.8, 46)
    speeds, _more = time_step.rebounds(COMM, omega_dt)
    return {
        "factors": factors,
        "bodies": time_step.time_step_map(COMM, factors),
        "omega_dt": omega_dt,
        "rebound": np.nanmax(speeds, axis=1),
        "rebound_limit": time_step.rebound_limit(COMM)[0],
        "rebound_theory": time_step.rebound_limit_theory(),
        "messages": time_step.messages(COMM),
    }


def measure_penalty():
    return {"rows": penalty.penalty_map(COMM)[0], "messages": penalty.messages(COMM)}


def measure_friction():
    return {"rows": friction.flutter(COMM)[0], "messages": friction.messages(COMM)}


def measure_loading_speed():
    columns = [speed.column_error(COMM, ratio) for ratio in speed.RATIOS]
    curves, _more = speed.packing_curves(COMM)
    return {
        "columns": columns,
        "curves": curves,
        "errors": speed.curve_errors(curves),
        "limit": speed.limit_of([c.ratio for c in columns], [c.error for c in columns]),
        "messages": speed.messages(COMM),
    }


def measure_mass():
    factors = (1.0, 4.0, 16.0, 64.0, 256.0, 1024.0)
    rows = [speed.column_error(COMM, 0.01, factor) for factor in factors]
    return {
        "rows": rows,
        "limit": speed.limit_of([r.mass_factor for r in rows], [r.error for r in rows]),
        "messages": speed.messages(COMM),
    }


def measure_slivers():
    return {"rows": slivers.sliver_map(COMM)[0], "messages": slivers.messages(COMM)}


def measure_overlap():
    return {
        "balls": overlap.overlap_map(COMM)[0],
        "blocks": overlap.overlap_map(COMM, kind="blocks")[0],
        "limits": {kind: overlap.limit(COMM, kind) for kind in ("balls", "blocks")},
        "theory": {kind: overlap.limit_theory(COMM, kind) for kind in ("balls", "blocks")},
        "swallowed": overlap.swallowed(COMM),
    }


def measure_incompressible():
    return {
        "steps": incompressible.step_map(COMM)[0],
        "stiffness": incompressible.locking_map(COMM)[0],
        "messages": incompressible.messages(COMM),
    }


def measure_plastic():
    return {
        "flatten": {e: plastic.flatten(COMM, element=e) for e in ("averaged", "p1")},
        "collapse": plastic.collapse_theory(),
        "necking": plastic.necking(COMM)[0],
        "softening": plastic.softening(COMM)[0],
        "messages": plastic.messages(COMM),
    }


def measure_inversion():
    return {
        "rows": inversion.inversion_map(COMM)[0],
        "crushed": inversion.crushed(COMM),
    }


def measure_impact():
    return {
        "rows": [tunnelling.meet(COMM, v, check=False) for v in tunnelling.SPEEDS],
        "guarded": [tunnelling.meet(COMM, v) for v in tunnelling.SPEEDS],
        "layers": tunnelling.LAYERS,
        "limits": [tunnelling.limit(COMM, c)[0] for c in tunnelling.LAYERS],
        "enough": [tunnelling.theory(c) for c in tunnelling.LAYERS],
        "theory": [tunnelling.stops_theory(c) for c in tunnelling.LAYERS],
        "wall": [tunnelling.through_a_wall(COMM, v) for v in (0.3, 1.0, 2.0)],
    }


def measure_size():
    rows = unequal.size_map(COMM)[0]
    return {
        "rows": rows,
        "steps": [unequal.step_limits(row) for row in rows],
        "pressed": unequal.size_map(COMM, pressure=1e-2)[0],
        "limit": unequal.limit(COMM)[0],
        "theory": unequal.limit_theory(COMM),
    }


def measure_resting():
    return {f"{speed:g}": resting.rest(COMM, speed=speed) for speed in RESTING}


def measure_newton():
    lock, critical = newton.strut_map(COMM, -1.0)
    return {
        "drag": newton.drag_map(COMM)[0],
        "least": newton.least_drag(COMM),
        "against": lock,
        "along": newton.strut_map(COMM, 1.0)[0],
        "critical": critical,
        "locking": newton.locking(COMM),
    }


# --- figures ----------------------------------------------------------------------------------


def columns(rows, *names):
    """Columns of rows of numbers; what is not a number becomes nan."""
    return [
        np.array([r[n] if isinstance(r[n], int | float) else np.nan for r in rows], dtype=float)
        for n in names
    ]


def safe(axis, low, high, label="safe", along="x"):
    """Shade the region where the method holds."""
    span = axis.axvspan if along == "x" else axis.axhspan
    span(low, high, color=GREEN, alpha=0.12, linewidth=0, label=label)


def draw_time_step(d, new):
    figure, (left, middle, right) = new(3, 0.36)
    looks = {
        "free, p1": (BLUE, "o"), "free, averaged": (GREEN, "s"),
        "in contact": (RED, "^"), "flattened": (ORANGE, "v"),
    }  # fmt: skip
    factors = np.array(d["factors"])
    fine = np.linspace(0.5, 1.5, 400)
    safe(left, 0.5, 1.0)
    left.plot(fine, growth_per_step(2 * fine), color=BLACK, label="theory")
    for name, (colour, marker) in looks.items():
        left.plot(factors, d["bodies"][name]["rates"], marker, color=colour, markersize=3.5,
                  label=name)  # fmt: skip
    left.axvline(DEFAULT, color=GREY, linestyle=":")
    left.set(xlabel="Δt / (2/ω)", ylabel="growth of the amplitude in a step", yscale="log")
    left.legend()
    names = list(looks)
    at = np.arange(len(names))
    for k, (key, colour, label) in enumerate(
        (("element", GREY, "single elements"), ("lanczos", BLUE, "Lanczos (program)"),
         ("measured", RED, "measured"))
    ):  # fmt: skip
        value = [d["bodies"][n][key] / d["bodies"][n]["exact"] for n in names]
        middle.barh(at + 0.26 * (k - 1), value, 0.24, color=colour, label=label)
    middle.axvline(1.0, color=BLACK)
    middle.set_yticks(at, [n.replace(", ", "\n") for n in names])
    middle.set(xlabel="limit / (2/ω)", xlim=(0, 1.15), ylim=(-0.6, 4.7))
    middle.legend(loc="upper left", ncols=1, fontsize=6)
    x = np.array(d["omega_dt"])
    fine = np.linspace(0.3, 1.8, 1501)
    phase = (1 + np.arange(400)) / 400
    safe(right, 0.3, math.sqrt(2.0))
    right.plot(fine, rebound_speed(fine[:, None], phase).max(axis=1), color=BLACK, label="theory")
    right.plot(fine, rebound_bound(fine), color=GREY, linestyle="--", label="bound below √2")
    right.plot(x, d["rebound"], "o", color=RED, markersize=3.5, label="tips of tetrahedra")
    right.axvline(DEFAULT * math.sqrt(2.0), color=GREY, linestyle=":")
    right.set(
        xlabel="ω Δt of the spring", ylabel="largest speed after a blow / before", ylim=(0.9, 2)
    )
    right.legend(loc="upper left")
    return figure


def draw_penalty(d, new):
    figure, (left, right) = new(2)
    c, exact, measured, springs, program, soft, theory = columns(
        d["rows"], "c", "exact", "measured", "springs", "program", "soft", "soft_theory"
    )
    unit = 1e9
    left.fill_between(c, np.minimum(exact, springs) * unit * 0, np.minimum(exact, springs) * unit,
                      color=GREEN, alpha=0.12, linewidth=0, label="safe")  # fmt: skip
    left.loglog(c, exact * unit, color=BLACK, label="2/ω, cube and springs")
    left.loglog(c, springs * unit, color=BLACK, linestyle="--", label="√2/ω of springs")
    left.loglog(c, springs[0] * np.sqrt(c / c[0]) * unit, color=GREY, linestyle=":",
                label="∝ √c")  # fmt: skip
    left.loglog(c, measured * unit, "o", color=RED, markersize=4, label="measured")
    left.loglog(c, program * unit, "s", color=BLUE, markersize=3, label="limit of the program")
    left.set(xlabel="compliance c of the layer", ylabel="time step [ns]")
    left.set_ylim(0.5 * springs.min() * unit, 3 * exact.max() * unit)
    right.loglog(c, 100 * theory, color=BLACK, label="2 c h/L in series")
    right.loglog(c, 100 * soft, "o", color=RED, markersize=4, label="measured")
    right.set(xlabel="compliance c of the layer", ylabel="loss of stiffness of a cube [%]")
    for axis in (left, right):
        axis.axvline(COMPLIANCE, color=GREY, linestyle=":")
        axis.legend()
    return figure


def draw_friction(d, new):
    figure, (left, right) = new(2)
    mu, measured, theory, highest, drag, residual = columns(
        d["rows"], "friction", "measured", "theory", "highest", "drag", "residual"
    )
    slides = np.abs(drag - mu) <= 1e-3 * np.maximum(mu, 1e-300)
    slides |= mu == 0  # elsewhere a part of the face has not let go
    left.plot(mu[slides], 100 * (theory / highest)[slides], color=BLACK, label="eigenvalues")
    left.plot(mu[slides], 100 * np.maximum(measured / highest, 0)[slides], "o", color=RED,
              markersize=4, label="measured")  # fmt: skip
    left.set(xlabel="coefficient of friction", ylabel="rate of growth / highest frequency [%]")
    left.legend()
    safe(right, 0, 2, "energy accounted for")
    right.semilogy(mu, np.maximum(np.abs(residual), 1e-12), "o-", color=BLUE, markersize=4,
                   label="residual / work")  # fmt: skip
    right.semilogy(mu, np.maximum(np.abs(drag - mu), 1e-12), "s-", color=ORANGE, markersize=3,
                   label="|drag/normal force − μ|")  # fmt: skip
    right.axhline(0.1, color=GREY, linestyle=":")
    right.text(0.02, 0.12, "stops here", fontsize=6, color=GREY)
    right.set(xlabel="coefficient of friction", ylim=(1e-13, 1))
    right.legend(loc="lower right")
    return figure


def draw_loading_speed(d, new):
    figure, (left, middle, right) = new(3, 0.36)
    one = d["columns"][-2]
    t = np.array(one["times"]) / one["times"][-1]
    scale = one["static"][-1]
    left.plot(t, np.array(one["static"]) / scale, color=BLACK, label="static")
    left.plot(t, np.array(one["sudden"]) / scale, color=GREY, linewidth=0.7, label="fronts, theory")
    left.plot(t, np.array(one["stress"]) / scale, color=RED, linewidth=0.7, label="platen")
    left.set(xlabel="strain / final", ylabel=f"stress / final, v/(c ε) = {one['ratio']:g}")
    left.legend()
    error, kinetic = columns(d["columns"], "error", "kinetic")
    k = np.geomspace(kinetic.min() / 2, kinetic.max() * 2, 50)
    safe(middle, k[0], speed.ERROR**2 / 2)
    middle.loglog(k, 100 * np.sqrt(2 * k), color=BLACK, label="√(2 k)")
    middle.loglog(kinetic, 100 * error, "o", color=RED, markersize=4, label="sudden column")
    errors = np.array(d["errors"][1:])
    middle.loglog(errors[:, 1], 100 * errors[:, 0], "s-", color=BLUE, markersize=4, linewidth=0.7,
                  label="lattice of balls, smooth start")  # fmt: skip
    middle.axvline(0.01, color=GREY, linestyle=":")
    middle.axhline(100 * speed.ERROR, color=GREY, linewidth=0.5)
    middle.set(xlabel="kinetic / internal energy k", ylabel="error of the stress [%]")
    middle.legend(loc="upper left")
    colours = [BLACK, BLUE, GREEN, ORANGE, RED, GREY]
    for row, colour in zip(d["curves"], colours, strict=False):
        right.plot(100 * np.array(row["strain"]), np.array(row["stress"]) / 1e6, color=colour,
                   label=f"{row['speed']:g} m/s")  # fmt: skip
    right.set(xlabel="strain [%]", ylabel="stress of the lattice [MPa]")
    right.legend()
    return figure


def draw_mass(d, new):
    figure, (left, right) = new(2)
    factor, error, theory, kinetic, of_kinetic = columns(
        d["rows"], "mass_factor", "error", "theory", "kinetic", "kinetic_theory"
    )
    safe(left, factor[0], (speed.ERROR / 0.01) ** 2)
    left.loglog(factor, 100 * theory, color=BLACK, label="√F v/(c ε)")
    left.loglog(factor, 100 * error, "o", color=RED, markersize=4, label="measured")
    left.axhline(100 * speed.ERROR, color=GREY, linewidth=0.5)
    left.axvline(2.0, color=GREY, linestyle=":")
    left.set(xlabel="mass of all nodes, factor F", ylabel="error of the stress [%]")
    right.loglog(factor, of_kinetic, color=BLACK, label="F v²/(2 c² ε²)")
    right.loglog(factor, kinetic, "o", color=RED, markersize=4, label="measured")
    right.axhline(0.01, color=GREY, linestyle=":")
    right.set(xlabel="mass of all nodes, factor F", ylabel="kinetic / elastic energy")
    for axis in (left, right):
        axis.legend()
    return figure


def draw_slivers(d, new):
    figure, (left, right) = new(2)
    part, exact, measured, lanczos, element, theory = columns(
        d["rows"], "part", "exact", "measured", "lanczos", "element", "theory"
    )
    unit = 1e9
    left.fill_between(part, 1e-3 * element.min() * unit, exact * unit, color=GREEN, alpha=0.12,
                      linewidth=0, label="safe")  # fmt: skip
    left.loglog(part, exact * unit, color=BLACK, label="2/ω, dense")
    left.loglog(part, theory * unit, color=GREY, linestyle="--", label="apex on its base, ∝ √a")
    left.loglog(part, measured * unit, "o", color=RED, markersize=4, label="measured")
    left.loglog(part, lanczos * unit, "s", color=BLUE, markersize=3, label="Lanczos (program)")
    left.loglog(part, element * unit, "v-", color=ORANGE, markersize=3.5, linewidth=0.7,
                label="bound of elements, ∝ a")  # fmt: skip
    left.set(xlabel="altitude of the flat element / others", ylabel="time step [ns]")
    left.set_ylim(0.5 * element.min() * unit, 2 * exact.max() * unit)
    right.semilogx(part, exact.max() / exact, color=BLACK, label="assembled limit")
    right.loglog(part, element.max() / element, color=ORANGE, label="bound of elements")
    right.set(xlabel="altitude of the flat element / others", ylabel="steps, over those without it")
    for axis in (left, right):
        axis.legend()
    return figure


def draw_overlap(d, new):
    figure, axes = new(2)
    for axis, kind in zip(axes, ("balls", "blocks"), strict=True):
        depth, found, gained, parted = columns(d[kind], "depth", "found", "gained", "parted")
        edge = d["limits"][kind]
        accepted = np.array([not r["message"] for r in d[kind]])
        safe(axis, 0, depth[accepted].max(), "starts; no energy comes of it")
        axis.axvspan(depth[accepted].max(), 3.2, color=RED, alpha=0.1, linewidth=0, label="refused")
        axis.plot(depth, depth, color=BLACK, linewidth=0.7, label="overlap")
        axis.plot(depth, found, "o", color=BLUE, markersize=4, label="deepest point found")
        axis.plot(depth, parted, "s", color=GREEN, markersize=3.5, label="after parting by 0.3 h")
        worst = np.nanmax(np.abs(gained))
        axis.set(
            xlabel=f"overlap of two {kind} / h", ylabel="depth / h", xlim=(0, 3.2), ylim=(0, 3.2)
        )
        axis.set_title(f"energy gained < {max(worst, 1e-16):.0e}; refused from {edge:.2f} edges",
                       loc="right", fontsize=6.5)  # fmt: skip
        axis.legend(loc="upper left")
    return figure


def draw_incompressible(d, new):
    figure, (left, middle, right) = new(3, 0.36)
    nu, slow, p1, averaged, p1_measured, a_measured = columns(
        d["steps"], "nu", "slowness", "p1", "averaged", "p1_measured", "averaged_measured"
    )
    x = 1 - 2 * nu
    for value, measured, colour, name in (
        (p1, p1_measured, RED, "plain"), (averaged, a_measured, BLUE, "averaged"),
    ):  # fmt: skip
        left.loglog(x, value / value[0], color=colour, label=f"{name}: 2/ω")
        left.loglog(x, measured / value[0], "o", color=colour, markersize=4, fillstyle="none")
    left.loglog(x, slow / slow[0], color=BLACK, linestyle="--", label="1/c of compression waves")
    left.set(xlabel="1 − 2ν", ylabel="time step, over that at ν = 0.15")
    nu, p1, averaged, fine, two, rough, smooth = columns(
        d["stiffness"], "nu", "p1", "averaged", "fine", "two", "p1_uneven", "averaged_uneven"
    )
    x = 1 - 2 * nu
    middle.loglog(x, fine, color=BLACK, label="averaged, 6 bricks high")
    middle.loglog(x, averaged, "s-", color=BLUE, markersize=3.5, label="averaged, 4 bricks")
    middle.loglog(x, two, "v-", color=GREEN, markersize=3.5, label="averaged, 2 bricks")
    middle.loglog(x, p1, "o-", color=RED, markersize=3.5, label="plain, 4 bricks")
    middle.set(xlabel="1 − 2ν", ylabel="stress/(E strain) of a glued block")
    right.loglog(x, rough, "o-", color=RED, markersize=3.5, label="plain")
    right.loglog(x, smooth, "s-", color=BLUE, markersize=3.5, label="averaged")
    right.set(xlabel="1 − 2ν", ylabel="pressure about a smooth one / mean")
    for axis in (left, middle, right):
        axis.invert_xaxis()
        axis.legend()
    return figure


def draw_plastic(d, new):
    figure, (left, middle, right) = new(3, 0.36)
    safe(left, 0, 100 * d["collapse"])
    for element, colour in (("averaged", BLUE), ("p1", RED)):
        one = d["flatten"][element]
        left.plot(100 * np.array(one["strain"]), one["stress"], color=colour, linewidth=0.8,
                  label=f"{'plain' if element == 'p1' else element}")  # fmt: skip
    left.axhline(1.0, color=BLACK, linewidth=0.6)
    left.axvline(100 * d["collapse"], color=GREY, linestyle=":")
    left.set(xlabel="flattened by [%]", ylabel="stress / yield stress", ylim=(0, 1.5))
    ratio, measured = columns(d["necking"], "ratio", "measured")
    fine = np.linspace(0.01, ratio.max(), 300)
    middle.plot(fine, np.maximum(1 - 1 / fine, 0), color=BLACK, label="Considère: 1 − Y/H")
    middle.plot(ratio, measured, "o", color=RED, markersize=4, label="largest force")
    middle.fill_between(fine, 0, np.maximum(1 - 1 / fine, 0), color=GREEN, alpha=0.12, linewidth=0,
                        label="stays even")  # fmt: skip
    middle.set(xlabel="hardening / yield stress H/Y", ylabel="strain of the bar")
    for row, colour in zip(d["softening"], (BLUE, GREEN, RED), strict=False):
        c = row["course"]
        right.plot(100 * np.array(c["way"]), c["force"], color=colour, linewidth=0.8,
                   label=f"{row['layers']} layers")  # fmt: skip
    right.set(xlabel="drawn out by [%]", ylabel="force / (Y A), softening bar")
    right.set_title("refused by J2", loc="right", fontsize=6.5)
    left.legend(loc="lower center")
    middle.legend(loc="lower right", fontsize=6)
    right.legend()
    return figure


def draw_inversion(d, new):
    figure, (left,) = new(1, 0.5)
    nu, theory, measured = columns(d["rows"], "nu", "theory", "measured")
    k = np.linspace(0, 0.47, 100)
    speed_of = theory[0] * np.sqrt(1 / (1 - 2 * k))
    left.fill_between(k, 0, speed_of / 1e3, color=GREEN, alpha=0.12, linewidth=0, label="safe")
    left.plot(k, speed_of / 1e3, color=BLACK, label="√(32 K/3ρ)")
    left.plot(nu, measured / 1e3, "o", color=RED, markersize=4, label="measured")
    left.set(xlabel="Poisson's ratio", ylabel="speed that turns a tetrahedron inside out [km/s]")
    left.legend()
    return figure


def draw_impact(d, new):
    figure, (left, middle, right) = new(3, 0.36)
    v, deepest, after = columns(d["rows"], "speed", "deepest", "after")
    noticed = np.array([bool(r["message"]) for r in d["guarded"]])
    safe(left, v[0], d["theory"][0])
    left.loglog(v, deepest, "o-", color=BLUE, markersize=4, label="without the check")
    left.loglog(v[noticed], deepest[noticed], "s", color=RED, markersize=7, fillstyle="none",
                label="the program stops")  # fmt: skip
    left.axhline(0.1, color=BLACK, linewidth=0.6)
    left.axhline(0.5, color=RED, linewidth=0.6, linestyle="--")
    left.set(xlabel="speed of approach / of waves", ylabel="largest depth / edge of facets",
             ylim=(0.02, 60))  # fmt: skip
    left.legend(loc="upper left", fontsize=6)
    safe(middle, v[0], d["theory"][0])
    middle.semilogx(v, after, "o-", color=BLUE, markersize=4)
    middle.axhline(-1, color=GREY, linewidth=0.6)
    middle.axhline(1, color=RED, linewidth=0.6)
    middle.text(v[0], 0.95, "through each other", fontsize=6.5, color=RED, va="top")
    middle.text(v[0], -0.88, "bounced", fontsize=6.5, color=GREY, va="bottom")
    middle.set(xlabel="speed of approach / of waves", ylabel="relative speed after / before")
    c = np.array(d["layers"])
    right.loglog(c, d["enough"], color=BLACK, linestyle="--", label="layers just carry it")
    right.loglog(c, d["theory"], color=BLACK, label="0.5 h deep while they meet")
    right.fill_between(c, 1e-2, d["enough"], color=GREEN, alpha=0.12, linewidth=0, label="safe")
    right.loglog(c, d["limits"], "o", color=RED, markersize=4, label="long bars")
    right.axvline(COMPLIANCE, color=GREY, linestyle=":")
    plain_log_ticks(right.xaxis)
    right.set(xlabel="compliance c of the layers", ylabel="speed at which bars sink / of waves",
              ylim=(0.005, 0.6))  # fmt: skip
    right.legend(fontsize=6, loc="lower left")
    return figure


def draw_size(d, new):
    figure, (left, right) = new(2)
    (ratio,) = columns(d["rows"], "ratio")
    alone, measured, step = columns(d["steps"], "alone", "measured", "step")
    left.loglog(ratio, alone / ratio / alone[0], color=BLACK, label="2/ω of the small one alone")
    left.loglog(ratio, measured / ratio / alone[0], "o", color=RED, markersize=4,
                label="measured limit")  # fmt: skip
    left.loglog(ratio, step / ratio / alone[0], "s", color=BLUE, markersize=3, fillstyle="none",
                label="program: what is near counts as closed")  # fmt: skip
    left.set(xlabel="size of the neighbour / size", ylabel="time step, over 2/ω of equals")
    for name, colour, label in (("rows", BLUE, "p = 0.001 E"), ("pressed", RED, "p = 0.01 E")):
        ratio, depth, theory = columns(d[name], "ratio", "depth", "theory")
        stops = np.array([bool(r["message"]) for r in d[name]])
        right.loglog(ratio, theory, color=colour, linewidth=0.8)
        right.loglog(ratio[~stops], depth[~stops], "o", color=colour, markersize=4, label=label)
        right.loglog(ratio[stops], depth[stops], "x", color=colour, markersize=5,
                     label=f"{label}: the program stops")  # fmt: skip
    right.axhline(0.5, color=GREY, linestyle=":")
    safe(right, right.get_ylim()[0], 0.5, along="y")
    right.set(xlabel="size of the neighbour / size", ylabel="depth of the small one / its h")
    for axis in (left, right):
        axis.legend()
    return figure


def draw_resting(d, new):
    figure, (left, right) = new(2)
    for (noise, rows), colour in zip(d.items(), (BLUE, RED), strict=True):
        step, energy, force, kinetic = (
            np.array(rows[name]) for name in ("step", "energy", "force", "kinetic")
        )
        label = "at rest" if float(noise) == 0 else f"shaken, {float(noise):g} m/s"
        left.loglog(step, np.maximum(np.abs(energy), 1e-17), color=colour, linewidth=0.7,
                    label=f"{label}: energy from nowhere")  # fmt: skip
        left.loglog(step, kinetic, color=colour, linewidth=0.7, linestyle=":",
                    label=f"{label}: kinetic")  # fmt: skip
        right.loglog(step, force, color=colour, linewidth=0.7, label=label)
    eps = np.finfo(float).eps
    left.loglog(step, step * eps, color=BLACK, linewidth=0.8, label="ε a step, all of one sign")
    left.loglog(step, np.sqrt(step) * eps, color=GREY, linewidth=0.8, label="ε a step at random")
    left.set(xlabel="time steps", ylabel="energy / stored energy", ylim=(1e-31, 1e-7))
    right.set(xlabel="time steps", ylabel="largest change of a wall's force / platen's")
    left.legend(fontsize=6, loc="lower right")
    right.legend(fontsize=6)
    return figure


def draw_newton(d, new):
    figure, (left, right) = new(2)
    s, error, theory = columns(d["drag"], "stabilisation", "error", "theory")
    safe(left, s[0], 0.05 / (theory[-1] / s[-1]))
    left.loglog(s, theory, color=BLACK, label="s E*/(2 n K)")
    left.loglog(s, error, "o", color=RED, markersize=4, label="top − bottom force / mean")
    left.axvline(1e-6, color=GREY, linestyle=":")
    left.set(xlabel="stabilisation s", ylabel="error of the force")
    for name, colour, label in (
        ("against", RED, "into the plane"),
        ("along", BLUE, "away from it"),
    ):
        mu, normal, slide = columns(d[name], "friction", "normal", "sliding")
        fine = np.linspace(0, 2, 400)
        k = (1 / np.array([r["theory"] for r in d[name]]) - 1) / mu
        law = 1 / (1 + k[0] * fine)
        right.plot(fine, np.where(law > 0, law, np.nan), color=colour, linewidth=0.8)
        on = slide > 0
        right.plot(mu[on], normal[on], "o", color=colour, markersize=4, label=f"dragged {label}")
        right.plot(
            mu[~on], normal[~on], "x", color=colour, markersize=5, label="it sticks for good"
        )
    right.axvline(d["critical"], color=BLACK, linestyle="--", linewidth=0.7)
    safe(right, 0, d["critical"], "slips")
    right.set(xlabel="coefficient of friction", ylabel="normal force / without friction",
              ylim=(0.2, 30), yscale="log")  # fmt: skip
    for axis in (left, right):
        axis.legend(fontsize=6)
    return figure


SUBJECTS = {
    "time_step": (measure_time_step, draw_time_step),
    "penalty": (measure_penalty, draw_penalty),
    "friction": (measure_friction, draw_friction),
    "loading_speed": (measure_loading_speed, draw_loading_speed),
    "mass": (measure_mass, draw_mass),
    "slivers": (measure_slivers, draw_slivers),
    "overlap": (measure_overlap, draw_overlap),
    "incompressible": (measure_incompressible, draw_incompressible),
    "plastic": (measure_plastic, draw_plastic),
    "inversion": (measure_inversion, draw_inversion),
    "impact": (measure_impact, draw_impact),
    "size": (measure_size, draw_size),
    "resting": (measure_resting, draw_resting),
    "newton": (measure_newton, draw_newton),
}


def draw(name, data, folder):
    """The figure of a subject."""

    def new(panels, height=0.42):
        width = PAGE if panels > 1 else 0.6 * PAGE
        figure, axes = new_figure(width, height * PAGE, ncols=panels)
        axes = np.atleast_1d(axes)
        if panels > 1:
            for k, axis in enumerate(axes):
                panel_letter(axis, k)
        return figure, axes

    with matplotlib.rc_context(RC):
        SUBJECTS[name][1](data, new).savefig(folder / f"{name}.png", dpi=130)


def main(arguments=None):
    """Measure and draw the subjects that were asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("subjects", nargs="*", metavar="SUBJECT", help=", ".join(SUBJECTS))
    parser.add_argument("--draw", action="store_true", help="from the numbers in FOLDER")
    given = parser.parse_args(arguments)
    unknown = [name for name in given.subjects if name not in SUBJECTS]
    if unknown:
        parser.error(f"subject {unknown[0]}, expected one of {', '.join(SUBJECTS)}")
    given.folder.mkdir(parents=True, exist_ok=True)
    for name in given.subjects or SUBJECTS:
        path, begin = given.folder / f"{name}.json", time.perf_counter()
        if not given.draw:
            path.write_text(json.dumps(numbers(SUBJECTS[name][0]()), indent=1))
        draw(name, json.loads(path.read_text()), given.folder)
        print(f"{name}: {time.perf_counter() - begin:.1f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
