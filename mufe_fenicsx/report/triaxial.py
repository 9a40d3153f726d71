"""The figure of a test by stages: deviator stress, stress path and volumetric strain."""

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from mufe_fenicsx.analysis.check_targets import TARGETS
from mufe_fenicsx.analysis.held import TARGET, axes_led, lack_of_stress
from mufe_fenicsx.analysis.macro import friction_angle, triaxial_curves, triaxial_strength
from mufe_fenicsx.analysis.rows import SEATING, branches, loading_rows, waiting_rows
from mufe_fenicsx.container import container_of_history
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.axes import legends, shared_legend, without_spikes
from mufe_fenicsx.report.curves import DYNAMIC, shade_dynamic
from mufe_fenicsx.report.figure import Drawing
from mufe_fenicsx.report.reference import about, draw_measured

NAME = "triaxial"
AXIAL = r"Axial strain, $\varepsilon_{\mathrm{a}}$: –"
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
WAITING = "Points: rows that wait for a stress at a strain that is reached; (d) is without them. "
BEFORE = "Pale in (b): stages before strain 0. "
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
    figure, axes = style.new_figure(style.PAGE, 4.7, nrows=2, ncols=2)
    axes, whole = axes.ravel(), _before(source.history)
    strain = history["strain"]
    factor_q, unit_q = style.unit_of(curves["q"], "Pa")
    factor_p, unit_p = style.unit_of(curves["p"], "Pa")
    q, p, volume = curves["q"] / factor_q, curves["p"] / factor_p, curves["strain_volume"]
    panels = (
        (strain, q, AXIAL, f"Deviator stress, $q$: {unit_q}"),
        (p, q, f"Mean stress, $p$: {unit_p}", f"Deviator stress, $q$: {unit_q}"),
        (strain, volume, AXIAL, r"Volumetric strain, $\varepsilon_{\mathrm{vol}}$: –"),
    )
    measured = _draw_measured(axes, source.references, factor_p, factor_q)
    parts, waits = branches(history), waiting_rows(history)
    colours = _colours(len(parts))
    total = p + history.get("pore_pressure", 0.0 * p) / factor_p
    if whole is not None:
        before = triaxial_curves(whole)
        q_before = before["q_axial" if undrained else "q"] / factor_q
        axes[1].plot(before["p"] / factor_p, q_before, color="0.75", linewidth=0.8)
    for i, (axis, (x, y, label_x, label_y)) in enumerate(zip(axes[:3], panels, strict=True)):
        _draw_stages(axis, x, y, parts, colours, waits)
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
    _draw_stresses(axes[3], source, strain, parts, waits)
    _draw_scale(figure, axes[2], len(parts))
    shared_legend(axes[0], 6, axes[1:3])
    legends(axes[3], grow=False)
    lack = lack_of_stress(history)
    return Drawing(
        NAME,
        figure,
        "Test by stages: (a) deviator stress q against axial strain, (b) stress path in mean "
        "stress p and q, (c) volumetric strain and (d) stresses on the walls against axial strain",
        "Compression is positive: in (c) loss of volume, so that dilation goes down; the axis of "
        f"the test is z. {Q_AXIAL if undrained else Q}; p = (σx + σy + σz)/3. Stresses are wall "
        f"forces over present areas. {PORES if undrained else ''}"
        f"{_of_targets(lack)}{WAITING if waits.any() else ''}"
        f"{BEFORE if whole is not None else ''}"
        f"{_strength(source, history, curves)}"
        f"{f' {DYNAMIC}' if shaded else ''}{about(measured)}",
        {"": _data(history, curves), **measured},
        "wide",
    )


def _draw_measured(axes, references, factor_p, factor_q):
    """Measured curves in the first three panels; their data, by panel too."""
    found = {}
    for axis, x, y, scales in (
        (axes[0], "strain", "q", (1.0, factor_q)),
        (axes[1], "p", "q", (factor_p, factor_q)),
        (axes[2], "strain", "volumetric_strain", (1.0, 1.0)),
    ):
        drawn = draw_measured(axis, references, x, y, scales)
        found |= {f"{name}-{x}-{y}": data for name, data in drawn.items()}
    return found


def _data(history, curves):
    """Columns of the data beside the figure."""
    return {
        "strain [-]": history["strain"],
        "q [Pa]": curves["q"],
        "p [Pa]": curves["p"],
        "volumetric strain [-]": curves["strain_volume"],
        **_walls(history),
        **_pores(history),
        "stage": history["stage"],
    }


def _before(history):
    """The rows between seating and strain 0, with the first one after; None where none are."""
    first = int(np.argmax(loading_rows(history)))
    rows = np.flatnonzero(history["stage"][:first] != SEATING)
    if not rows.size:
        return None
    return {name: values[rows[0] : first + 1] for name, values in history.items()}


def _draw_stages(axis, x, y, parts, colours, waits):
    """A curve in the colour of each stage; rows that wait as points."""
    for part, colour in zip(parts, colours, strict=True):
        label = part.stage if len(parts) <= FEW else None
        own = waits[part.rows]
        axis.plot(x[part.rows][~own], y[part.rows][~own], color=colour, label=label)
        axis.plot(x[part.rows][own], y[part.rows][own], ",", color=colour)


def _draw_stresses(axis, source, strain, parts, waits):
    """Stress of the walls of each axis over the axial strain, dashed what a servo leads it to."""
    walls = _walls(source.loading)
    factor, unit = style.unit_of(np.concatenate(list(walls.values())), "Pa")
    for k, (name, values) in enumerate(walls.items()):
        asked = name.endswith("asked for [Pa]")
        of = name.split()[0].removeprefix("stress_")
        colour = style.SERIES[list(walls).index(f"stress_{of} [Pa]") if asked else k]
        label = rf"$\sigma_{of}$" + (", asked for" if asked else "")
        shown = np.where(waits | (asked & (values == 0.0)), np.nan, values / factor)
        for part in parts:
            axis.plot(strain[part.rows], shown[part.rows], "--" if asked else "-", color=colour,
                      linewidth=0.8 if asked else 1.2, label=label)  # fmt: skip
            label = None
    shade_dynamic(axis, source, strain, shown)
    axis.set(xlabel=AXIAL, ylabel=f"Stress on the walls: {unit}")
    axis.set_ylim(bottom=min(0.0, axis.get_ylim()[0]))
    style.panel_letter(axis, 3)


def _walls(history):
    """Stresses of the walls of each axis, then what servos lead them to; columns of the data."""
    axes = container_of_history(history).axes
    found = {f"stress_{a} [Pa]": history[f"stress_{a}"] for a in axes}
    return found | {
        f"stress_{a} asked for [Pa]": history[f"{TARGET}{a}"] for a in axes_led(history)
    }


def _of_targets(lack):
    """Words about the stresses that servos lead."""
    if lack is None or not np.isfinite(lack).any():
        return ""
    most = float(np.nanmax(np.abs(lack)))
    return f"Dashed in (d): what a servo leads a stress to; it is off by {most:.1%} at most. "


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
    strain = f"{float(history['strain'][found.row]):.4f}"
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
    lack = lack_of_stress(history)
    if lack is not None and np.nan_to_num(np.abs(lack[found.row])) > TARGETS["held"]:
        text += (
            f" A stress that is to be held is off by {abs(lack[found.row]):.0%} there: the angle "
            "is that of another path of stress."
        )
    return text
