"""The figure of a test whose walls shear the sample: τ over γ, the path of stress, and volume."""

import numpy as np

from mufe_fenicsx.analysis.macro import SHEAR_STRESS, triaxial_curves
from mufe_fenicsx.analysis.rows import branches
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import shared_legend, without_spikes
from mufe_fenicsx.report.curves import shade_dynamic
from mufe_fenicsx.report.figure import Drawing

NAME = "shear"
GAMMA = r"Shear strain, $\gamma$: –"
#: What the letters after the names of columns mean.
WHERE = {"xz": "of the top along x", "tz": "of platens that turn"}


def shear_of(history):
    """Letters of the shear of a history: "xz" or "tz"; None where nothing sheared the sample."""
    return next((name[-2:] for name in SHEAR_STRESS if name in history), None)


def draw_shear(source):
    """τ over γ, τ over the vertical stress, and volumetric strain over γ; a colour each stage."""
    history = source.loading
    letters = shear_of(history)
    if letters is None:
        raise InputError("no stage of the test has shear or turn, expected one")
    tau, gamma = history[f"shear_{letters}"], history[f"gamma_{letters}"]
    normal, volume = history["stress"], triaxial_curves(history)["strain_volume"]
    figure, axes = style.new_figure(style.PAGE, 2.6, ncols=3)
    factor, unit = style.unit_of(tau, "Pa")
    across, unit_across = style.unit_of(normal, "Pa")
    label = rf"Shear stress, $\tau$: {unit}"
    panels = (
        (gamma, tau / factor, GAMMA, label),
        (normal / across, tau / factor, rf"Vertical stress, $\sigma_z$: {unit_across}", label),
        (gamma, volume, GAMMA, r"Volumetric strain, $\varepsilon_{\mathrm{vol}}$: –"),
    )
    for i, (axis, (x, y, label_x, label_y)) in enumerate(zip(axes, panels, strict=True)):
        for number, part in enumerate(branches(history)):
            colour = style.SERIES[number % len(style.SERIES)]
            line = style.LINES[number // len(style.SERIES) % len(style.LINES)]
            axis.plot(x[part.rows], y[part.rows], line, color=colour, label=part.stage)
        shade_dynamic(axis, source, x, y, span=False)
        axis.axhline(0, color=style.GREY, linewidth=0.5, zorder=0)
        axis.set(xlabel=label_x, ylabel=label_y)
        without_spikes(axis, x, y)
        style.panel_letter(axis, i)
    shared_legend(axes[0], 6)
    data = {
        "gamma [-]": gamma,
        "shear stress [Pa]": tau,
        "vertical stress [Pa]": normal,
        "volumetric strain [-]": volume,
        "stage": history["stage"],
    }
    if "torque" in history:
        data |= {"torque [N m]": history["torque"], "twist [rad]": history["twist"]}
    return Drawing(
        NAME,
        figure,
        "Shear: (a) shear stress τ against shear strain γ, (b) path in vertical stress and τ, "
        "(c) volumetric strain against γ",
        f"τ is the mean shear stress of both platens, γ the shear strain {WHERE[letters]}; in (c) "
        f"loss of volume is positive. {_largest_ratio(tau, normal)}",
        {"": data},
        "wide",
    )


def _largest_ratio(tau, normal):
    """Words about the largest τ/σz; none without compression."""
    loaded = normal > 0.1 * normal.max(initial=0.0)
    if not loaded.any():
        return ""
    ratio = float(np.abs(tau[loaded] / normal[loaded]).max())
    return f"The largest τ/σz is {ratio:.2f}, atan of which is {np.degrees(np.arctan(ratio)):.0f}°."
