"""Sums over the cells of grains, for arrays of any shape."""

import numpy as np


def index_grains(grain_of_cell):
    """Labels that occur, increasing, and the place of each cell's grain among them.

    Args:
        grain_of_cell: Label of each cell's grain, shape (num_cells,).

    Returns:
        labels, shape (num_grains,), and index, shape (num_cells,).
    """
    return np.unique(grain_of_cell, return_inverse=True)


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
