"""The figure of a test by stages: deviator stress, stress path and volumetric strain."""

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from mufe_fenicsx.analysis.macro import friction_angle, triaxial_curves, triaxial_strength
from mufe_fenicsx.analysis.rows import branches
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import shared_legend, without_spikes
from mufe_fenicsx.report.curves import DYNAMIC, shade_dynamic
from mufe_fenicsx.report.figure import Drawing

NAME = "triaxial"
AXIAL = r"Axial strain, $\varepsilon_{\mathrm{a}}$: %"
TOTAL = "total stress"
Q = (
    "q = √(½((σx − σy)² + (σy − σz)² + (σz − σx)²)), negative where the axial stress is less than "
    "the mean of the others"
)
Q_AXIAL = "q = σz − (σx + σy)/2"
PORES = (
    "Stresses are effective ones. The thin grey path is that of total stresses in undrained "
    "stages, p and the pore pressure that keeps the total side stress. "
)
#: So many stages have a line of the legend each; more have a scale of colours.
FEW = 8
#: Change of volume over that of length below which the volume stays, in undrained stages.
STILL = 1e-4


def draw_triaxial(source):
    """q over axial strain, the path in p and q, and volumetric strain; a colour each stage."""
    history = source.loading
    if "strain_z" not in history:
        raise InputError("the test is an oedometer test, expected one by stages")
    curves = triaxial_curves(history)
    undrained = np.any(history.get("pore_pressure", 0.0))
    if undrained:  # its total stress path is a straight line in these terms alone
        curves["q"] = curves["q_axial"]
    figure, axes = style.new_figure(style.PAGE, 2.6, ncols=3)
    strain = 100 * history["strain"]
    factor_q, unit_q = style.unit_of(curves["q"], "Pa")
    factor_p, unit_p = style.unit_of(curves["p"], "Pa")
    q, p, volume = curves["q"] / factor_q, curves["p"] / factor_p, 100 * curves["strain_volume"]
    panels = (
        (strain, q, AXIAL, f"Deviator stress, $q$: {unit_q}"),
        (p, q, f"Mean stress, $p$: {unit_p}", f"Deviator stress, $q$: {unit_q}"),
        (strain, volume, AXIAL, r"Volumetric strain, $\varepsilon_{\mathrm{vol}}$: %"),
    )
    parts = branches(history)
    colours = _colours(len(parts))
    total = p + history.get("pore_pressure", 0.0 * p) / factor_p
    for i, (axis, (x, y, label_x, label_y)) in enumerate(zip(axes, panels, strict=True)):
        for part, colour in zip(parts, colours, strict=True):
            label = part.stage if len(parts) <= FEW else None
            rows = _of_path(part) if axis is axes[1] else part.rows
            axis.plot(x[rows], y[rows], color=colour, label=label)
        if axis is axes[1] and undrained:
            rows = np.where(total != p, total, np.nan)
            axis.plot(rows, q, color=style.GREY, linewidth=0.8, zorder=1)
        if axis is axes[0] and undrained:
            axis.plot([], [], color=style.GREY, linewidth=0.8, label=TOTAL)
        shaded = shade_dynamic(axis, source, x, y, span=False if axis is axes[1] else None)
        axis.axhline(0, color=style.GREY, linewidth=0.5, zorder=0)
        axis.set(xlabel=label_x, ylabel=label_y)
        without_spikes(axis, x, y)
        style.panel_letter(axis, i)
    _draw_scale(figure, axes[2], len(parts))
    shared_legend(axes[0], 6)
    return Drawing(
        NAME,
        figure,
        "Test by stages: (a) deviator stress q against axial strain, (b) stress path in mean "
        "stress p and q, (c) volumetric strain against axial strain",
        "Compression is positive: in (c) loss of volume, so that dilation goes down; the axis of "
        f"the test is z. {Q_AXIAL if undrained else Q}; p = (σx + σy + σz)/3. Stresses are wall "
        f"forces over present areas. {PORES if undrained else ''}"
        f"{_strength(source, history, curves)}"
        f"{f' {DYNAMIC}' if shaded else ''}",
        {
            "": {
                "strain [-]": history["strain"],
                "q [Pa]": curves["q"],
                "p [Pa]": curves["p"],
                "volumetric strain [-]": curves["strain_volume"],
                **_pores(history),
                "stage": history["stage"],
            }
        },
        "wide",
    )


def _of_path(part):
    """Rows of a branch in a path of stresses, which goes on where strain is set to zero."""
    return slice(part.rows.start - part.is_zeroed, part.rows.stop)


def _colours(number):
    """A colour each: of the series while there are few, of a map where there are many."""
    if number <= FEW:
        return style.SERIES[:number]
    return list(matplotlib.colormaps[style.GRAIN_MAP](np.linspace(0, 1, number)))


def _pores(history):
    """The column of the pore pressure; none of runs of earlier versions."""
    if "pore_pressure" not in history:
        return {}
    return {"pore pressure [Pa]": history["pore_pressure"]}


def _draw_scale(figure, axis, number):
    """The colours of many stages beside an axis; few have a legend."""
    if number <= FEW:
        return
    scale = ScalarMappable(Normalize(1, number), style.GRAIN_MAP)
    bar = figure.colorbar(scale, ax=axis, location="right", pad=0.02, label="Stage")
    bar.outline.set_linewidth(0.6)
    bar.locator = MaxNLocator(6, integer=True)


def _strength(source, history, curves):
    """Words about the largest q/p, its friction angle and dilatancy; none without compression."""
    found = triaxial_strength(history, curves)
    if found is None:
        return ""
    strain = style.percent(float(history["strain"][found.row]))
    text = (
        f"The largest q/p is {found.ratio:.2f} at axial strain {strain}, a mobilised friction "
        f"angle of {found.friction_angle:.0f}°"
    )
    if found.is_passed:
        last = f"; at the end of the stage it is {found.last_ratio:.2f}"
        if found.last_ratio > 0:
            last += f" ({friction_angle(found.last_ratio):.0f}°)"
        text += f"{last}."
    else:
        text += ", and it is not passed: no peak is seen."
    slope = found.volume_slope
    if abs(slope) < STILL:
        text += " The volume stays."
    elif slope < 0:
        text += (
            f" There the volume grows by {-slope:.2f} of the axial shortening, a dilatancy angle "
            f"of {found.dilatancy_angle:.0f}°."
        )
    elif slope >= 0:
        text += f" There the volume still falls, by {slope:.2f} of the axial shortening."
    last = source.last_dynamic
    if last is not None and found.row <= last:
        text += " This is where the test is not quasi-static: inertia is in these numbers."
    return text
