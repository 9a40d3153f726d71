"""Boxes along the axes around points, around facets and around the points of each group."""

import numba
import numpy as np


@numba.njit(cache=True)
def box_around(x):
    """Corners of the box around points.

    Args:
        x: Positions [m], shape (num_points, 3).

    Returns:
        lower and upper corner [m], shape (3,); infinity and its negative without points.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for n in range(x.shape[0]):
        for i in range(3):
            low[i], high[i] = min(low[i], x[n, i]), max(high[i], x[n, i])
    return low, high


@numba.njit(cache=True)
def boxes_of_facets(x, facets):
    """Corners of the boxes around facets.

    Args:
        x: Positions [m], shape (num_nodes, 3).
        facets: Vertices, shape (num_facets, 3).

    Returns:
        lower and upper corners [m], shape (num_facets, 3).
    """
    low, high = np.empty(facets.shape), np.empty(facets.shape)
    for f in range(facets.shape[0]):
        a, b, c = facets[f, 0], facets[f, 1], facets[f, 2]
        for i in range(3):
            low[f, i] = min(x[a, i], x[b, i], x[c, i])
            high[f, i] = max(x[a, i], x[b, i], x[c, i])
    return low, high


@numba.njit(cache=True)
def mean_extent(x, facets):
    """Mean extent of facets along the axes [m], arguments as of :func:`boxes_of_facets`."""
    total = 0.0
    for f in range(facets.shape[0]):
        a, b, c = facets[f, 0], facets[f, 1], facets[f, 2]
        for i in range(3):
            total += max(x[a, i], x[b, i], x[c, i]) - min(x[a, i], x[b, i], x[c, i])
    return total / facets.size


@numba.njit(cache=True)
def touch_box(low, high, corner, opposite):
    """Which boxes touch another one, bool, shape (num_boxes,).

    Args:
        low, high: Corners of the boxes [m], shape (num_boxes, 3).
        corner, opposite: Of the other one [m], shape (3,).
    """
    touch = np.empty(low.shape[0], np.bool_)
    for b in range(low.shape[0]):
        touch[b] = True
        for i in range(3):
            touch[b] = touch[b] and low[b, i] <= opposite[i] and high[b, i] >= corner[i]
    return touch


@numba.njit(cache=True)
def boxes_of_groups(x, node, group, num_groups):
    """Corners of the boxes around the points of each group.

    Args:
        x: Positions [m], shape (num_points, 3).
        node: Points in groups, shape (n,).
        group: The group of each of them, shape (n,).
        num_groups: How many there are.

    Returns:
        lower and upper corners [m], shape (num_groups, 3), as of :func:`box_around`.
    """
    low, high = np.full((num_groups, 3), np.inf), np.full((num_groups, 3), -np.inf)
    for k in range(node.size):
        n, g = node[k], group[k]
        for i in range(3):
            low[g, i], high[g, i] = min(low[g, i], x[n, i]), max(high[g, i], x[n, i])
    return low, high


@numba.njit(cache=True)
def with_marked_vertex(facets, marked):
    """Which facets have a vertex that is ``marked``, bool, shape (num_facets,).

    Args:
        facets: Vertices, shape (num_facets, 3).
        marked: Of each node, bool, shape (num_nodes,).
    """
    found = np.empty(facets.shape[0], np.bool_)
    for f in range(facets.shape[0]):
        found[f] = marked[facets[f, 0]] or marked[facets[f, 1]] or marked[facets[f, 2]]
    return found


def grown_by(facets, marked, times):
    """Which facets have a marked vertex, then a vertex of one of these, and so on, (num_facets,).

    Args:
        facets, marked: As of :func:`with_marked_vertex`; the former stays.
        times: How often, 1 or more.
    """
    for _ in range(times):
        near = with_marked_vertex(facets, marked)
        marked = marked.copy()
        marked[facets[near]] = True
    return near
