"""Time steps: the stable limit of tetrahedra, contacts, friction and flat elements."""

import math

import numpy as np

from mufe_fenicsx.contact.laws import COMPLIANCE
from mufe_fenicsx.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, RED
from mufe_fenicsx.theory.stability import growth_per_step, rebound_bound, rebound_speed
from mufe_fenicsx.verification.stability import friction, penalty, slivers, time_step

from .common import COMM, DEFAULT, columns, safe


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


def measure_penalty():
    return {"rows": penalty.penalty_map(COMM)[0], "messages": penalty.messages(COMM)}


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


def measure_friction():
    cube, flat = friction.flutter(COMM)[0], friction.flutter(COMM, height=friction.FLAT)[0]
    return {
        "rows": cube,
        "flat": flat,
        "static": friction.static_rows(COMM, flat, friction.FLAT),
        "messages": friction.messages(COMM),
    }


def draw_friction(d, new):
    figure, (left, right) = new(2)
    looks = (("rows", "o", RED, "-", "cube"), ("flat", "s", BLUE, "--", "half as high"))
    for key, mark, colour, line, name in looks:
        mu, measured, theory, highest, drag = columns(
            d[key], "friction", "measured", "theory", "highest", "drag"
        )
        slides = np.abs(drag - mu) <= 1e-3 * mu  # elsewhere a part of the face has not let go
        left.plot(mu[slides], 100 * (theory / highest)[slides], color=BLACK, linestyle=line,
                  label=f"eigenvalues, {name}")  # fmt: skip
        left.plot(mu[slides], 100 * np.maximum(measured / highest, 0)[slides], mark, color=colour,
                  markersize=4, fillstyle="none", label=f"measured, {name}")  # fmt: skip
    left.set(xlabel="coefficient of friction", ylabel="rate of growth / highest frequency [%]")
    left.legend()
    safe(right, 0, 2, "energy accounted for")
    for key, mark, _, line, _ in looks:
        first = key == "rows"
        mu, drag, residual = columns(d[key], "friction", "drag", "residual")
        right.semilogy(mu, np.maximum(np.abs(residual), 1e-12), f"{mark}{line}", color=BLUE,
                       markersize=3.5, label="residual / work" if first else None)  # fmt: skip
        right.semilogy(mu, np.maximum(np.abs(drag - mu), 1e-12), f"{mark}{line}", color=ORANGE,
                       markersize=3.5,
                       label="|drag/normal force − μ|" if first else None)  # fmt: skip
    mu, away = columns(d["static"], "friction", "away")
    right.semilogy(mu, np.maximum(away, 1e-12), "^:", color=GREEN, markersize=3.5,
                   label="forces, static increments / time steps − 1")  # fmt: skip
    right.axhline(0.1, color=GREY, linestyle=":")
    right.text(0.02, 0.12, "stops here", fontsize=6, color=GREY)
    right.set(xlabel="coefficient of friction", ylim=(1e-13, 1e5))
    right.legend(loc="upper left", fontsize=6)
    return figure


def measure_slivers():
    return {"rows": slivers.sliver_map(COMM)[0], "messages": slivers.messages(COMM)}


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


#: Of each subject what measures it and what draws it.
SUBJECTS = {
    "time_step": (measure_time_step, draw_time_step),
    "penalty": (measure_penalty, draw_penalty),
    "friction": (measure_friction, draw_friction),
    "slivers": (measure_slivers, draw_slivers),
}
