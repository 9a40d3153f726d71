"""Candidates for contact: which facets of other grains are near which nodes."""

import math

import numba
import numpy as np

from ..build.rows import resized
from ..geometry.closest import closest_point


@numba.njit(cache=True)
def sort_into_cells(x, num_nodes, low, size, shape):
    """Nodes sorted by the cell of a regular grid that holds them.

    Args:
        x: Positions [m], shape (at least num_nodes, 3).
        num_nodes: How many of them to sort.
        low: Lower corner of the grid [m], shape (3,).
        size: Edge of its cells [m].
        shape: Number of cells along x, y, z.

    Returns:
        first entry of each cell, shape (num_cells + 1,); nodes, shape (num_nodes,).
    """
    cell = np.empty(num_nodes, np.int64)
    offset = np.zeros(shape[0] * shape[1] * shape[2] + 1, np.int64)
    for n in range(num_nodes):
        index = 0
        for i in range(3):
            k = int((x[n, i] - low[i]) / size)
            index = index * shape[i] + min(max(k, 0), shape[i] - 1)
        cell[n] = index
        offset[index + 1] += 1
    for c in range(offset.size - 1):
        offset[c + 1] += offset[c]
    fill = offset[:-1].copy()
    nodes = np.empty(num_nodes, np.int32)
    for n in range(num_nodes):
        nodes[fill[cell[n]]] = n
        fill[cell[n]] += 1
    return offset, nodes


@numba.njit(cache=True)
def find_candidates(x, grain_of_node, facets, grain_of_facet, use, reach, stands, low, size, shape,
                    cell_offset, cell_nodes):  # fmt: skip
    """All facets of another grain within their ``reach`` and that of a node.

    Args:
        x: Positions [m], shape (num_nodes_with_ghosts, 3).
        grain_of_node: Grains of the sorted nodes, shape (num_nodes,).
        facets: Vertices, shape (num_facets, 3).
        grain_of_facet: Their grains, shape (num_facets,).
        use: Whether a facet may be touched, shape (num_facets,).
        reach: Largest distance of each facet [m], shape (num_facets,).
        stands: What each node adds to that [m], at least 0, shape (num_nodes,).
        low, size, shape, cell_offset, cell_nodes: As in :func:`sort_into_cells`.

    Returns:
        offset of each node's candidates, shape (num_nodes + 1,), and facets, sorted by
        grain and then by facet for each node.
    """
    num_nodes = grain_of_node.size
    count = np.zeros(num_nodes + 1, np.int64)
    capacity = 16 * num_nodes + 16
    found_node = np.empty(capacity, np.int32)
    found_facet = np.empty(capacity, np.int32)
    num_found = 0
    # In the order of the cells: nodes of one are read one after another.
    place, grain = np.empty((num_nodes, 3)), np.empty(num_nodes, np.int32)
    most = 0.0
    for k in range(num_nodes):
        most = max(most, stands[k])
        grain[k] = grain_of_node[cell_nodes[k]]
        for i in range(3):
            place[k, i] = x[cell_nodes[k], i]
    lowest, highest = np.empty(3), np.empty(3)
    begin, end = np.empty(3, np.int64), np.empty(3, np.int64)
    for f in range(facets.shape[0]):
        if not use[f]:
            continue
        a, b, c = facets[f, 0], facets[f, 1], facets[f, 2]
        empty, farthest = False, reach[f] + most
        for i in range(3):
            lowest[i] = min(x[a, i], x[b, i], x[c, i]) - farthest
            highest[i] = max(x[a, i], x[b, i], x[c, i]) + farthest
            begin[i] = max(math.floor((lowest[i] - low[i]) / size), 0)
            end[i] = min(math.floor((highest[i] - low[i]) / size), shape[i] - 1) + 1
            empty = empty or begin[i] >= end[i]
        if empty:
            continue
        for i in range(begin[0], end[0]):
            for j in range(begin[1], end[1]):
                row = (i * shape[1] + j) * shape[2]
                for k in range(cell_offset[row + begin[2]], cell_offset[row + end[2]]):
                    if grain[k] == grain_of_facet[f]:  # most
                        continue
                    px, py, pz = place[k, 0], place[k, 1], place[k, 2]
                    if px < lowest[0] or px > highest[0] or py < lowest[1] or py > highest[1]:
                        continue
                    if pz < lowest[2] or pz > highest[2]:
                        continue
                    n = cell_nodes[k]
                    wa, wb, wc, _ = closest_point(px, py, pz, x, a, b, c)
                    dx = px - wa * x[a, 0] - wb * x[b, 0] - wc * x[c, 0]
                    dy = py - wa * x[a, 1] - wb * x[b, 1] - wc * x[c, 1]
                    dz = pz - wa * x[a, 2] - wb * x[b, 2] - wc * x[c, 2]
                    if dx * dx + dy * dy + dz * dz > (reach[f] + stands[n]) ** 2:
                        continue
                    if num_found == capacity:
                        capacity *= 2
                        found_node = resized(found_node, capacity)
                        found_facet = resized(found_facet, capacity)
                    found_node[num_found] = n
                    found_facet[num_found] = f
                    num_found += 1
                    count[n + 1] += 1

    for n in range(num_nodes):
        count[n + 1] += count[n]
    fill = count[:-1].copy()
    facet = np.empty(num_found, np.int32)
    for k in range(num_found):
        facet[fill[found_node[k]]] = found_facet[k]
        fill[found_node[k]] += 1
    for n in range(num_nodes):  # insertion sort: the lists are short
        for k in range(count[n] + 1, count[n + 1]):
            f, m = facet[k], k
            while m > count[n] and grain_of_facet[facet[m - 1]] > grain_of_facet[f]:
                facet[m] = facet[m - 1]
                m -= 1
            facet[m] = f
    return count, facet


@numba.njit(cache=True)
def group_by_grain(offset, facet, grain_of_facet):
    """Split each node's candidates by grain: a pair is a node and another grain.

    Args:
        offset, facet: As returned by :func:`find_candidates`.
        grain_of_facet: Grains, shape (num_facets,).

    Returns:
        node and grain of each pair, shape (num_pairs,); first candidate of each
        pair, shape (num_pairs + 1,). Pairs increase in node, then in grain.
    """
    num_pairs = 0
    for n in range(offset.size - 1):
        for k in range(offset[n], offset[n + 1]):
            if k == offset[n] or grain_of_facet[facet[k]] != grain_of_facet[facet[k - 1]]:
                num_pairs += 1
    node = np.empty(num_pairs, np.int32)
    grain = np.empty(num_pairs, np.int32)
    first = np.empty(num_pairs + 1, np.int64)
    p = 0
    for n in range(offset.size - 1):
        for k in range(offset[n], offset[n + 1]):
            if k == offset[n] or grain_of_facet[facet[k]] != grain_of_facet[facet[k - 1]]:
                node[p], grain[p], first[p] = n, grain_of_facet[facet[k]], k
                p += 1
    first[num_pairs] = facet.size
    return node, grain, first
