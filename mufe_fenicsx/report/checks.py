"""Targets of a quasi-static test and whether a run meets them."""

from dataclasses import dataclass

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


def _check(name, values, what, good, bad):
    worst, target = largest(values), TARGETS[name]
    finite = values[np.isfinite(values)]
    mean = float(finite.mean()) if finite.size else np.nan
    passed = bool(finite.size) and worst <= target
    if not finite.size:
        return Check(name, target, worst, mean, False, f"{what}: the sample was never loaded.")
    text = (
        f"{what}: at most {worst:.2%} (mean {mean:.2%}) once loaded, target {target:.0%}; "
        f"{good if passed else bad}."
    )
    return Check(name, target, worst, mean, passed, text)
