"""The figure of a test by stages: deviator, mean stress and volume."""

from mufe_fenicsx.analysis.macro import triaxial_curves
from mufe_fenicsx.analysis.rows import branches
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import without_spikes
from mufe_fenicsx.report.figure import Drawing

NAME = "triaxial"


def draw_triaxial(source):
    """q over strain, the path in p and q, and volumetric strain; a colour each stage."""
    history = source.loading
    if "strain_x" not in history:
        raise InputError("the test is an oedometer test, expected one by stages")
    curves = triaxial_curves(history)
    figure, axes = style.new_figure(style.PAGE, 2.6, ncols=3)
    strain = 100 * history["strain"]
    factor_q, unit_q = style.unit_of(curves["q"], "Pa")
    factor_p, unit_p = style.unit_of(curves["p"], "Pa")
    q, p, volume = curves["q"] / factor_q, curves["p"] / factor_p, 100 * curves["strain_volume"]
    panels = (
        (strain, q, style.STRAIN, f"Deviator stress, $q$: {unit_q}"),
        (p, q, f"Mean stress, $p$: {unit_p}", f"Deviator stress, $q$: {unit_q}"),
        (strain, volume, style.STRAIN, r"Volumetric strain, $\varepsilon_{\mathrm{vol}}$: %"),
    )
    for i, (axis, (x, y, label_x, label_y)) in enumerate(zip(axes, panels, strict=True)):
        for number, part in enumerate(branches(history)):
            colour = style.SERIES[number % len(style.SERIES)]
            line = style.LINES[number // len(style.SERIES) % len(style.LINES)]
            axis.plot(x[part.rows], y[part.rows], line, color=colour, label=part.stage)
        axis.axhline(0, color=style.GREY, linewidth=0.5, zorder=0)
        axis.set(xlabel=label_x, ylabel=label_y)
        without_spikes(axis, x, y)
        style.panel_letter(axis, i)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 6))
    return Drawing(
        NAME,
        figure,
        "Test by stages: (a) deviator stress q over vertical strain, (b) stress path in mean "
        "stress p and q, (c) volumetric over vertical strain",
        "Compression is positive, in (c) loss of volume. q = √(½((σx − σy)² + (σy − σz)² + "
        "(σz − σx)²)), below zero where the vertical stress is less than the mean of the others; "
        "p = (σx + σy + σz)/3. Stresses are those of the walls over their present areas.",
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
