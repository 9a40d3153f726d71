"""Grains that yield: which tetrahedra lock, and what a plastic contact is worth on a mesh.

    python demos/locking.py FOLDER            about ten minutes on one core
    python demos/locking.py FOLDER --quick    coarser meshes, under three minutes on an idle one

Plastic flow keeps volume. Linear tetrahedra that each keep their own volume have too few ways to
flow: they lock, and the mean pressure of a plastic contact, 2.8 times the yield stress by
theory, comes out too high. With the pressure averaged at nodes (Bonet & Burton 1998) it does
not. The page shows both against the mesh, against the curves of Jackson & Green, the ball of
figure 8 of Nadimi & Fonseca, and restitution against Thornton. `mufe verify plastic-sphere
paper-sphere plastic-impact` checks the same against tolerances.
"""

import argparse
import math
import sys
import time
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib
import numpy as np
from matplotlib.collections import PolyCollection
from mpi4py import MPI

from mufe_fenicsx.bulk.solid import von_mises
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.page import write_page
from mufe_fenicsx.theory import plastic_impact as impact_theory
from mufe_fenicsx.verification import plastic_impact
from mufe_fenicsx.verification.paper_sphere import YIELD, force_curve
from mufe_fenicsx.verification.plastic_ball import FRAME, RADIUS
from mufe_fenicsx.verification.plastic_sphere import (
    STEEL_YIELD,
    curve,
    mean_pressure,
    on_curve,
    onset_of,
    steel,
)

COMM = MPI.COMM_SELF
#: Elements on the page, names of solid.ELEMENTS: label, colour, mark.
ELEMENTS = {
    "p1": ("plain linear", style.RED, "s"),
    "averaged": ("averaged nodal pressure", style.BLUE, "o"),
    "composite": ("composite of eight", style.GREEN, "^"),
}
APPROACH = 0.004


def locking(quick):
    """Mean pressure against elements per contact radius."""
    meshes = (1.5, 2.5, 3.5, 5.0) if quick else (1.5, 2.5, 3.5, 5.0, 7.5, 10.0)
    figure, axes = style.new_figure(style.PAGE, 2.6, ncols=2, sharey=True)
    rows = [("ν", "element", *(f"{n:g} per radius" for n in meshes))]
    for k, (axis, nu) in enumerate(zip(axes, (0.15, 0.3), strict=True)):
        for element, (label, colour, mark) in ELEMENTS.items():
            p = [mean_pressure(COMM, nu, 1000.0, n, element=element)[0] for n in meshes]
            axis.plot(meshes, p, mark + "-", ms=4, color=colour, label=label)
            rows.append((f"{nu:g}", label, *(f"{value:.2f}" for value in p)))
        # The last one is of the default element.
        finest = p[-1]
        axis.axhspan(0.97 * finest, 1.03 * finest, color=style.GREY, alpha=0.25, lw=0,
                     label=f"±3 % of {finest:.2f}")  # fmt: skip
        axis.set(xlabel="elements per contact radius", title=f"ν = {nu}")
        axis.set_xlim(0, meshes[-1] + 0.5)
        style.panel_letter(axis, k)
    axes[0].set_ylabel("mean pressure / yield stress")
    axes[0].set_ylim(2, None)
    axes[1].legend()
    return (
        figure,
        "Mean contact pressure of a perfectly plastic ball under a rigid plane.",
        "E/Y = 1000, contact radius a tenth of the ball's. Means over a growth of the contact by "
        "one element. Grey: the averaged element on the finest mesh.",
        rows,
    )


def over_approach(quick):
    """Force and pressure over approach, with Jackson and Green."""
    n = 3.0 if quick else 5.0
    depths = np.array([5.0, 10.0, 20.0, 50.0, 100.0])
    figure, axes = style.new_figure(style.PAGE, 2.6, ncols=2)
    material = steel()
    delta_c, force_c, _ = onset_of(material)
    d = np.geomspace(2, 150, 200)
    force, radius = curve(d * delta_c)
    axes[0].semilogx(d, force / force_c / d**1.5, color=style.BLACK, label="Jackson & Green")
    axes[1].semilogx(d, force / (np.pi * radius**2) / STEEL_YIELD, color=style.BLACK,
                     label="Jackson & Green")  # fmt: skip
    rows = [("element", *(f"δ/δc = {depth:g}" for depth in depths))]
    for element, (label, colour, mark) in ELEMENTS.items():
        found = [on_curve(COMM, depth, n, element=element)[1:] for depth in depths]
        force, radius = (np.array([pair[i] for pair in found]) for i in (0, 1))
        pressure = force[:, 0] / (np.pi * radius[:, 0] ** 2) / STEEL_YIELD
        hertz = force_c * depths**1.5
        axes[0].semilogx(depths, force[:, 0] / hertz, mark, ms=4, color=colour, label=label)
        axes[1].semilogx(depths, pressure, mark, ms=4, color=colour, label=label)
        error = 100 * (force[:, 0] / force[:, 1] - 1)
        rows.append((label, *(f"{value:+.1f} %" for value in error)))
    axes[0].set(xlabel="approach / approach of onset", ylabel="force / force of Hertz")
    axes[0].set_ylim(0, None)
    axes[1].set(xlabel="approach / approach of onset", ylabel="mean pressure / yield stress")
    axes[1].set_ylim(0, None)
    for k, axis in enumerate(axes):
        style.panel_letter(axis, k)
        axis.legend()
    return (
        figure,
        "A steel ball from the onset of yield to full plasticity.",
        f"E/Y = 357, ν = 0.32; each mark a mesh of {n:g} elements per contact radius at that "
        "approach. A locked element makes the pressure too high and the contact too small: the "
        "force over approach hides most of it.",
        rows,
    )


def paper(quick):
    """Figure 8 of the paper and a cut through the stress below."""
    meshes = ((3.0, "--"), (5.0, "-")) if quick else ((5.0, "--"), (7.5, "-"))
    figure, (left, right) = style.new_figure(style.PAGE, 2.9, ncols=2)
    for Y, colour in zip(
        YIELD[::-1], (style.SKY, style.BLUE, style.ORANGE, style.RED), strict=True
    ):
        for n, line in meshes:
            course = force_curve(COMM, Y, n, APPROACH)
            way = APPROACH * np.linspace(0, 1, 81)[1:]
            force = [_smooth(course, part / APPROACH, n) for part in way]
            left.plot(way * 1e3, force, line, color=colour,
                      label=f"{Y / 1e6:g} MPa" if line == "-" else None)  # fmt: skip
    left.set(xlabel="approach / radius of the ball (‰)", ylabel="force (N)")
    left.set(xlim=(0, None), ylim=(0, None))
    left.legend(title="yield stress", loc="upper left", reverse=True)
    stress_cut(figure, right, course.simulation, math.sqrt(2 * APPROACH) * RADIUS)
    style.panel_letter(left, 0)
    style.panel_letter(right, 1)
    return (
        figure,
        "The ball of figure 8 of Nadimi & Fonseca (2018): (a) force, (b) von Mises stress.",
        "E = 100 GPa, ν = 0.15, radius 1 mm, yield stress as marked, hardening by 100 MPa "
        f"until a plastic strain of 0.05. Dashed: {meshes[0][0]:g} elements per contact radius at "
        f"the end, solid: {meshes[1][0]:g}. (b): yield 40 MPa at the end, a cut through the axis, "
        "each tetrahedron with its own stress.",
        None,
    )


def _smooth(course, part, n):
    """Force at a part of the way [N]; a contact below one element is not averaged."""
    way = course.approach[-1] / (1 + 0.5 / n) ** 2
    elements = max(n * math.sqrt(part), 1.0)
    return course.mean(elements, part * way)[1]


def stress_cut(figure, axis, s, a):
    """Draw the von Mises stress on a plane through the axis of the ball.

    Args:
        figure, axis: Where to.
        s: Simulation of the pressed ball.
        a: Contact radius [m]; 3.5 of it to each side are drawn.
    """
    x = s.state.x @ FRAME
    q = von_mises(s.state.deviator) / 1e6
    polygons, values = [], []
    top = float(s.walls.point[s.walls.names.index("plane")] @ FRAME[:, 2])
    near = (np.abs(x[s.mesh.cells]).min(axis=1)[:, 0] < 4 * a) & (
        x[s.mesh.cells, 2].max(axis=1) > top - 4.5 * a
    )
    for cell in np.flatnonzero(near):
        corners = x[s.mesh.cells[cell]]
        cut = section(corners[:, [0, 2]], corners[:, 1])
        if cut is not None:
            polygons.append((cut - [0.0, top]) * 1e6)
            values.append(q[cell])
    drawn = PolyCollection(
        polygons, array=np.array(values), cmap=style.STRESS_MAP, edgecolors="face", lw=0.2
    )
    axis.add_collection(drawn)
    axis.axhline(0, color=style.BLACK, lw=1.2)
    axis.set(xlim=(-3.5e6 * a, 3.5e6 * a), ylim=(-4e6 * a, 0.4e6 * a), aspect="equal")
    axis.set(xlabel="from the axis (µm)", ylabel="from the plane (µm)")
    figure.colorbar(drawn, ax=axis, label="von Mises stress (MPa)")


def section(points, side):
    """Where a tetrahedron meets the plane side = 0: a polygon, or None.

    Args:
        points: Coordinates of its corners in the plane, shape (4, 2).
        side: Their distances from it, shape (4,).
    """
    ends = [(i, j) for i in range(4) for j in range(i) if side[i] * side[j] < 0]
    if len(ends) < 3:
        return None
    cut = np.array([
        (side[i] * points[j] - side[j] * points[i]) / (side[i] - side[j]) for i, j in ends
    ])  # fmt: skip
    arm = cut - cut.mean(axis=0)
    return cut[np.argsort(np.arctan2(arm[:, 1], arm[:, 0]))]


def impacts(quick):
    """Restitution against the speed of impact."""
    speeds = np.array([10.0, 30.0, 100.0] if quick else [3.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0])
    n, nu, ratio = 2.5, 0.3, 300.0
    figure, axis = style.new_figure(style.COLUMN, 2.7)
    v = np.geomspace(1, 300, 100)
    for p, line in ((plastic_impact.LOW, "--"), (plastic_impact.HIGH, ":")):
        v_yield = (p / plastic_impact.LOW) ** 2.5
        axis.semilogx(v, impact_theory.restitution(v, v_yield), line, color=style.BLACK, lw=0.9,
                      label=f"Thornton, limit {p} Y")  # fmt: skip
    mass = 4 / 3 * math.pi * plastic_impact.RADIUS**3 * plastic_impact.RHO
    modulus, Y = plastic_impact.E / (1 - nu**2), plastic_impact.E / ratio
    v_yield = impact_theory.yield_speed(
        plastic_impact.LOW * Y, modulus, mass, plastic_impact.RADIUS
    )
    band = np.array([
        plastic_impact.by_curve(0.5 * mass * (v_yield * factor) ** 2, modulus, Y, nu)
        for factor in v
    ])  # fmt: skip
    plastic = band[:, 1] < 0.999
    axis.fill_between(
        v[plastic], *band[plastic].T, color=style.GREY, alpha=0.35, lw=0, label="Jackson & Green"
    )
    for element, (label, colour, mark) in ELEMENTS.items():
        e = [
            plastic_impact.rebound(
                COMM, speed, n, nu, ratio, element=element
            ).restitution
            for speed in speeds
        ]  # fmt: skip
        axis.semilogx(speeds, e, mark, ms=4, color=colour, label=label)
    axis.set(xlabel="speed of impact / speed of first yield", ylabel="restitution", ylim=(0, 1.05))
    axis.legend(loc="lower left")
    return (
        figure,
        "Restitution of a perfectly plastic ball on a rigid plane.",
        f"E/Y = {ratio:g}, ν = {nu}, {n:g} elements per contact radius. Thornton keeps a² = Rδ: "
        "with one limiting pressure he fits one range of speeds. Grey: force and radius of Jackson "
        "& Green with elastic unloading, from an even pressure to that of Hertz, from where "
        "they leave Hertz.",
        None,
    )


FIGURES = {
    "locking": (locking, "wide"),
    "over_approach": (over_approach, "wide"),
    "paper": (paper, "wide"),
    "impact": (impacts, "narrow"),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the page and its figures go")
    parser.add_argument("--quick", action="store_true", help="coarser meshes")
    parser.add_argument("--only", choices=FIGURES, action="append", help="these figures")
    options = parser.parse_args()
    start = time.perf_counter()
    figures, tables = [], []
    try:
        options.folder.mkdir(parents=True, exist_ok=True)
        for name in options.only or FIGURES:
            draw, width = FIGURES[name]
            print(f"{name} ...", flush=True)
            with matplotlib.rc_context(style.RC):
                figure, caption, how, rows = draw(options.quick)
                path = options.folder / f"{name}.png"
                figure.savefig(path)
            figures.append((path, caption, how, width))
            if rows:
                tables.append((TITLES[name], rows))
        page = options.folder / "locking.html"
        write_page(
            page, "Grains that yield", "Which tetrahedra lock under plastic flow, and what a "
            "plastic contact is worth on a mesh.", [], [], figures, tables,
            f"Written by demos/locking.py in {time.perf_counter() - start:.0f} s"
            f"{', with --quick' if options.quick else ''}.",
        )  # fmt: skip
    except (InputError, OSError) as error:
        sys.exit(f"error: {error}")
    print(page)


#: Of the tables.
TITLES = {
    "locking": "Mean pressure over yield stress, E/Y = 1000",
    "over_approach": "Force against Jackson & Green",
}


if __name__ == "__main__":
    main()
