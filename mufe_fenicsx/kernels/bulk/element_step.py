"""Bounds of the stable time step from single tetrahedra."""

import math

import numba
import numpy as np

from .solid import cofactors


@numba.njit(cache=True, inline="always")
def _step(x, cell, wave_speed):
    """Proven time step of one element [s]."""
    h = cofactors(x, cell[0], cell[1], cell[2], cell[3])
    s0, s1, s2 = h[0] + h[3] + h[6], h[1] + h[4] + h[7], h[2] + h[5] + h[8]
    total = s0 * s0 + s1 * s1 + s2 * s2
    for i in range(9):
        total += h[i] * h[i]
    return abs(h[9]) / (wave_speed * math.sqrt(total))


@numba.njit(cache=True)
def element_steps(x, cells, wave_speed):
    """Proven time step of each element by itself [s], shape (num_cells,).

    Arguments and source as of :func:`element_time_step`; ``wave_speed`` of elements.
    """
    steps = np.empty(len(cells))
    for e in range(len(cells)):
        steps[e] = _step(x, cells[e], wave_speed[e])
    return steps


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
            dt = _step(x, cells[e], wave_speed[g])
            if dt < best:
                best, worst = dt, e
    return best, worst


@numba.njit(cache=True)
def add_nodal_stiffness(stiffness, x, cells, grains, cell_offset, modulus):
    """Add what tetrahedra resist each of their nodes with alone, in place.

    A node that moves by itself stretches an element by its gradient: M V |grad N_a|², with the
    volume V and a modulus M.

    Args:
        stiffness: Of the nodes [N/m], shape (num_nodes,).
        x, cells, grains, cell_offset: As of :func:`element_time_step`.
        modulus: Of the grains [Pa], shape (num_grains,).
    """
    for g in grains:
        for e in range(cell_offset[g], cell_offset[g + 1]):
            a, b, c, d = cells[e]
            h = cofactors(x, a, b, c, d)
            factor = modulus[g] / (6.0 * abs(h[9]))
            s0, s1, s2 = h[0] + h[3] + h[6], h[1] + h[4] + h[7], h[2] + h[5] + h[8]
            stiffness[a] += factor * (s0 * s0 + s1 * s1 + s2 * s2)
            stiffness[b] += factor * (h[0] * h[0] + h[1] * h[1] + h[2] * h[2])
            stiffness[c] += factor * (h[3] * h[3] + h[4] * h[4] + h[5] * h[5])
            stiffness[d] += factor * (h[6] * h[6] + h[7] * h[7] + h[8] * h[8])
