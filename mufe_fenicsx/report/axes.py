"""Axes that show their curves: legends under them, and limits that single values do not set."""

import numpy as np
from matplotlib.transforms import ScaledTranslation

#: A value is a spike where it lies beyond the middle 98 % of all by more than this part of them.
BEYOND = 1.0
#: Between the words under an axis and its legend [pt].
GAP = 4.0


def legends(*axes, grow=True):
    """A legend under each axis, where it covers nothing; those without labels get none.

    To be called when all is drawn and labelled.

    Args:
        axes: Of one row of a figure.
        grow: Make the figure higher by the largest legend, so that the axes keep their height.
    """
    figure = axes[0].figure
    renderer, height = figure.canvas.get_renderer(), 0.0
    for axis in axes:
        handles, labels = axis.get_legend_handles_labels()
        if not labels:
            continue
        frame = axis.get_window_extent()
        words = axis.xaxis.get_tightbbox(renderer)
        below = (frame.y0 - (words.y0 if words else frame.y0)) / figure.dpi + GAP / 72
        for columns in range(min(len(labels), 4), 0, -1):
            box = axis.legend(
                handles,
                labels,
                loc="upper center",
                ncols=columns,
                columnspacing=1.2,
                borderaxespad=0.0,
                bbox_to_anchor=(0.5, 0.0),
                bbox_transform=axis.transAxes
                + ScaledTranslation(0.0, -below, figure.dpi_scale_trans),
            )
            if box.get_window_extent(renderer).width <= 1.15 * frame.width:
                break
        height = max(height, box.get_window_extent(renderer).height / figure.dpi)
    if grow and height:
        whole = figure.canvas.figure
        whole.set_figheight(whole.get_figheight() + height + GAP / 72)


def shared_legend(axis, columns=4, more=()):
    """One legend under all axes of a figure, of what the lines of one of them mean.

    Args:
        axis: Whose labels are taken.
        columns: At most so many.
        more: Other axes, whose labels that it has not come after.
    """
    handles, labels = axis.get_legend_handles_labels()
    for other in more:
        for handle, label in zip(*other.get_legend_handles_labels(), strict=True):
            if label not in labels:
                handles.append(handle)
                labels.append(label)
    if labels:
        columns = min(columns, len(labels))
        axis.figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def without_spikes(axis, x, *curves):
    """Limit a linear y axis where few values would flatten all others, and say so above it.

    Args:
        axis: With the curves.
        x: Of their rows, as plotted.
        curves: Values as plotted, of the shape of ``x``.

    Returns:
        Whether values are left out.
    """
    y = np.concatenate([np.asarray(curve, dtype=float) for curve in curves])
    x = np.tile(np.asarray(x, dtype=float), len(curves))
    known = np.isfinite(y)
    if not known.any():
        return False
    low, high = np.percentile(y[known], [1, 99])
    away = BEYOND * (high - low)
    spikes = known & ((y > high + away) | (y < low - away))
    if not (away > 0 and spikes.any()):
        return False
    rest = y[known & ~spikes]
    margin = 0.05 * np.ptp(rest)
    bottom, top = axis.get_ylim()
    top = rest.max() + margin if (y[spikes] > high).any() else top
    bottom = min(rest.min() - margin, 0.0) if (y[spikes] < low).any() else bottom
    axis.set_ylim(bottom, top)
    most = np.flatnonzero(spikes)[np.argmax(np.abs(y[spikes]))]
    count = int(spikes.sum())
    what = "1 value beyond" if count == 1 else f"{count} values beyond, up to"
    axis.set_title(
        f"{what}: {y[most]:.3g} at {x[most]:.3g}", loc="right", fontsize=6.5, color="0.4"
    )
    return True
