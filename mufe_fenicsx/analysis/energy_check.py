"""Does the energy balance close?"""

import numpy as np

#: What the work of the walls turns into; older runs have no "switching".
ENERGIES = (
    "kinetic", "elastic", "plastic", "friction", "switching", "contact", "damping", "parting"
)  # fmt: skip


#: How columns begin that hold the energy of a force term, as "energy_gravity".
OF_TERM = "energy_"


def energies_of(columns):
    """Names of the energies among some columns, those of added forces too."""
    return [name for name in columns if name in ENERGIES or name.startswith(OF_TERM)]


def put_in(energies):
    """Work of the walls, and what added forces gave or took [J].

    Args:
        energies: Of one moment, or columns of a history, by name.
    """
    given = np.abs(energies["work"])
    for name in energies:
        if name.startswith(OF_TERM):
            given = given + np.abs(energies[name])
    return given


def residual(history):
    """Work minus all energies stored and dissipated, recomputed from the columns [J]."""
    return history["work"] - sum(history[name] for name in energies_of(history))


def residual_ratio(history):
    """|residual| over the largest :func:`put_in` so far, shape (num_rows,); nan before any."""
    return _over_work(residual(history), history)


def switching_ratio(history):
    """|switching| over the largest :func:`put_in` so far, shape (num_rows,); nan before any."""
    lost = history.get("switching", np.zeros(len(history["work"])))
    return _over_work(lost, history)


def opening_ratio(history):
    """What facets gave as they opened over the largest :func:`put_in` so far, shape (num_rows,).

    That is what their springs began with and do not store any more, and what nodes that part add.
    None of a run without cracks.
    """
    if "cracks_opening" not in history:
        return None
    springs = -np.asarray(history["cracks_opening"]) - history["cracks_stored"]
    given = np.maximum(springs, 0.0) + np.maximum(-np.asarray(history["parting"]), 0.0)
    return _over_work(given, history)


def _over_work(values, history):
    work = np.maximum.accumulate(put_in(history)) if len(history["work"]) else np.empty(0)
    return np.divide(np.abs(values), work, out=np.full(work.shape, np.nan), where=work > 0)


def dents_share(history):
    """Part of the plastic dissipation in dents at the last row; nan where it is not known."""
    known = "plastic_dents" in history and len(history["plastic"])
    if not known or not history["plastic"][-1] > 0:
        return np.nan
    return float(history["plastic_dents"][-1] / history["plastic"][-1])


def friction_share(history):
    """Frictional over plastic dissipation at the last row; nan without plastic dissipation."""
    if not len(history["plastic"]) or not history["plastic"][-1] > 0:
        return np.nan
    return float(history["friction"][-1] / history["plastic"][-1])
