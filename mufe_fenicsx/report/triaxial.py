"""The figure of a test by stages: deviator stress, stress path and volumetric strain."""

from mufe_fenicsx.analysis.macro import friction_angle, triaxial_curves, triaxial_strength
from mufe_fenicsx.analysis.rows import branches
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import shared_legend, without_spikes
from mufe_fenicsx.report.curves import DYNAMIC, shade_dynamic
from mufe_fenicsx.report.figure import Drawing

NAME = "triaxial"
AXIAL = r"Axial strain, $\varepsilon_{\mathrm{a}}$: %"


def draw_triaxial(source):
    """q over axial strain, the path in p and q, and volumetric strain; a colour each stage."""
    history = source.loading
    if "strain_z" not in history:
        raise InputError("the test is an oedometer test, expected one by stages")
    curves = triaxial_curves(history)
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
    for i, (axis, (x, y, label_x, label_y)) in enumerate(zip(axes, panels, strict=True)):
        for number, part in enumerate(branches(history)):
            colour = style.SERIES[number % len(style.SERIES)]
            line = style.LINES[number // len(style.SERIES) % len(style.LINES)]
            axis.plot(x[part.rows], y[part.rows], line, color=colour, label=part.stage)
        shaded = shade_dynamic(axis, source, x, y, span=False if axis is axes[1] else None)
        axis.axhline(0, color=style.GREY, linewidth=0.5, zorder=0)
        axis.set(xlabel=label_x, ylabel=label_y)
        without_spikes(axis, x, y)
        style.panel_letter(axis, i)
    shared_legend(axes[0], 6)
    return Drawing(
        NAME,
        figure,
        "Test by stages: (a) deviator stress q against axial strain, (b) stress path in mean "
        "stress p and q, (c) volumetric strain against axial strain",
        "Compression is positive: in (c) loss of volume, so that dilation goes down; the axis of "
        "the test is z. q = √(½((σx − σy)² + (σy − σz)² + (σz − σx)²)), negative where the axial "
        "stress is less than the mean of the others; p = (σx + σy + σz)/3. Stresses are wall "
        "forces over present areas. "
        f"{_strength(source, history, curves)}{f' {DYNAMIC}' if shaded else ''}",
        {
            "": {
                "strain [-]": history["strain"],
                "q [Pa]": curves["q"],
                "p [Pa]": curves["p"],
                "volumetric strain [-]": curves["strain_volume"],
                "stage": history["stage"],
            }
        },
        "wide",
    )


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
    if slope < 0:
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
