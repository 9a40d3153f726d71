"""Grains that share facets, meshed one by one: made better together, and out of each other."""

import numpy as np

from . import measure
from .neighbours import surface_gaps
from .slivers import Relocation

#: What nodes of surfaces may leave these by, over the wanted length of edges: where altitudes are
#: below the second number of it.
PASSES = ((0.02, 0.42), (0.1, 0.27))
#: A node less deep inside a neighbour than this part of the wanted length touches it.
TOUCHING = 1e-3
#: Gap to which nodes inside a neighbour are brought, and how far gaps are looked for, over the same.
CLEAR, REACH = 4e-3, 0.75
#: Times that nodes inside neighbours are moved.
SWEEPS = 12


def joined(points, cells, size):
    """Nodes of grains moved so that flat tetrahedra get thicker and none is inside a neighbour.

    Nodes that several grains share to the last digit are one: they move in all of them.

    Args:
        points, cells: Of each grain, lists.
        size: Wanted length of edges.

    Returns:
        New points of each grain, a list.
    """
    offset = np.cumsum([0, *map(len, points)])
    every = np.concatenate(points)
    _, first, number = np.unique(every, axis=0, return_index=True, return_inverse=True)
    # In the order of the grains: neighbours in space are neighbours in memory.
    rank = np.argsort(np.argsort(first))
    number = rank[number.ravel()]
    x = every[np.sort(first)]
    tets = np.concatenate([number[c + o] for c, o in zip(cells, offset[:-1], strict=True)])
    shells = [measure.boundary_triangles(c) for c in cells]
    facets = np.concatenate([number[t + o] for t, o in zip(shells, offset[:-1], strict=True)])
    owner = np.repeat(np.arange(len(shells)), [len(t) for t in shells])

    relocation = Relocation(tets, facets, size, len(x))
    relocation.inside(x)
    for tolerance, target in PASSES:
        relocation.surface(x, target, tolerance * size)
    parted(x, facets, owner, size, lambda new, step: _safe(relocation, x, new))
    relocation.inside(x)
    return [x[number[a:b]] for a, b in zip(offset[:-1], offset[1:], strict=True)]


def parted(x, facets, owner, size, safe):
    """Nodes inside a neighbour moved out of it, in place; the number that are left inside.

    A node moves by half of its depth, since the neighbour's nodes do the same.

    Args:
        x: Nodes, which several surfaces may share.
        facets: Closed surfaces seen from outside, one after the other.
        owner: Of each facet, increasing.
        size: Wanted length of edges.
        safe: Called with places and steps of all nodes, returns what part of each step to take.
    """
    base = len(x)
    used, number = np.unique(owner[:, None] * base + facets, return_inverse=True)
    grain, node = np.divmod(used, base)
    triangles = number.reshape(-1, 3)
    for sweep in range(SWEEPS + 1):
        at, gap, normal = surface_gaps(x[node], triangles, grain, REACH * size)
        deep = gap < -TOUCHING * size
        if not deep.any() or sweep == SWEEPS:
            return len(np.unique(node[at[deep]]))
        step = np.zeros_like(x)
        way = 0.5 * (CLEAR * size - gap[deep])
        np.add.at(step, node[at[deep]], np.minimum(way, 0.1 * size)[:, None] * normal[deep])
        x += safe(x + step, step)[:, None] * step
    return 0


def _safe(relocation, x, new):
    """Which nodes may go to new places: where no altitude falls far, each alone."""
    return relocation.allowed(x, new).astype(float)
