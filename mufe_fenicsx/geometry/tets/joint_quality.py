"""Grains that share facets, meshed one by one: made better together, and out of each other."""

import itertools

import numpy as np

from .. import measure
from ..surface.neighbours import surface_gaps
from .slivers import Relocation

#: What nodes of surfaces may leave these by, over the wanted length of edges, where altitudes are
#: below the second number of it, and whether those on faces of the image stay.
PASSES = ((0.02, 0.42, False), (0.1, 0.27, True))
#: Distance from a face of the image, over the same, of nodes on it.
NEAR = 0.05
#: Times that free nodes are moved towards the volumes of grains that are off by more than this.
ROUNDS, OFF = 10, 3e-3
#: A node less deep inside a neighbour than this part of the wanted length touches it.
TOUCHING = 1e-3
#: Gap to which nodes inside a neighbour are brought, and how far gaps are looked for, likewise.
CLEAR, REACH = 4e-3, 0.75
#: Times that nodes inside neighbours are moved.
SWEEPS = 12


def joined(points, cells, size, volumes, box):
    """Nodes of grains moved so that flat tetrahedra get thicker and none is inside a neighbour.

    Nodes that several grains share to the last digit are one: they move in all of them.

    Args:
        points, cells: Of each grain, lists.
        size: Wanted length of edges.
        volumes: That each grain is to have.
        box: Lower and upper corner of the image, shape (2, 3).

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
    outside = (np.abs(x[:, None] - box).min(axis=1) < NEAR * size).any(axis=1)
    for tolerance, target, held in PASSES:
        relocation.surface(x, target, tolerance * size, np.flatnonzero(outside & held))
    for _ in range(ROUNDS):
        step = _towards_volumes(x, facets, owner, volumes, outside, size)
        if not step.any():
            break
        x += relocation.allowed(x, x + step)[:, None] * step
        relocation.inside(x)
    parted(x, facets, owner, size, lambda new, step: relocation.allowed(x, new))
    relocation.inside(x)
    return [x[number[a:b]] for a, b in itertools.pairwise(offset)]


def _towards_volumes(x, facets, owner, volumes, outside, size):
    """Steps of the free nodes of each grain along its surface's normals, for its volume."""
    corners = x[facets]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    volume = np.bincount(owner, (corners[:, 0] * area).sum(axis=1) / 3, len(volumes))
    change = np.where(np.abs(volume / volumes - 1) > OFF, volumes - volume, 0)
    first, last = np.full(len(x), len(volumes)), np.full(len(x), -1)
    nodal = np.zeros((len(x), 3))
    for i in range(3):
        np.minimum.at(first, facets[:, i], owner)
        np.maximum.at(last, facets[:, i], owner)
        np.add.at(nodal, facets[:, i], area / 3)
    free = (first == last) & ~outside
    length = np.linalg.norm(nodal, axis=1)
    whole = np.bincount(first[free], length[free], len(volumes))
    way = np.clip(change / np.maximum(whole, 1e-300), -0.04 * size, 0.04 * size)
    step = np.zeros_like(x)
    step[free] = way[first[free], None] * nodal[free] / length[free, None]
    return step


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
