"""Loading: its speed, added mass, static increments, and a packing left at rest."""

import numpy as np

from mufe_fenicsx.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, RED
from mufe_fenicsx.verification.stability import newton, resting, speed

from .common import COMM, columns, safe

#: Speeds of the noise in a packing that rests [m/s].
RESTING = (0.0, 1e-3)


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
    middle.set_ylim(top=30 * middle.get_ylim()[1])
    middle.legend(loc="upper left", fontsize=6)
    colours = [BLACK, BLUE, GREEN, ORANGE, RED, GREY]
    for row, colour in zip(d["curves"], colours, strict=False):
        right.plot(100 * np.array(row["strain"]), np.array(row["stress"]) / 1e6, color=colour,
                   label=f"{row['speed']:g} m/s")  # fmt: skip
    right.set(xlabel="strain [%]", ylabel="stress of the lattice [MPa]")
    right.set_ylim(top=1.45 * right.get_ylim()[1])
    right.legend(loc="upper left", ncols=2, fontsize=6)
    return figure


def measure_mass():
    factors = (1.0, 4.0, 16.0, 64.0, 256.0, 1024.0)
    rows = [speed.column_error(COMM, 0.01, factor) for factor in factors]
    return {
        "rows": rows,
        "limit": speed.limit_of([r.mass_factor for r in rows], [r.error for r in rows]),
        "messages": speed.messages(COMM),
    }


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


def measure_resting():
    return {f"{speed:g}": resting.rest(COMM, speed=speed) for speed in RESTING}


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
        if not on.all():
            right.plot(mu[~on], normal[~on], "x", color=colour, markersize=5,
                       label="it sticks for good")  # fmt: skip
    right.axvline(d["critical"], color=BLACK, linestyle="--", linewidth=0.7)
    safe(right, 0, d["critical"], "slips")
    right.set(xlabel="coefficient of friction", ylabel="normal force / without friction",
              ylim=(0.2, 30), yscale="log")  # fmt: skip
    for axis in (left, right):
        axis.legend(fontsize=6)
    return figure


#: Of each subject what measures it and what draws it.
SUBJECTS = {
    "loading_speed": (measure_loading_speed, draw_loading_speed),
    "mass": (measure_mass, draw_mass),
    "resting": (measure_resting, draw_resting),
    "newton": (measure_newton, draw_newton),
}
