"""Which rows of a history belong to which part of the test."""

import numpy as np

#: The stage that closes the gaps before strain counts.
SEATING = "seating"


def loading_rows(history):
    """Rows of the loading stage: all that are not seating.

    Args:
        history: dict column -> array, of :func:`mufe_fenicsx.output.history.read_history`.

    Returns:
        Boolean array, shape (num_rows,).
    """
    return history["stage"] != SEATING


def loaded_rows(history):
    """Rows where the sample is loaded: of the loading stage, beyond half of its largest strain.

    Returns:
        Boolean array, shape (num_rows,).
    """
    loading = loading_rows(history)
    if not loading.any():
        return loading
    return loading & (history["strain"] > 0.5 * history["strain"][loading].max())


def largest(values):
    """Largest of the finite values; nan if there is none."""
    values = np.asarray(values, dtype=float)
    values = values[np.isfinite(values)]
    return float(values.max()) if values.size else np.nan
