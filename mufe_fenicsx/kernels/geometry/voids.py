"""Where the solid of a sample lies, cell by cell."""

import numba
import numpy as np


@numba.njit(cache=True, inline="always")
def _centre(x, cells, c, i):
    a, b, d, e = cells[c, 0], cells[c, 1], cells[c, 2], cells[c, 3]
    return 0.25 * (x[a, i] + x[b, i] + x[d, i] + x[e, i])


@numba.njit(cache=True)
def box_of_centres(x, cells):
    """Corners of the box around the centres of cells, as of :func:`.boxes.box_around`."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for c in range(cells.shape[0]):
        for i in range(3):
            at = _centre(x, cells, c, i)
            low[i], high[i] = min(low[i], at), max(high[i], at)
    return low, high


@numba.njit(cache=True)
def solid_of_octants(x, cells, volume, middle, half, is_round, hole):
    """Volume of the cells with their centres in each octant of an inner part [m³], shape (8,).

    Args:
        x: Positions [m], shape (num_nodes, 3).
        cells: Shape (num_cells, 4).
        volume: Of the cells [m³], shape (num_cells,).
        middle: Of the sample [m], shape (3,).
        half: Half lengths of the inner part, radii of a round one [m], shape (3,).
        is_round: Whether it is a cylinder.
        hole: Radius of a hole in it [m].
    """
    solid, away = np.zeros(8), np.empty(3)
    for c in range(cells.shape[0]):
        for i in range(3):
            away[i] = _centre(x, cells, c, i) - middle[i]
        inside = abs(away[2]) < half[2]
        if is_round:
            square = away[0] * away[0] + away[1] * away[1]
            inside &= hole * hole <= square < half[0] * half[0]
        else:
            inside &= abs(away[0]) < half[0] and abs(away[1]) < half[1]
        if inside:
            solid[4 * (away[0] >= 0) + 2 * (away[1] >= 0) + (away[2] >= 0)] += volume[c]
    return solid
