"""Size distribution and form of grains in one figure."""

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..image.picture import BLUE, RED, STYLE, length_unit
from .shape import LENGTHS, size_at, sizes_by_mass


def draw_shapes(path, rows):
    """Particle size distribution, Zingg's diagram, and sphericity with convexity.

    Args:
        path: PNG file.
        rows: As by :func:`~mufe_fenicsx.geometry.form.shape.shapes_of_meshes`.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 3.3), layout="constrained")
        FigureCanvasAgg(figure)
        sizes, zingg, form = figure.subplots(1, 3)
        diameter, finer = sizes_by_mass(rows)
        unit, name = length_unit(diameter.max())
        sizes.plot(diameter / unit, 100 * finer, color=BLUE, marker=".", ms=3, lw=1)
        for part in (0.1, 0.5, 0.6):
            d = size_at(rows, part) / unit
            sizes.plot([d, d], [0, 100 * part], color="0.6", lw=0.7, ls=":")
        d10, d50, d60 = (size_at(rows, part) / unit for part in (0.1, 0.5, 0.6))
        sizes.set_title(
            f"$d_{{50}}$ = {d50:.3g} {name}, $C_u$ = $d_{{60}}/d_{{10}}$ = {d60 / d10:.2f}",
            fontsize=9,
        )
        sizes.set(xlabel=f"equivalent diameter: {name}", ylabel="finer by mass: %", ylim=(0, 100))

        flatness, elongation = _columns(rows, "flatness", "elongation")
        zingg.plot(flatness, elongation, ".", color=BLUE, ms=4, alpha=0.7)
        for line in (zingg.axhline, zingg.axvline):
            line(2 / 3, color="0.6", lw=0.7)
        for x, y, text in (
            (0.97, 0.97, "equant"), (0.35, 0.97, "oblate"), (0.97, 0.35, "prolate"),
            (0.35, 0.35, "bladed"),
        ):  # fmt: skip
            zingg.text(x, y, text, ha="right" if x > 0.5 else "left",
                       va="top" if y > 0.5 else "bottom", color="0.4", fontsize=8)  # fmt: skip
        low = min(0.3, flatness.min() - 0.02, elongation.min() - 0.02)
        zingg.set(xlabel="flatness T/W", ylabel="elongation W/L", xlim=(low, 1), ylim=(low, 1))

        sphericity, convexity = _columns(rows, "sphericity", "convexity")
        low = min(sphericity.min(), convexity.min())
        bins = np.linspace(low, max(1.0, sphericity.max()), 25)
        form.hist(sphericity, bins, color=BLUE, alpha=0.7, label="sphericity")
        form.hist(convexity, bins, color=RED, alpha=0.5, label="convexity")
        form.set(xlabel="sphericity, convexity: –", ylabel="grains")
        form.legend(frameon=False, fontsize=8)
        figure.supxlabel(LENGTHS.replace(">=", "≥"), fontsize=7, color="0.4")
        figure.savefig(path)


def _columns(rows, *names):
    return (np.array([row[name] for row in rows]) for name in names)
