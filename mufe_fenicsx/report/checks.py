"""Targets of a quasi-static test and whether a run meets them."""

import math
from dataclasses import dataclass, replace

import numpy as np

from mufe_fenicsx.analysis import energy_check, quasi_static
from mufe_fenicsx.analysis.rows import largest, loaded_rows

#: Largest values allowed once the sample is loaded.
TARGETS = {"kinetic": 0.05, "platens": 0.03, "residual": 0.01}


@dataclass(frozen=True)
class Check:
    """One target and what the run reached; all numbers are ratios."""

    name: str
    target: float
    largest: float  #: over the loaded rows; nan if there is none
    mean: float  #: over the loaded rows
    passed: bool
    text: str  #: in plain words

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


def check_run(history):
    """The three targets, taken over the loaded rows.

    Returns:
        List of Check.
    """
    loaded = loaded_rows(history)
    return [
        _check(
            "kinetic",
            quasi_static.kinetic_ratio(history)[loaded],
            "Kinetic energy over internal (elastic + plastic) energy",
            "the grains' inertia plays no part: the test is quasi-static",
            "inertia may add to the forces: lower the speed of the platen",
        ),
        _check(
            "platens",
            quasi_static.force_difference(history)[loaded],
            "Difference between the forces on the top and the bottom platen",
            "the sample is in equilibrium",
            "the sample is not in equilibrium, or rough side walls carry a part of the load",
        ),
        _check(
            "residual",
            energy_check.residual_ratio(history)[loaded],
            "Energy that is not accounted for, over the work of the walls",
            "the energy balance closes",
            "energy was created or lost: lower the time step, and look at the contacts",
        ),
    ]


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
        found.append(replace(same[worst], text=text))
    return found


def _check(name, values, what, good, bad):
    worst, target = largest(values), TARGETS[name]
    finite = values[np.isfinite(values)]
    mean = float(finite.mean()) if finite.size else np.nan
    passed = bool(finite.size) and worst <= target
    if not finite.size:
        return Check(name, target, worst, mean, False, f"{what}: the sample was never loaded.")
    text = (
        f"{what}: at most {ratio(worst)} (mean {ratio(mean)}) once loaded, target {target:.0%}; "
        f"{good if passed else bad}."
    )
    return Check(name, target, worst, mean, passed, text)
