"""Is the test quasi-static? Kinetic energy and the balance of the platens' forces."""

import numpy as np


def kinetic_ratio(history):
    """Kinetic over internal (elastic + plastic) energy, shape (num_rows,); nan where that is 0."""
    internal = history["elastic"] + history["plastic"]
    return _ratio(history["kinetic"], internal)


def force_difference(history):
    """|top - bottom| over the mean of both platens' forces; nan where that is 0."""
    top, bottom = history["force_z_max"], history["force_z_min"]
    return _ratio(np.abs(top - bottom), 0.5 * (top + bottom))


def _ratio(part, whole):
    """part/whole, nan where the whole is not positive."""
    positive = whole > 0
    return np.divide(part, whole, out=np.full(np.shape(part), np.nan), where=positive)
