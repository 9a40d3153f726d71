"""Does the energy balance close?"""

import numpy as np

#: What the work of the walls turns into; older runs have no "switching".
ENERGIES = ("kinetic", "elastic", "plastic", "friction", "switching", "contact", "damping")


def residual(history):
    """Work minus all energies stored and dissipated, recomputed from the columns [J]."""
    return history["work"] - sum(history[name] for name in ENERGIES if name in history)


def residual_ratio(history):
    """|residual| over the largest |work| so far, shape (num_rows,); nan before any work."""
    return _over_work(residual(history), history)


def switching_ratio(history):
    """|switching| over the largest |work| so far, shape (num_rows,); nan before any work."""
    lost = history.get("switching", np.zeros(len(history["work"])))
    return _over_work(lost, history)


def _over_work(values, history):
    work = np.maximum.accumulate(np.abs(history["work"])) if len(history["work"]) else np.empty(0)
    return np.divide(np.abs(values), work, out=np.full(work.shape, np.nan), where=work > 0)


def friction_share(history):
    """Frictional over plastic dissipation at the last row; nan without plastic dissipation."""
    if not len(history["plastic"]) or not history["plastic"][-1] > 0:
        return np.nan
    return float(history["friction"][-1] / history["plastic"][-1])
