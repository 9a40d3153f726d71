"""One look for all figures: sizes, fonts, colours, units."""

import io

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from mufe_fenicsx.units import PREFIXES

#: Width of a figure across one column or the page of a journal, 84 mm and 174 mm [inch].
COLUMN, PAGE = 84 / 25.4, 174 / 25.4
DPI, SCREEN_DPI = 300, 120

#: Colours that the colour-blind tell apart (Okabe & Ito 2008).
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, RED, PINK, GREY = "#0072B2", "#D55E00", "#CC79A7", "#7F7F7F"

#: Maps of even lightness: stress in the grains, pressure on their surfaces.
STRESS_MAP, PRESSURE_MAP = "viridis", "plasma"
#: Of forces in contacts, of lengths of displacement, and of angles and strains of grains.
CHAIN_MAP, LENGTH_MAP, GRAIN_MAP = "inferno_r", "cividis", "viridis"
#: Of what has both signs.
SIGNED_MAP = "PuOr_r"

RC = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "legend.fontsize": 7.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.prop_cycle": matplotlib.cycler(color=[BLUE, RED, GREEN, ORANGE, PINK, SKY, BLACK]),
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    "mathtext.default": "it",
    "mathtext.fontset": "dejavusans",
    "savefig.dpi": DPI,
    "pdf.fonttype": 42,  # letters stay letters for the journal
}

#: Words of a list that texts show.
MANY = 12

#: Colours and lines of stages of one test, or of several tests.
SERIES = (BLUE, RED, GREEN, ORANGE, PINK, SKY, BLACK, GREY)
LINES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")

STRAIN = r"Vertical strain, $\varepsilon$: –"
#: Line and colour of a stage in which strain grows, falls, and grows again.
BRANCHES = {"loading": ("-", BLUE), "unloading": ("--", ORANGE), "reloading": ("-.", GREEN)}


def look():
    """A context in which matplotlib has the look of these figures."""
    return matplotlib.rc_context(RC)


def new_figure(width=COLUMN, height=None, **subplots):
    """A figure without global state, and its axes.

    Call it, and draw, inside ``with matplotlib.rc_context(RC)``.

    Args:
        width, height: Size [inch].
        subplots: Arguments of ``Figure.subplots``.
    """
    figure = blank_figure(width, height)
    return figure, figure.subplots(**subplots)


class ShownFigure(Figure):
    """A figure that notebooks show where it stands last in a cell, without pyplot."""

    def _repr_png_(self):
        """Of a size for screens, as a PNG."""
        file = io.BytesIO()
        with look():
            self.savefig(file, dpi=SCREEN_DPI)
        return file.getvalue()


def blank_figure(width=COLUMN, height=None):
    """A figure without axes, as :func:`new_figure`."""
    figure = ShownFigure(figsize=(width, height or 0.75 * width), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def unit_of(values, symbol):
    """(factor, unit) in which the largest of some values reads as 1 to 1000.

    Divide by the factor. Square or cubic units are not meant.

    Args:
        values: SI values.
        symbol: Unit without prefix, e.g. "Pa".
    """
    values = np.abs(np.asarray(values, dtype=float))
    values = values[np.isfinite(values)]
    largest = values.max() if values.size else 0.0
    if largest == 0:
        return 1.0, symbol
    for factor, prefix in PREFIXES:
        if largest >= 0.9995 * factor:
            return factor, prefix + symbol
    return 1e-12, "p" + symbol


def listed(words, between=", "):
    """Words one after another, of many the first ones and the last: "a, b and 17 more, to z"."""
    if len(words) <= MANY:
        return between.join(words)
    return f"{between.join(words[: MANY - 1])} and {len(words) - MANY} more, to {words[-1]}"


def quantity(value, symbol, digits=3):
    """A value in words, e.g. ``quantity(2.5e7, "Pa")`` is "25 MPa"."""
    if value is None or not np.isfinite(value):
        return "not known"
    factor, unit = unit_of([value], symbol)
    return f"{number(value / factor, digits)} {unit}"


def number(value, digits=3):
    """A number with some significant digits and no exponent where it is a handy one."""
    if value is None or not np.isfinite(value):
        return "not known"
    value = value + 0  # no minus sign before 0
    if value == int(value) and 10**digits <= abs(value) < 1e12:
        text = f"{int(value):,}".replace(",", "\u202f")
    elif value != 0 and not 1e-4 <= abs(value) < 1e6:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        text = f"{mantissa} × {power_of_ten(int(exponent))}"
    elif abs(value) < 10**digits:
        text = f"{value:.{digits}g}"
    else:
        text = f"{value:.0f}"
    return text.replace("-", "−")


def power_of_ten(exponent):
    """A power of ten with its exponent raised, e.g. 10⁻⁵."""
    return "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def panel_letter(axis, index):
    """Mark a panel (a), (b) and so on, above its upper left corner."""
    axis.set_title(f"({'abcdefghijkl'[index]})", loc="left", fontweight="bold")


def strain(value):
    """A strain as a plain number, "0" where it is below a ten-thousandth."""
    return f"{round(value, 4) + 0.0:.4g}"  # + 0.0: no minus sign before 0


def percent(part):
    """A part in per cent, plain: "0 %" where it is below a hundredth of a per cent."""
    return f"{round(100 * part, 2) + 0.0:.3g} %"  # + 0.0: no minus sign before 0


def heading(axis, text):
    """A line of text above the middle of a picture."""
    axis.text(0.5, 1.02, text, transform=axis.transAxes, ha="center", va="bottom", fontsize=8)


def plain_log_ticks(axis, words="{x:g}".format):
    """Plain numbers at a logarithmic axis, 1, 2, 5, 10 … where few decades are shown.

    Args:
        axis: Of the Axes, x or y, with its limits.
        words: Text of a number ``x``.
    """
    low, high = axis.get_view_interval()
    few = low > 0 and high / low < 100
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda x, _: words(x=x)))
    axis.set_minor_formatter(NullFormatter())


def few_decades(axes, curves, decades=5):
    """Limit a logarithmic y axis: what happens before loading starts would stretch it."""
    top = max((np.max(c) for c in curves if np.size(c)), default=0)
    if top > 0:
        axes.set_ylim(max(axes.get_ylim()[0], 10.0**-decades * top), 3 * top)


def scale_bar(axis, width):
    """A bar of a round length in the lower left corner of a picture.

    Args:
        axis: Axes that the picture fills.
        width: Width of what the whole picture shows [m].
    """
    length = round_length(0.25 * width)
    factor, unit = unit_of([length], "m")
    ends = [0.02, 0.02 + length / width]
    axis.plot(
        ends,
        [0.02, 0.02],
        transform=axis.transAxes,
        color=BLACK,
        linewidth=2,
        solid_capstyle="butt",
        clip_on=False,
    )
    axis.text(
        0.5 * sum(ends),
        0.035,
        f"{length / factor:g} {unit}",
        transform=axis.transAxes,
        ha="center",
        va="bottom",
        fontsize=7,
    )


def round_length(length):
    """The largest of 1, 2, 5 × 10^n that does not exceed a length."""
    power = 10.0 ** np.floor(np.log10(length))
    for step in (5, 2, 1):
        if step * power <= length * (1 + 1e-9):
            return float(step * power)
    return float(power)


def round_limit(value):
    """A round upper end of a colour scale, at least the value."""
    if not value > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    for step in (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10):
        if step * power >= value * (1 - 1e-9):
            return float(step * power)
    return float(10 * power)
