"""Cells of a regular grid that boxes touch."""

import math

import numba
import numpy as np


@numba.njit(cache=True)
def fill_cells(full, box_low, box_high, low, size):
    """Set to True the cells that the boxes touch, in place.

    Args:
        full: Cells of the grid, shape (nx, ny, nz); boxes beyond it touch its outermost ones.
        box_low, box_high: Corners of the boxes [m], shape (num_boxes, 3).
        low: Lower corner of the grid [m], shape (3,).
        size: Edge of the cells [m].
    """
    begin, end = np.empty(3, np.int64), np.empty(3, np.int64)
    for b in range(box_low.shape[0]):
        for i in range(3):
            last = full.shape[i] - 1
            begin[i] = min(max(math.floor((box_low[b, i] - low[i]) / size), 0), last)
            end[i] = min(max(math.floor((box_high[b, i] - low[i]) / size), 0), last) + 1
        full[begin[0] : end[0], begin[1] : end[1], begin[2] : end[2]] = True


@numba.njit(cache=True)
def touch_full_cells(touch, box_low, box_high, full, low, size, first):
    """Whether each box touches a full cell, into ``touch``.

    Args:
        touch: Shape (num_boxes,).
        box_low, box_high: Corners of the boxes [m], shape (num_boxes, 3).
        full: A part of the cells of a grid, shape (nx, ny, nz).
        low: Lower corner of the whole grid [m], shape (3,).
        size: Edge of the cells [m].
        first: Index of the part's first cell in the whole grid, shape (3,).
    """
    begin, end = np.empty(3, np.int64), np.empty(3, np.int64)
    for b in range(box_low.shape[0]):
        some = True
        for i in range(3):
            begin[i] = max(math.floor((box_low[b, i] - low[i]) / size) - first[i], 0)
            end[i] = math.floor((box_high[b, i] - low[i]) / size) - first[i] + 1
            end[i] = min(end[i], full.shape[i])
            some = some and begin[i] < end[i]
        touch[b] = some and _any(full, begin, end)


@numba.njit(cache=True)
def _any(full, begin, end):
    """Whether any cell from ``begin`` to before ``end`` is full."""
    for i in range(begin[0], end[0]):
        for j in range(begin[1], end[1]):
            for k in range(begin[2], end[2]):
                if full[i, j, k]:
                    return True
    return False
