"""Bound of the stable time step from single tetrahedra."""

import math

import numba

from .solid import _cofactors


@numba.njit(cache=True)
def element_time_step(x, cells, grains, cell_offset, wave_speed):
    """Smallest proven time step of the elements [s] and its element.

    With a quarter of the mass at each node, the highest frequency of one linear
    tetrahedron obeys omega <= 2 c sqrt(sum_a |grad N_a|^2), and |grad N_a| is one
    over the altitude at a; the assembled system lies below the worst element
    (B. M. Irons, S. Ahmad, Techniques of Finite Elements, 1980). The step is 2/omega.
    A mean of J over several elements only takes energy away, so that this holds for it too.

    Args:
        x: Positions [m], shape (num_nodes, 3).
        cells: Nodes of the elements, shape (num_cells, 4).
        grains: The grains that deform, shape (num_deformable,).
        cell_offset: First element of each grain, shape (num_grains + 1,).
        wave_speed: Speed of compression waves of the grains [m/s], shape (num_grains,).
    """
    best, worst = math.inf, -1
    for g in grains:
        for e in range(cell_offset[g], cell_offset[g + 1]):
            h = _cofactors(x, cells[e, 0], cells[e, 1], cells[e, 2], cells[e, 3])
            s0, s1, s2 = h[0] + h[3] + h[6], h[1] + h[4] + h[7], h[2] + h[5] + h[8]
            total = s0 * s0 + s1 * s1 + s2 * s2
            for i in range(9):
                total += h[i] * h[i]
            dt = abs(h[9]) / (wave_speed[g] * math.sqrt(total))
            if dt < best:
                best, worst = dt, e
    return best, worst
