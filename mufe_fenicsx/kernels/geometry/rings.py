"""What is around nodes and across edges of a triangulated surface."""

import numba
import numpy as np

from ..build.rows import resized


@numba.njit(cache=True)
def rings(facets, num_nodes):
    """Facets around each node, as compressed rows.

    Args:
        facets: Vertices, shape (num_facets, 3).
        num_nodes: How many nodes there are.

    Returns:
        offset, shape (num_nodes + 1,); ring, int32, shape (3 num_facets,), facets increase in each.
    """
    offset = np.zeros(num_nodes + 1, np.int64)
    for f in range(facets.shape[0]):
        for i in range(3):
            offset[facets[f, i] + 1] += 1
    for n in range(num_nodes):
        offset[n + 1] += offset[n]
    fill = offset[:-1].copy()
    ring = np.empty(3 * facets.shape[0], np.int32)
    for f in range(facets.shape[0]):
        for i in range(3):
            ring[fill[facets[f, i]]] = f
            fill[facets[f, i]] += 1
    return offset, ring


@numba.njit(cache=True)
def neighbours(facets, offset, ring):
    """Facets across the edges 0-1, 1-2, 2-0 of each facet, -1 where there is none.

    The surface is closed and oriented: an edge is shared by two facets that run along it in
    opposite directions. Where several do, the first one counts.

    Args:
        facets, offset, ring: As of :func:`rings`.
    """
    across = np.full(facets.shape, -1, np.int32)
    for f in range(facets.shape[0]):
        for i in range(3):
            a, b = facets[f, i], facets[f, (i + 1) % 3]
            for k in range(offset[b], offset[b + 1]):
                g = ring[k]
                for j in range(3):
                    if facets[g, j] == b and facets[g, (j + 1) % 3] == a:
                        across[f, i] = g
                if across[f, i] >= 0:
                    break
    return across


@numba.njit(cache=True)
def nodes_around(facets, offset, ring, nodes):
    """Other ends of the edges from some nodes.

    Args:
        facets, offset, ring: As of :func:`rings`.
        nodes: Shape (num,).

    Returns:
        Nodes, int32, one after another, which increase for each of ``nodes``; and the first there
        of each and how many, int32, shape (num, 2).
    """
    found = np.empty(8 * nodes.size + 8, np.int32)
    of = np.empty((nodes.size, 2), np.int32)
    num = 0
    for m in range(nodes.size):
        n, first = nodes[m], num
        for k in range(offset[n], offset[n + 1]):
            for j in range(3):
                other = facets[ring[k], j]
                at = num
                while at > first and found[at - 1] > other:
                    at -= 1
                if other == n or (at > first and found[at - 1] == other):
                    continue
                if num == found.size:
                    found = resized(found, 2 * num)
                for p in range(num, at, -1):
                    found[p] = found[p - 1]
                found[at] = other
                num += 1
        of[m, 0], of[m, 1] = first, num - first
    return found[:num].copy(), of
