"""Targets of a quasi-static test and whether a run meets them."""

import math
from dataclasses import dataclass, replace

import numpy as np

from mufe_fenicsx.analysis import energy_check, quasi_static, stress_strain
from mufe_fenicsx.analysis.rows import largest, loaded_rows, loading_rows

#: Largest values allowed once the sample is loaded.
TARGETS = {"kinetic": 0.05, "platens": 0.03, "residual": 0.001, "switching": 0.01, "load": 0.5}
#: Energies that are never below zero, and the part of the largest work that is rounding.
POSITIVE, ROUNDING = ("kinetic", "elastic", "plastic", "friction", "contact"), 1e-6


@dataclass(frozen=True)
class Check:
    """One target and what the run reached; all numbers are ratios."""

    name: str
    target: float
    largest: float  #: over the loaded rows; nan if there is none
    mean: float  #: over the loaded rows
    passed: bool
    text: str  #: in plain words
    since: float = math.nan  #: vertical strain from which on it is met to the end; nan: not there
    row: int | None = None  #: that row of the history

    @property
    def reached(self):
        """Largest value, and the mean in brackets, as a text."""
        if not np.isfinite(self.largest):
            return "never loaded"
        return f"{ratio(self.largest)} ({ratio(self.mean)})"


def ratio(value):
    """A ratio in per cent: "0.61%", and "0.0015%" where two digits would leave nothing."""
    small = 0 < value < 5e-5
    return f"{value:.{1 - math.floor(math.log10(100 * value)) if small else 2}%}"


def check_run(history, mass=None):
    """The targets, taken over the loaded rows, and from where on each is met.

    Args:
        history: dict column -> array.
        mass: Of all grains [kg], by which it is known how long waves travel; None: single rows
            are judged.

    Returns:
        List of Check.
    """
    kinetic, difference = quasi_static.judged(history, mass)
    fault = faults(history)
    return [
        _check(
            "kinetic",
            history,
            kinetic,
            "Kinetic energy over internal (elastic + plastic) energy",
            "the grains' inertia plays no part: the test is quasi-static",
            "inertia may add to the forces: lower the speed of the platen",
            fault,
        ),
        _check(
            "platens",
            history,
            difference,
            "Difference between the forces on the top and the bottom platen",
            "the sample is in equilibrium",
            "the sample is not in equilibrium, or rough side walls carry a part of the load",
            fault,
        ),
        _check(
            "residual",
            history,
            energy_check.residual_ratio(history),
            "Energy that is not accounted for, over the work of the walls",
            "the energy balance closes",
            "energy was created or lost: lower the time step, and look at the contacts",
            fault,
        ),
        _check(
            "switching",
            history,
            energy_check.switching_ratio(history),
            "Energy that contacts gained or lost from facet to facet, over the work of the walls",
            "the facets of the mesh play no part in it",
            "contact passes over sharp edges or very uneven facets: mesh them finer or more evenly",
            fault,
        ),
        _check(
            "load",
            history,
            stress_strain.lost_load(history),
            "Vertical stress lost while the sample was compressed, over what the stage had added",
            "the sample carries its load",
            "grains gave way at once: too few of them, a loose packing, or a surface of failure",
            fault,
        ),
    ]


def first_good_row(checks, history):
    """Row from which on all targets are met to the end; None: from the first of loading, or never.

    Args:
        checks: Of :func:`check_run`.
        history: That they were made of.
    """
    rows = [check.row for check in checks]
    if None in rows or max(rows) == int(np.argmax(loading_rows(history))):
        return None
    return max(rows)


def faults(history):
    """What no run may have: values that are no numbers, energies below zero. A text, or ""."""
    for name, values in history.items():
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            count = int((~np.isfinite(values)).sum())
            return f"{name} is not a number in {count} of {len(values)} rows"
    most = float(np.abs(history["work"]).max(initial=0.0))
    for name in POSITIVE:
        below = int((history[name] < -ROUNDING * most).sum())
        if below:
            return f"the {name} energy is below zero in {below} of {len(history[name])} rows"
    return ""


def worst_of(checks, names):
    """The checks of several runs as one list, each target by the run that is farthest from it.

    Args:
        checks: List of lists of Check, one a run.
        names: Of the runs.
    """
    found = []
    for same in zip(*checks, strict=True):
        order = [check.largest if np.isfinite(check.largest) else np.inf for check in same]
        worst = int(np.argmax(order))
        failed = sum(not check.passed for check in same)
        others = f"; {failed} of them miss the target" if failed else ""
        text = f"{same[worst].text} Worst of {len(same)} runs: {names[worst]}{others}."
        passed = not failed
        found.append(replace(same[worst], text=text, passed=passed))
    return found


def _check(name, history, values, what, good, bad, fault):
    loaded = loaded_rows(history)
    judged, target = values[loaded], TARGETS[name]
    worst = largest(judged)
    finite = judged[np.isfinite(judged)]
    mean = float(finite.mean()) if finite.size else np.nan
    passed = bool(finite.size) and worst <= target and not fault
    if not finite.size:
        return Check(name, target, worst, mean, False, f"{what}: the sample was never loaded.")
    row, place = _since(history, values, target)
    since = math.nan if row is None else float(history["strain"][row])
    words = good if passed else bad
    if fault:
        words = f"nothing can be believed where {fault}: lower solver.damping and the time step"
    text = (
        f"{what}: at most {ratio(worst)} (mean {ratio(mean)}) once loaded, target "
        f"{100 * target:g}%; {words}. {place}"
    )
    return Check(name, target, worst, mean, passed, text, since, row)


def _since(history, values, target):
    """Row from which on a target is met, or None, and where that is in words."""
    rows = np.flatnonzero(loading_rows(history))
    missed = np.flatnonzero(~(values[rows] <= target) & ~np.isnan(values[rows]))
    if not missed.size:
        return int(rows[0]), "Met in all rows."
    if missed[-1] == len(rows) - 1:
        return None, "Not met at the end."
    row = int(rows[missed[-1] + 1])
    return row, f"Met from {where(history, row)} on, to the end."


def where(history, row):
    """A row of the history in words: "strain 0.0123", of a test by stages with the stage."""
    stage = f' of stage "{history["stage"][row]}"' if "strain_x" in history else ""
    return f"strain {history['strain'][row]:.4f}{stage}"
