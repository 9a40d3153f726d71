"""Sums over the cells of grains, for arrays of any shape."""

import numpy as np

from mufe_fenicsx.geometry.measure import BLOCK


def index_grains(grain_of_cell):
    """Labels that occur, increasing, and the place of each cell's grain among them.

    Args:
        grain_of_cell: Label of each cell's grain, shape (num_cells,).

    Returns:
        labels, shape (num_grains,), and index, shape (num_cells,).
    """
    grain_of_cell = np.asarray(grain_of_cell)
    low, high = int(grain_of_cell.min(initial=0)), int(grain_of_cell.max(initial=0))
    if high - low > 4 * grain_of_cell.size:
        return np.unique(grain_of_cell, return_inverse=True)
    # Labels near each other need no sorting.
    place = grain_of_cell - low
    there = np.bincount(place) > 0
    labels = (low + np.flatnonzero(there)).astype(grain_of_cell.dtype)
    return labels, (np.cumsum(there) - 1)[place]


def blocks(num_cells, size=BLOCK):
    """Slices that cover all cells in turn, so that no array in between is as long as they."""
    return [slice(at, at + size) for at in range(0, num_cells, size)]


def sum_by_grain(values, index, num_grains):
    """Sum of values over the cells of each grain, shape (num_grains, …).

    Args:
        values: One value, vector or tensor a cell, shape (num_cells, …).
        index: Place of each cell's grain, shape (num_cells,).
        num_grains: Number of grains.
    """
    values = np.asarray(values, dtype=float)
    flat = values.reshape(len(values), -1)
    sums = [np.bincount(index, column, num_grains) for column in flat.T]
    return np.stack(sums, axis=1).reshape(num_grains, *values.shape[1:])
