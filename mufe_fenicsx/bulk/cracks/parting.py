"""Tractions on facets at nodes that part, with which all parts of a node go on alike."""

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu


def first_tractions(one, other, area, guess, f, mass):
    """Tractions that let the parts of each node accelerate alike [Pa], shape (n, 3). Local.

    Of all that do so they are nearest to ``guess``: at each point t + φ_one - φ_other, where φ of
    the parts solves the balance of their forces.

    Args:
        one, other: Nodes on both sides of each point, shape (n,).
        area: Of the points [m²], shape (n,).
        guess: Tractions on the first sides [Pa], shape (n, 3).
        f: Forces on the nodes without these [N], shape (num_nodes, 3).
        mass: Of the nodes [kg], shape (num_nodes,).
    """
    nodes, ends = np.unique(np.concatenate([one, other]), return_inverse=True)
    a, b = ends[: one.size], ends[one.size :]
    num = nodes.size
    ones = np.ones(one.size)
    num_groups, group = connected_components(coo_array((ones, (a, b)), (num, num)), directed=False)
    f, m = f[nodes], mass[nodes]
    together = np.stack([np.bincount(group, f[:, j], num_groups) for j in range(3)], axis=1)
    acceleration = together / np.bincount(group, m, num_groups)[:, None]
    lacking = m[:, None] * acceleration[group] - f
    bears = area[:, None] * guess
    for j in range(3):
        lacking[:, j] -= np.bincount(a, bears[:, j], num) - np.bincount(b, bears[:, j], num)
    rows, columns = np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a])
    values = np.concatenate([area, area, -area, -area])
    # One part of each node is the ground: the others' forces tell its own.
    ground = np.unique(group, return_index=True)[1]
    free = np.setdiff1d(np.arange(num), ground)
    system = csc_array(coo_array((values, (rows, columns)), (num, num)))
    potential = np.zeros((num, 3))
    potential[free] = splu(system[free][:, free]).solve(lacking[free])
    return guess + potential[a] - potential[b]
