"""Which rows of a history belong to which part of the test."""

from dataclasses import dataclass

import numpy as np

#: The stage that closes the gaps before strain counts.
SEATING = "seating"
#: Columns with the lengths across the sample, and with what shears it.
WIDTHS = ("length_x", "length_y", "diameter", "inner_diameter")
SHEARED = ("gamma_xz", "gamma_tz", "twist")
#: Part of the largest strain, or force, beyond which a sample is loaded.
LOADED = 0.5


def loading_rows(history):
    """Rows of the test: those after seating, and since strain was last set to zero.

    Args:
        history: dict column -> array, of :func:`mufe_fenicsx.output.history.read_history`.

    Returns:
        Boolean array, shape (num_rows,).
    """
    stage, reference = np.asarray(history["stage"]), _height_at_zero(history)
    rows = stage != SEATING
    if "strain_z" not in history:  # no stages
        return rows
    zeroed = rows[:-1] & (stage[1:] != stage[:-1])
    zeroed &= np.abs(np.diff(reference)) > ZEROED * reference[1:]
    rows[: int(np.flatnonzero(zeroed).max(initial=-1)) + 1] = False
    return rows


def lasting(missed):
    """Those of some rows, boolean, that are not alone: a single row decides nothing."""
    missed = np.asarray(missed, dtype=bool)
    beside = np.zeros(missed.shape, dtype=bool)
    beside[1:] |= missed[:-1]
    beside[:-1] |= missed[1:]
    return missed & beside


def loaded_rows(history):
    """Rows where the sample is loaded: of the loading stage, beyond half of its largest strain.

    The strain may be one of extension.

    Returns:
        Boolean array, shape (num_rows,).
    """
    loading = loading_rows(history)
    if not loading.any():
        return loading
    strain = np.abs(history["strain"])
    return loading & (strain > LOADED * strain[loading].max())


#: Change of a length, over it, below which walls rest.
RESTS = 1e-9
#: Change of the height at strain 0, over it, beyond which strain was set to zero between two rows:
#: far above rounding, and far below a strain that curves show.
ZEROED = 1e-9


def _height_at_zero(history):
    """Height at strain 0 as each row knows it [m], shape (num_rows,)."""
    return np.asarray(history["height"]) / (1.0 - np.asarray(history["strain"]))


def is_constrained(history):
    """Whether it is an oedometer whose side walls stand still: no stages, servo or membrane."""
    return "strain_z" not in history and all(_rests(history, name) for name in WIDTHS)


def tool_names(history):
    """Names of the tools of a history, in their order."""
    start, end = "turn_", "_x"
    columns = [name for name in history if name.startswith(start) and name.endswith(end)]
    return [name[len(start) : -len(end)] for name in columns]


def tool_load(history):
    """Force on the sample of the tool that loads it [N], shape (num_rows, 3), or None.

    Tools load where there are some and no wall moves, along itself neither. Of several it is that
    of the largest force.
    """
    names = tool_names(history)
    moved = [name for name in ("height", *WIDTHS) if not _rests(history, name)]
    moved += [name for name in SHEARED if np.any(history.get(name, 0.0))]
    if not names or moved:
        return None
    forces = [
        -np.stack([history[f"force_{name}_{axis}"] for axis in "xyz"], axis=1) for name in names
    ]
    return max(forces, key=lambda force: np.linalg.norm(force, axis=1).max(initial=0.0))


def load(history):
    """Mean force of the platens, or that of the tool that loads [N], shape (num_rows,)."""
    of_tool = tool_load(history)
    if of_tool is not None:
        return np.linalg.norm(of_tool, axis=1)
    return 0.5 * (history["force_z_max"] + history["force_z_min"])


def counted_rows(history):
    """Rows that targets are about, boolean, shape (num_rows,).

    Those of the loading; where tools load, those with more than half of the largest force.
    """
    rows = loading_rows(history)
    if tool_load(history) is None:
        return rows
    force = load(history)
    return rows & (force > LOADED * np.max(force, where=rows, initial=0.0))


def _rests(history, name):
    values = np.asarray(history.get(name, 0.0))
    if values.ndim:
        values = values[loading_rows(history)]
    return not values.size or np.ptp(values) <= RESTS * np.abs(values).max()


#: A stage whose strain falls by more than this part of the range of all strains unloads.
TURN = 0.02


@dataclass(frozen=True)
class Branch:
    """Rows of one stage of loading, and the last one before it, if strain goes on from there."""

    stage: str
    kind: str  #: "loading", "unloading" or, after one of these, "reloading"
    rows: slice
    is_zeroed: bool = False  #: whether strain was set to zero between it and the stage before


def branches(history, whole=False):
    """The stages of the test in turn, list of :class:`Branch`; none of a run that still seats.

    A stage unloads if the vertical strain is smaller at its end than at its start, and reloads
    if it is larger, and a stage before it unloaded.

    Args:
        history: dict column -> array, its seating stage first, if there is one.
        whole: Of all stages after seating, those before strain was set to zero too.
    """
    stage, strain = np.asarray(history["stage"]), np.asarray(history["strain"])
    reference = _height_at_zero(history)
    rows = stage != SEATING if whole else loading_rows(history)
    if not rows.any():
        return []
    first = int(np.argmax(rows))
    starts = [k for k in range(first, len(stage)) if k == first or stage[k] != stage[k - 1]]
    scale = TURN * np.ptp(strain[first:])
    found, unloaded = [], False
    for start, end in zip(starts, [*starts[1:], len(stage)], strict=True):
        before = max(start - 1, first)
        is_zeroed = abs(reference[start] - reference[before]) > ZEROED * reference[start]
        rows = slice(start if is_zeroed else before, end)
        change = strain[end - 1] - strain[rows.start]
        kind = "unloading" if change < -scale else "reloading" if unloaded else "loading"
        unloaded |= kind == "unloading"
        found.append(Branch(str(stage[start]), kind, rows, bool(is_zeroed)))
    return found


#: Change of strain, over that of the stage, below which a row waits.
WAITS = 1e-3


def waiting_rows(history):
    """Rows at the ends of stages that wait for stresses at a strain that is reached, (num_rows,).

    The first of each wait is none of them.
    """
    waits, strain = np.zeros(len(history["stage"]), dtype=bool), np.asarray(history["strain"])
    for branch in branches(history) if "strain_z" in history else ():
        own = strain[branch.rows]
        off = np.abs(own - own[-1]) > WAITS * np.ptp(own)
        if off.any():
            waits[branch.rows][int(np.flatnonzero(off)[-1]) + 2 :] = True
    return waits


def turns_back(history):
    """Whether the vertical strain falls in some stage: a curve over it would run into itself."""
    return any(branch.kind == "unloading" for branch in branches(history))


def course(history):
    """How much of the loading is done at each row, 0 to 1, shape (num_rows,); nan while seating.

    By the vertical strain; by time where that turns back, or does not change at all. Where tools
    load it begins and ends with :func:`counted_rows`.

    Args:
        history: dict column -> array.
    """
    rows = counted_rows(history)
    done = np.full(rows.shape, np.nan)
    if not rows.any():
        return done
    strain, time = np.asarray(history["strain"])[rows], np.asarray(history["time"])[rows]
    way = time if turns_back(history) or strain[-1] == strain[0] else strain
    done[rows] = (way - way[0]) / ((way[-1] - way[0]) or 1.0)
    return done


def largest(values):
    """Largest of the finite values; nan if there is none."""
    values = np.asarray(values, dtype=float)
    values = values[np.isfinite(values)]
    return float(values.max()) if values.size else np.nan
