"""Figures of a calibration: curves over data, friction, and survival."""

import numpy as np

from ..report import style

#: Curves up to which each has its name in the legend.
NAMED = 6


def draw_curves(path, curves, fit, offsets):
    """Forces over displacements, the same without sizes, and what is left over.

    Args:
        path: File to write.
        curves: List of :class:`~.data.Curve`.
        fit: :class:`~.fit.Fit`.
        offsets: Of each curve [m].
    """
    with style.look():
        figure, (left, middle, right) = style.new_figure(style.PAGE, 2.6, ncols=3)
        for i, (curve, force) in enumerate(zip(curves, fit.curves, strict=True)):
            colour = style.SERIES[i % len(style.SERIES)]
            x, R = curve.displacement - offsets[i], curve.size.radius
            order = np.argsort(x)
            data = {"ls": "", "marker": ".", "ms": 2.5, "alpha": 0.5, "color": colour}
            line = {"lw": 0.9, "color": colour}
            name = curve.name if len(curves) <= NAMED else None
            left.plot(1e6 * x, curve.force, **data)
            left.plot(1e6 * x[order], force[order], label=name, **line)
            middle.plot(100 * x / R, curve.force / R**2 / 1e6, **data)
            middle.plot(100 * x[order] / R, force[order] / R**2 / 1e6, **line)
            rest = 100 * (curve.force - force) / curve.force.max()
            right.plot(100 * x[order] / R, rest[order], lw=0.6, color=colour, alpha=0.7)
        left.set(xlabel="displacement from touch: µm", ylabel="force: N")
        middle.set(xlabel="displacement / $R$: %", ylabel="force / $R^2$: MPa")
        right.set(xlabel="displacement / $R$: %", ylabel="data less model: % of largest force")
        right.axhline(0.0, color=style.GREY, lw=0.6)
        if len(curves) <= NAMED:
            left.legend()
        for k, axis in enumerate((left, middle, right)):
            style.panel_letter(axis, k)
        figure.savefig(path)


def draw_friction(path, curves, found):
    """Tangential over normal force over the tangential displacement, and the fit."""
    with style.look():
        figure, axis = style.new_figure(style.COLUMN, 2.6)
        for i, (curve, force) in enumerate(zip(curves, found.forces, strict=True)):
            colour = style.SERIES[i % len(style.SERIES)]
            name = curve.name if len(curves) <= NAMED else None
            axis.plot(1e6 * curve.displacement, curve.force / curve.normal, ".", ms=2.5,
                      alpha=0.5, color=colour)  # fmt: skip
            axis.plot(1e6 * curve.displacement, force / curve.normal, color=colour, label=name)
        if found.sliding:
            axis.axhline(found.mu, color=style.GREY, lw=0.8, ls="--")
        axis.set(xlabel="tangential displacement: µm", ylabel="tangential / normal force: –")
        axis.set(ylim=(0, None))
        if len(curves) <= NAMED:
            axis.legend()
        figure.savefig(path)


def draw_survival(path, found):
    """Part of the grains that survives a stress, and the same so that Weibull's law is a line."""
    stress = np.sort(found.scaled) / 1e6
    n = stress.size
    survive = 1 - np.arange(1, n + 1) / (n + 1)
    line = np.geomspace(0.7 * stress[0], 1.2 * stress[-1], 200)
    law = np.exp(-((line / (found.strength / 1e6)) ** found.modulus))
    size = f" at {1e3 * found.size:.3g} mm" if found.exponent_interval else ""
    with style.look():
        figure, (left, right) = style.new_figure(style.PAGE, 2.6, ncols=2)
        left.plot(stress, survive, "o", ms=3, label="grains, $1 - i/(n+1)$")
        left.plot(line, law, label=rf"Weibull, $m$ = {found.modulus:.3g}")
        left.set(ylabel="part that survives: –", ylim=(0, 1), xlim=(0, None))
        left.legend()
        right.loglog(stress, -np.log(survive), "o", ms=3)
        shown = (law > 1e-12) & (law < 1 - 0.2 / n)
        right.loglog(line[shown], -np.log(law[shown]))
        right.set(ylabel=r"$\ln(1/P)$: –")
        style.plain_log_ticks(right.xaxis)
        for k, axis in enumerate((left, right)):
            axis.set_xlabel(f"strength $F/d^2${size}: MPa")
            style.panel_letter(axis, k)
        figure.savefig(path)
