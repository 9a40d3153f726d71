"""Inside the grains: ν towards 0.5, plastic flow, elements that turn inside out."""

import numpy as np

from mufe_fenicsx.report.style import BLACK, BLUE, GREEN, GREY, RED
from mufe_fenicsx.verification.stability import incompressible, inversion, plastic

from .common import COMM, columns, safe


def measure_incompressible():
    return {
        "steps": incompressible.step_map(COMM)[0],
        "stiffness": incompressible.locking_map(COMM)[0],
        "messages": incompressible.messages(COMM),
    }


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
    left.legend(loc="lower left", fontsize=6)
    middle.legend(loc="upper left", fontsize=6)
    right.legend()
    return figure


def measure_plastic():
    return {
        "flatten": {e: plastic.flatten(COMM, element=e) for e in ("averaged", "p1")},
        "collapse": plastic.collapse_theory(),
        "necking": plastic.necking(COMM)[0],
        "softening": plastic.softening(COMM)[0],
        "messages": plastic.messages(COMM),
    }


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


def measure_inversion():
    return {
        "rows": inversion.inversion_map(COMM)[0],
        "crushed": inversion.crushed(COMM),
    }


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


#: Of each subject what measures it and what draws it.
SUBJECTS = {
    "incompressible": (measure_incompressible, draw_incompressible),
    "plastic": (measure_plastic, draw_plastic),
    "inversion": (measure_inversion, draw_inversion),
}
