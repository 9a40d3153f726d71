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
from mufe_fenicsx.analysis.rows import counted_rows, course, largest, lasting, load, tool_load
from mufe_fenicsx.container import container_of_history

#: Largest ratios of a quasi-static test: kinetic over internal energy, unbalanced force over load.
KINETIC, UNBALANCED = 0.05, 0.03
#: Load over the largest so far below which, as after unloading, the forces are not compared.
UNLOADED = 0.1
#: Load over the largest of all up to which nothing touches yet, and no ratio means anything.
UNTOUCHED = 1e-3
#: Time over T within which rows are taken together.
WINDOW = 0.5


def kinetic_ratio(history):
    """Kinetic over internal (elastic + plastic) energy, shape (num_rows,).

    Of rigid grains, which have none, all is in the springs of contact. nan where it is 0, and
    before the sample touches what loads it.
    """
    internal = history["elastic"] + history["plastic"]
    internal = internal if internal.any() else history["contact"]
    return np.where(_touched(history), _ratio(history["kinetic"], internal), np.nan)


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


def _touched(history):
    """Rows from the first load on, shape (num_rows,); before, ratios are those of rounding."""
    force = np.maximum.accumulate(np.asarray(load(history), dtype=float))
    return force > UNTOUCHED * max(force.max(initial=0.0), 0.0)


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
    kinetic: float  #: largest ratio of the energies before it under load, as judged; nan: none is
    unbalanced: float  #: the same of the forces
    missed: float  #: part of the rows before it with a ratio where one is beyond its limit


def trusted_from(history, mass=None):
    """The row from which on both ratios, as :func:`judged`, stay within their limits to the end.

    Rows in which a ratio does not exist, since nothing is loaded, do not count, nor do forces below
    a tenth of the largest so far, nor a single row beyond a limit. Where no two rows that carry a
    tenth of the largest load are left, nothing is quasi-static.

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
        missed = (kinetic > KINETIC) | (unbalanced > UNBALANCED)
    known = np.isfinite(kinetic) | np.isfinite(unbalanced)
    missed[known] = lasting(missed[known])
    missed = np.flatnonzero(missed)
    first = int(missed[-1]) + 1 if missed.size else int(np.argmax(known)) if known.any() else 0
    dynamic = missed.size / max(int(known[:first].sum()), 1)
    loaded = known & (force >= UNLOADED * max(force.max(initial=0.0), 0.0))
    if loaded[first:].sum() < min(2, loaded.sum()) or not loaded.any():
        return Trust(None, 1.0, largest(kinetic[loaded]), largest(unbalanced[loaded]), dynamic)
    row, before = int(rows[first]), np.flatnonzero(loaded[:first])
    before = largest(kinetic[before]), largest(unbalanced[before])
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
