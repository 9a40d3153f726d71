"""Is the test quasi-static? Kinetic energy and the balance of forces.

All forces on the sample from outside are added up: those of the platens, of rough side walls, of
a sleeve, of tools and of gravity. In equilibrium nothing is left. What is, over the mean force of
the platens, or over that of the tool that loads the sample, says how dynamic the test is.

Single rows of a history shake with the waves of a grain that slips, at any speed of loading. Forces
that inertia makes last as long as a wave travels. So both ratios are judged over half of the
time T that a wave takes through the sample, as the control of [quasi_static] judges them
(speed_control): the mean of the energies' ratio, the root mean square of the forces' difference.
"""

from dataclasses import dataclass

import numpy as np

from mufe_fenicsx.analysis.macro import inner_lengths, wall_stresses
from mufe_fenicsx.analysis.rows import counted_rows, course, largest, load, tool_load
from mufe_fenicsx.container import container_of_history

#: Largest ratios of a quasi-static test: kinetic over internal energy, unbalanced force over load.
KINETIC, UNBALANCED = 0.05, 0.03
#: Load over the largest so far below which, as after unloading, the forces are not compared.
UNLOADED = 0.1
#: Time over T within which rows are taken together.
WINDOW = 0.5


def kinetic_ratio(history):
    """Kinetic over internal (elastic + plastic) energy, shape (num_rows,); nan where that is 0."""
    internal = history["elastic"] + history["plastic"]
    return _ratio(history["kinetic"], internal)


def force_difference(history):
    """Unbalanced force along the load over the load, shape (num_rows,); nan where that is 0.

    Between platens that is |bottom - top + A| over their mean, A being what all others do to the
    sample along z. Runs of earlier versions lack it, and have nan.
    """
    force, of_tool = load(history), tool_load(history)
    if not knows_balance(history):
        return np.full(np.shape(force), np.nan)
    if of_tool is None:
        return _ratio(np.abs(history["unbalanced_z"]), force)
    left = np.stack([history[f"unbalanced_{axis}"] for axis in "xyz"], axis=1)
    return _ratio(_ratio(np.abs(np.einsum("ri,ri->r", left, of_tool)), force), force)


def knows_balance(history):
    """Whether a history has the sum of all forces on the sample."""
    return "unbalanced_z" in history


def platens_alone(scene):
    """Whether a scene, its defaults written out, has nothing else that acts along z on a sample."""
    walls = scene.get("walls") or {}
    sides = [wall for name, wall in walls.items() if name not in ("z_min", "z_max")]
    others = any(scene.get(key) for key in ("membrane", "tool", "gravity"))
    return bool(sides) and not others and all(wall.get("friction") == 0.0 for wall in sides)


def travel_time(history, mass):
    """Time of a wave through the height of the sample [s], shape (num_rows,); nan without a load.

    That of a solid of the same mass m, volume V, internal energy U and stresses σj along the axes,

        T = H (m/V) √(2U / (m Σσj²)),

    which is √(2mU)/F where F is the only force (speed_control).

    Args:
        history: dict column -> array.
        mass: Of all grains [kg]; None where that is not known: nothing is.
    """
    nothing = np.full(np.shape(history["time"]), np.nan)
    lengths, container = inner_lengths(history), container_of_history(history)
    if mass is None or lengths is None:
        return nothing
    stress = container.three_stresses(wall_stresses(history, lengths), lengths)
    square = (stress**2).sum(axis=1)
    internal = history["elastic"] + history["plastic"]
    loaded = (square > 0) & (internal > 0)
    slowness = np.sqrt(2 * internal[loaded] / (mass * square[loaded]))
    nothing[loaded] = mass / container.areas(lengths[loaded])[:, -1] * slowness
    return nothing


def judged(history, mass):
    """The two ratios as they are judged, (kinetic, difference of the forces), (num_rows,) each.

    Args:
        history: dict column -> array.
        mass: Of all grains [kg]; None: single rows are judged.
    """
    time, window = history["time"], WINDOW * travel_time(history, mass)
    kinetic = mean_of_recent(kinetic_ratio(history), time, window)
    return kinetic, np.sqrt(mean_of_recent(force_difference(history) ** 2, time, window))


@dataclass(frozen=True)
class Trust:
    """From where on, to its end, a test is quasi-static."""

    row: int | None  #: of the history; None: nowhere
    share: float  #: part of the loading before that row, see :func:`~.rows.course`; 1: all
    kinetic: float  #: largest ratio of the energies before it, as judged; nan: nothing is before
    unbalanced: float  #: the same of the forces
    missed: float  #: part of the rows before it with a ratio where one is beyond its limit


def trusted_from(history, mass=None):
    """The row from which on both ratios, as :func:`judged`, stay within their limits to the end.

    Rows in which a ratio does not exist, since nothing is loaded, do not count, nor do forces below
    a tenth of the largest so far. Where no row that carries a tenth of the largest load is left,
    nothing is trusted.

    Args:
        history: dict column -> array.
        mass: Of all grains [kg]; None: single rows are judged.

    Returns:
        :class:`Trust`.
    """
    rows = np.flatnonzero(counted_rows(history))
    kinetic, unbalanced = (values[rows] for values in judged(history, mass))
    force = load(history)[rows]
    unbalanced[force < UNLOADED * np.maximum.accumulate(force)] = np.nan
    with np.errstate(invalid="ignore"):
        missed = np.flatnonzero((kinetic > KINETIC) | (unbalanced > UNBALANCED))
    first = int(missed[-1]) + 1 if missed.size else 0
    known = np.isfinite(kinetic) | np.isfinite(unbalanced)
    dynamic = missed.size / max(int(known[:first].sum()), 1)
    loaded = force >= UNLOADED * max(force.max(initial=0.0), 0.0)
    if not (loaded & known)[first:].any():
        return Trust(None, 1.0, largest(kinetic), largest(unbalanced), dynamic)
    row = int(rows[first])
    before = largest(kinetic[:first]), largest(unbalanced[:first])
    return Trust(row, float(course(history)[row]), *before, dynamic)


def mean_of_recent(values, time, window):
    """Mean of the values that are numbers since a ``window`` before each row; nan where it is."""
    known = np.isfinite(values)
    index = np.arange(len(values))
    first = np.searchsorted(time, time - np.nan_to_num(window), side="right")
    first = np.minimum(first, index)
    # Each sum by itself: differences of sums from the start lose all beside one huge value.
    windows = np.stack([first, index + 1], axis=1).ravel()
    sums = np.add.reduceat(np.append(np.where(known, values, 0.0), 0.0), windows)[::2]
    counts = np.add.reduceat(np.append(known, False).astype(float), windows)[::2]
    return np.where(known, sums / np.maximum(counts, 1.0), np.nan)


def _ratio(part, whole):
    """part/whole, nan where the whole is not positive."""
    positive = whole > 0
    return np.divide(part, whole, out=np.full(np.shape(part), np.nan), where=positive)
