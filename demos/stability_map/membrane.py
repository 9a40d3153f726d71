"""The membrane: a sleeve with nothing inside under its cell, and how light it may be."""

import numpy as np

from mufe_fenicsx.report.style import BLACK, BLUE, GREEN, GREY, RED, SKY, plain_log_ticks
from mufe_fenicsx.verification.stability import sleeve

from .common import COMM, safe

#: Pressures over that of a thin ring, and densities over that at which a sleeve sets the step.
PRESSURES = (0.0, 0.5, 1.0, 2.0, 4.0)
DENSITIES = np.geomspace(0.1, 1e3, 13)


def measure_sleeve():
    rows = [sleeve.buckling(COMM, *mesh, PRESSURES)[0] for mesh in sleeve.MESHES]
    theory = sleeve.density_theory(COMM)
    return {
        "rows": rows,
        "pressures": PRESSURES,
        "extrapolated": sleeve.extrapolated(*rows[-2:]),
        "density": sleeve.density_limit(COMM),
        "theory": theory,
        "densities": DENSITIES * theory,
        "steps": sleeve.steps_over_density(COMM, DENSITIES * theory),
        "latex": sleeve.LATEX.rho,
    }


def draw_sleeve(d, new):
    figure, (left, right) = new(2)
    p, fine = np.array(d["pressures"]), np.linspace(0.0, 4.0, 50)
    safe(left, 0, 1, "stays round")
    left.plot(fine, 1 - fine, color=BLACK, label="thin ring")
    for row, colour, mark in zip(d["rows"], (RED, SKY, GREEN, BLUE), "osv^", strict=True):
        layers, square = row["layers"], np.array(row["squares"])
        name = f"{layers} layer{'s'[: layers - 1]}, edges {row['h_over_t']:g} t"
        left.plot(p, square, mark, color=colour, markersize=4, label=name)
        left.plot(fine, 1 - fine / row["limit"], color=colour, linewidth=0.6)
    left.axhline(0.0, color=GREY, linewidth=0.6)
    left.set(xlabel="outer pressure / that of a thin ring", ylabel="ω² of the oval / ω² at rest",
             ylim=(-1.2, 2.3))  # fmt: skip
    left.legend(loc="upper right", fontsize=6)
    rho, steps = np.array(d["densities"]), 1e9 * np.array(d["steps"])
    line = steps.max() * np.minimum(1.0, np.sqrt(rho / d["theory"]))
    right.loglog(rho, line, color=BLACK, label="2/ω, cube and sleeve")
    right.loglog(rho, steps, "s", color=BLUE, markersize=3.5, label="limit of the program")
    right.axvline(d["density"], color=RED, linewidth=0.8, label="measured")
    right.axvline(d["latex"], color=GREY, linestyle=":", label="latex")
    right.set(xlabel="density of the sleeve [kg/m³]", ylabel="time step [ns]")
    plain_log_ticks(right.yaxis)
    right.legend(loc="lower center", fontsize=6)
    return figure


#: Of each subject what measures it and what draws it.
SUBJECTS = {"sleeve": (measure_sleeve, draw_sleeve)}
