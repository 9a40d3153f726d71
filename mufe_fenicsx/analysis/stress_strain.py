"""Stress, strain, force and displacement of an oedometer test."""

import numpy as np

from mufe_fenicsx.analysis.rows import branches
from mufe_fenicsx.container import container_of_history

#: Stages that add less than this part of the largest vertical stress can lose nothing.
ADDS = 0.1


def displacement(history, reference_height):
    """How far the top platen has come down since the end of seating [m], shape (num_rows,).

    Args:
        history: dict column -> array.
        reference_height: Height of the sample at the end of seating [m].
    """
    return reference_height - history["height"]


def side_forces(history):
    """Normal forces on the walls beside the sample [N], dict wall -> shape (num_rows,)."""
    return {name: history[f"force_{name}"] for name in container_of_history(history).sides}


def lost_load(history):
    """Vertical stress lost since its peak in a stage over what that had added, (num_rows,).

    Of stages that shorten the sample and add to its stress; 0 elsewhere. One that gives way under
    a platen that goes on loses its load; softening beyond a peak loses a part of it.

    Args:
        history: dict column -> array.
    """
    stress = np.asarray(history["stress"], dtype=float)
    least, lost = ADDS * np.abs(stress).max(initial=0.0), np.zeros(stress.shape)
    for branch in branches(history):
        if branch.kind == "unloading":
            continue
        added = stress[branch.rows] - stress[branch.rows][0]
        peak = np.maximum.accumulate(added)
        on = peak > least
        lost[branch.rows][on] = 1.0 - added[on] / peak[on]
    return lost


def tangent_modulus(strain, stress, at, width):
    """Constrained modulus M = dσ/dε: slope of the least-squares line around a strain [Pa].

    Args:
        strain: Shape (num_rows,).
        stress: Vertical stress [Pa], shape (num_rows,).
        at: Strain in the middle of the window.
        width: Width of the window in strain.

    Returns:
        The slope; nan with fewer than two different strains in the window.
    """
    inside = np.abs(strain - at) <= 0.5 * width * (1 + 1e-12)
    x, y = strain[inside], stress[inside]
    if x.size < 2 or np.ptp(x) == 0:
        return np.nan
    x = x - x.mean()
    return float(x @ (y - y.mean()) / (x @ x))
