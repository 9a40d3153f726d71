"""Axes that show their curves: legends beside them, and limits that single values do not set."""

import numpy as np

#: A value is a spike where it lies beyond the middle 98 % of all by more than this part of them.
BEYOND = 1.0
#: Points along a curve that are held against a legend, at least.
POINTS = 400


def legend(axis, **options):
    """A legend that covers no curve; where no place is free the axis gets higher for it.

    To be called when the curves are drawn and the limits are set.

    Args:
        axis: With lines, and linear or logarithmic scales.
        options: Those of ``Axes.legend``.

    Returns:
        The legend.
    """
    box = axis.legend(**{"loc": "best"} | options)
    axis.figure.canvas.figure.draw_without_rendering()  # that of all subfigures
    if covered(axis, box):
        low, high = axis.get_ylim()
        scale = axis.yaxis.get_transform()
        ends = scale.transform(np.array([low, high]))
        part = min(1.1 * box.get_window_extent().height / axis.get_window_extent().height, 0.7)
        ends[1] += np.diff(ends)[0] * part / (1 - part)
        axis.set_ylim(low, float(scale.inverted().transform(ends)[1]))
        box.set_loc("upper left")
    return box


def covered(axis, box):
    """Whether a legend lies on a line of its axis; the figure has to be laid out."""
    area = box.get_window_extent()
    for line in axis.lines:
        if line.get_transform() != axis.transData:  # from one end of the axes to the other
            continue
        path = line.get_transform().transform_path(line.get_path()).vertices
        path = path[np.isfinite(path).all(axis=1)]
        if not len(path):
            continue
        step = np.append(0.0, np.cumsum(np.abs(np.diff(path, axis=0)).max(axis=1)))
        at = np.union1d(step, np.linspace(0.0, step[-1], POINTS))
        x, y = (np.interp(at, step, path[:, k]) for k in (0, 1))
        inside = (x > area.x0) & (x < area.x1) & (y > area.y0) & (y < area.y1)
        if inside.any():
            return True
    return False


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
