"""Contact against theory, on one page with plots.

    python demos/contact_verification.py FOLDER            about fifteen minutes on one core
    python demos/contact_verification.py FOLDER --quick    coarser meshes, five minutes

computes the cases of `mufe verify` that have a theory with a curve (Hertz, stress below a contact,
Mindlin, torsion, rolling, normal and oblique impact), draws what is computed over what is
expected, and writes FOLDER/contact_verification.html with the figures beside it. At the end stand
the tables of further cases. `mufe verify` checks the same against tolerances.
"""

import argparse
import sys
import time
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib
import numpy as np
from mpi4py import MPI

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.report import style
from mufe_fenicsx.report.page import write_page
from mufe_fenicsx.theory import rolling as rolling_theory
from mufe_fenicsx.verification import rolling
from mufe_fenicsx.verification.cases import run_cases
from mufe_fenicsx.verification.hertz import convergence, errors_of
from mufe_fenicsx.verification.hertz_bodies import RADIUS, whole_contact
from mufe_fenicsx.verification.hertz_stress import profile
from mufe_fenicsx.verification.impact import PARTNERS, impact_theory, normal_impact
from mufe_fenicsx.verification.mindlin import shear_balls
from mufe_fenicsx.verification.oblique_impact import rebound, rebound_theory
from mufe_fenicsx.verification.torsion import twist_balls

COMM = MPI.COMM_WORLD
MARKS = "osD^v<"
TABLES = ("patch", "sliding-block", "sliding-facets", "overlap", "feature-pairs")


def hertz_errors(quick):
    """Error of force, size and largest pressure against elements per contact radius."""
    bodies = ["sphere-plane", "spheres-R1:3", "cylinders"]
    meshes = (1.5, 2.5, 4.0) if quick else (1.5, 2.5, 4.0, 6.0)
    figure, axes = style.new_figure(style.PAGE, 2.3, ncols=3, sharex=True, sharey=True)
    for name, mark in zip(bodies, MARKS, strict=False):
        table = convergence(COMM, name, meshes)
        for axis, key in zip(axes, ("force", "size", "p0"), strict=True):
            error = 100 * (np.array(table[key]) - 1)
            axis.plot(table["elements_per_radius"], error, mark + "-", ms=4, label=name)
    for k, (axis, what) in enumerate(
        zip(axes, ("force", "radius", "largest pressure"), strict=True)
    ):
        target = {"force": (2, 1), "radius": (4, 2), "largest pressure": (5, 2.5)}[what]
        for n, error in zip((2.5, 5.0), target, strict=True):
            axis.plot([n, n], [-error, error], color=style.GREY, lw=3, alpha=0.4, zorder=0)
        axis.axhline(0, color=style.BLACK, lw=0.5)
        axis.set(xlabel="elements per contact radius", title=what)
        axis.set_ylim(-12, 12)
        style.panel_letter(axis, k)
    axes[0].set_ylabel("error (%)")
    axes[2].legend()
    return (
        figure,
        "Hertz contact: error against the mesh.",
        "Means over indentations between which the edge of the contact passes over one element, "
        "at a/R = 0.02, against linear elasticity of the whole body. Grey bars: targets. The force "
        "has no order: the contact layer takes out the leading error by one of opposite sign.",
    )


def pressure(quick):
    """Pressure at the facets over that of Hertz."""
    figure, axes = style.new_figure(style.PAGE, 2.4, ncols=2, sharey=True)
    for k, (axis, n) in enumerate(zip(axes, (2.5, 5.0), strict=True)):
        pressed, _ = errors_of(COMM, "sphere-plane", n)
        theory = whole_contact("sphere-plane", pressed_radius(n), 0.15)
        plane, force, area, _ = pressed.contact()
        middle = force @ plane / force.sum()
        r = np.linalg.norm(plane - middle, axis=1) / theory.a
        axis.plot(r, force / area / theory.p0, ".", ms=3, color=style.BLUE, label="facets")
        s = np.linspace(0, 1, 200)
        axis.plot(s, np.sqrt(1 - s**2), color=style.RED, label="Hertz")
        axis.set(xlabel="r / a", title=f"{n:g} elements per contact radius", xlim=(0, 1.5))
        axis.set_ylim(0, 1.4)
        style.panel_letter(axis, k)
    axes[0].set_ylabel("pressure / $p_0$")
    axes[1].legend()
    return (
        figure,
        "Pressure of a ball on a plane at each loaded or nearly loaded facet.",
        "Single facets scatter where the contact ends within them and where the unstructured mesh "
        "has nodes of unlike size; the resultant and moments are what the errors above judge.",
    )


def pressed_radius(n):
    """Contact radius at the last of the indentations of errors_of [m]."""
    return 0.02 * RADIUS * (1 + 0.4 / n)


def stress_below(quick):
    """Von Mises stress on the axis."""
    figure, axis = style.new_figure(style.COLUMN, 2.5)
    for nu, colour in ((0.15, style.BLUE), (0.3, style.RED)):
        found = profile(COMM, 2.5 if quick else 5.0, nu=nu, growth=0.25)
        axis.plot(found["zeta"], found["theory"], color=colour, label=f"Hertz, ν = {nu}")
        axis.plot(found["zeta"][::3], found["computed"][::3], "o", ms=3, color=colour)
    axis.set(xlabel="depth / a", ylabel="von Mises stress / $p_0$")
    axis.legend()
    return (
        figure,
        "Stress on the axis below a ball on a plane.",
        "Circles: computed, from a quadratic fit to the tetrahedra around each place.",
    )


def mindlin(quick):
    """Loops of tangential force."""
    n, growth, periods = (2.5, 0.4, 16) if quick else (5.0, 0.3, 24)
    s = shear_balls(COMM, n, 0.015, 0.3, 0.3, 0.8, growth, periods)
    figure, axis = style.new_figure(style.COLUMN, 2.7)
    limit = 0.3 * s.normal[s.turns[1]]
    again = s.turns[3]
    for part, colour, name in (
        (slice(0, again + 1), style.BLUE, "constant approach"),
        (slice(again, None), style.ORANGE, "both change"),
    ):
        axis.plot(1e9 * s.shift[part], s.force[part] / limit, color=colour, lw=2.2, alpha=0.5,
                  label=f"computed, {name}")  # fmt: skip
    axis.plot(1e9 * s.shift, s.theory / limit, color=style.BLACK, lw=0.7, label="Mindlin, any path")
    axis.set(xlabel="tangential displacement (nm)", ylabel="tangential force / μP")
    axis.legend(loc="upper left")
    error = np.abs(s.force - s.theory).max() / (2 * 0.8 * limit)
    return (
        figure,
        "Two balls sheared to and fro, then with shear and approach together.",
        f"Largest deviation {100 * error:.1f} % of the full range, {n:g} elements per radius.",
    )


def torsion(quick):
    """Loop of the twisting moment."""
    n, growth, periods = (2.5, 0.4, 16) if quick else (5.0, 0.3, 32)
    t = twist_balls(COMM, n, 0.015, 0.15, 0.3, 0.75, growth, periods)
    P, mu, a, _ = t.contact
    figure, axis = style.new_figure(style.COLUMN, 2.7)
    axis.plot(1e3 * t.twist, t.moment / (mu * P * a), color=style.BLUE, lw=2.2, alpha=0.5,
              label="computed")  # fmt: skip
    axis.plot(1e3 * t.twist, t.theory / (mu * P * a), color=style.BLACK, lw=0.7,
              label="Lubkin, Deresiewicz")  # fmt: skip
    axis.axhline(3 * np.pi / 16, color=style.GREY, lw=0.6, ls="--", label="all slips")
    axis.set(xlabel="twist of a ball (mrad)", ylabel="moment / μPa")
    axis.legend(loc="lower right")
    error = np.abs(t.moment - t.theory).max() / (2 * t.theory[t.turns[1]])
    return (
        figure,
        "Two balls twisted to and fro and until they slide.",
        f"Largest deviation {100 * error:.1f} % of the full range, {n:g} elements per radius.",
    )


def roll(quick):
    """What resists free rolling, and the traction by creep."""
    nu, friction, a_over_R, growth, way = 0.25, 0.5, 0.05, 0.4, 8.0
    material = Elastic(rolling.E, nu, rolling.RHO)
    figure, axes = style.new_figure(style.PAGE, 2.4, ncols=2)
    meshes = (2.0, 3.0) if quick else (2.0, 3.0, 4.0)
    for n, colour in zip(meshes, (style.SKY, style.BLUE, style.RED), strict=False):
        free = rolling.roll_balls(COMM, material, friction, 0.0, a_over_R, n, growth, way, 24)
        part = free.moment / (free.normal * free.a)
        axes[0].plot(free.way / free.a, 100 * part, color=colour,
                     label=f"{n:g} elements per radius")  # fmt: skip
    G, a = material.shear_modulus, free.a
    P = free.normal.mean()
    axes[0].set(xlabel="way / a", ylabel="moment / Pa (%)", ylim=(-5, 5))
    axes[0].axhline(0, color=style.BLACK, lw=0.5)
    for ratio, colour in ((0.1, style.BLUE), (0.3, style.RED)):
        creep = ratio * friction * P / (rolling_theory.kalker_coefficient(nu) * G * a**2)
        s = rolling.roll_balls(COMM, material, friction, creep, a_over_R, 3.0, growth, way, 24)
        limit = friction * s.normal
        axes[1].plot(s.way / s.a, np.abs(s.traction) / limit, color=colour,
                     label=f"$C_{{11}}Ga^2ξ/μP$ = {ratio}")  # fmt: skip
        steady = rolling_theory.creep_force(creep, P, friction, a, G, nu) / (friction * P)
        axes[1].axhline(steady, color=colour, lw=0.7, ls="--")
    axes[1].set(xlabel="way / a", ylabel="traction / μP", ylim=(0, None))
    for k, axis in enumerate(axes):
        style.panel_letter(axis, k)
        axis.legend(loc="lower right")
    return (
        figure,
        "Rolling: (a) the moment that only a mesh can have, (b) traction by creep.",
        "Elastic balls without adhesion roll freely. Dashed: steady traction by Kalker, "
        "Shen, Hedrick and Elkins, reached over a length of some contact radii.",
    )


def impacts(quick):
    """Force over time of a head-on impact."""
    figure, axes = style.new_figure(style.PAGE, 2.4, ncols=2, sharey=True)
    for k, (axis, speed) in enumerate(zip(axes, (10.0, 1.0), strict=True)):
        found = normal_impact(COMM, speed, 2.0 if quick else 2.5, time_step_factor=0.9)
        hertz, whole, _ = impact_theory(found.mass, speed)
        for j, (partner, colour) in enumerate(zip(PARTNERS, (style.BLUE, style.RED), strict=True)):
            on = found.force[:, j] > 1e-6 * found.force[:, j].max()
            start = found.time[on][0]
            axis.plot((found.time - start) / hertz.time, found.force[:, j] / hertz.force,
                      color=colour, label=f"on a {partner}")  # fmt: skip
        axis.plot([0, whole.time / hertz.time], [0, 0], "k|", ms=9)
        axis.axhline(whole.force / hertz.force, color=style.BLACK, lw=0.7, ls="--")
        axis.set(xlabel="time / Hertz's contact time", title=f"{speed:g} m/s", xlim=(-0.05, 1.1))
        style.panel_letter(axis, k)
    axes[0].set_ylabel("force / Hertz's largest force")
    axes[0].legend(loc="lower center")
    return (
        figure,
        "Balls that meet a plane, and each other, head on.",
        "Dashed and bars: largest force and contact time by the theory of the whole ball, which "
        "is stiffer than Hertz's half-space.",
    )


def oblique(quick):
    """Angle of rebound over angle of incidence."""
    angles = (0.5, 1.5, 3.0, 5.0) if quick else (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0)
    found = rebound(COMM, on_ball=tuple((psi, 0.0) for psi in angles), time_step_factor=0.9)
    psi = np.linspace(0.05, 1.1 * max(angles), 60)
    figure, axis = style.new_figure(style.COLUMN, 2.6)
    axis.plot(psi, rebound_theory(psi, found.chi), color=style.GREY, ls="--",
              label="Maw et al., half-spaces")  # fmt: skip
    axis.plot(psi, rebound_theory(psi, found.chi, 0.15, 0.04), color=style.BLACK,
              label="whole balls")  # fmt: skip
    axis.plot(found.psi1, found.psi2, "o", ms=4, color=style.RED, label="computed")
    axis.axhline(0, color=style.BLACK, lw=0.5)
    axis.set(xlabel=r"angle of incidence $ψ_1$", ylabel=r"angle of rebound $ψ_2$")
    axis.set_ylim(-1.8, 0.9)
    axis.legend(loc="upper center")
    return (
        figure,
        "Balls that meet obliquely: stick, partial slip and full slip.",
        f"ψ = κ v/μV; sliding throughout from ψ₁ = {4 * found.chi - 1:.1f} on. Largest gain of all "
        f"energies {max(found.gain, 0.0):.1e} of the kinetic one.",
    )


FIGURES = {
    "hertz_errors": (hertz_errors, "wide"),
    "pressure": (pressure, "wide"),
    "stress": (stress_below, "narrow"),
    "mindlin": (mindlin, "narrow"),
    "torsion": (torsion, "narrow"),
    "rolling": (roll, "wide"),
    "impact": (impacts, "wide"),
    "oblique_impact": (oblique, "narrow"),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the page and its figures go")
    parser.add_argument("--quick", action="store_true", help="coarser meshes")
    parser.add_argument("--only", choices=FIGURES, action="append", help="these figures, no tables")
    options = parser.parse_args()
    start = time.perf_counter()
    figures, tables = [], []
    try:
        options.folder.mkdir(parents=True, exist_ok=True)
        for name in options.only or FIGURES:
            draw, width = FIGURES[name]
            print(f"{name} ...", flush=True)
            with matplotlib.rc_context(style.RC):
                figure, caption, how = draw(options.quick)
                path = options.folder / f"{name}.png"
                figure.savefig(path)
            figures.append((path, caption, how, width))
        for name in () if options.only else TABLES:
            print(f"{name} ...", flush=True)
            tables.append((name, _rows(run_cases([name], {}, COMM)[0])))
        page = options.folder / "contact_verification.html"
        write_page(
            page, "Contact against theory", "What the contact operator does to bodies for which "
            "there is an answer on paper.", [], [], figures, tables,
            f"Written by demos/contact_verification.py in {time.perf_counter() - start:.0f} s"
            f"{', with --quick' if options.quick else ''}.",
        )  # fmt: skip
    except (InputError, OSError) as error:
        sys.exit(f"error: {error}")
    print(page)


def _rows(answer):
    rows = [("quantity", "computed", "theory", "error", "tolerance")]
    for name, line in answer["results"].items():
        values = (line[key] for key in ("computed", "theory", "error", "tolerance"))
        rows.append((name, *(f"{value:.4g}" for value in values)))
    return rows


if __name__ == "__main__":
    main()
