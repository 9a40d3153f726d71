"""What the figures of the stability map share."""

import numpy as np
from mpi4py import MPI

from mufe_fenicsx.report.style import GREEN

COMM = MPI.COMM_SELF
#: The time step of scenes over the limit.
DEFAULT = 0.9


def columns(rows, *names):
    """Columns of rows of numbers; what is not a number becomes nan."""
    return [
        np.array([r[n] if isinstance(r[n], int | float) else np.nan for r in rows], dtype=float)
        for n in names
    ]


def safe(axis, low, high, label="safe", along="x"):
    """Shade the region where the method holds."""
    span = axis.axvspan if along == "x" else axis.axhspan
    span(low, high, color=GREEN, alpha=0.12, linewidth=0, label=label)
