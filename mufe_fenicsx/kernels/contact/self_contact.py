"""Candidates for contact of a grain with itself."""

import math

import numba
import numpy as np

from ..build.rows import resized
from ..geometry.closest import closest_point, facet_normal

#: Largest cosine of the angle between the outward normals of surfaces that face each other.
OPPOSED = -0.3
#: Depth over the largest one from which a node is on the other side of a facet of its own grain.
DEEP = 2.0


@numba.njit(cache=True)
def _within_two_rings(n, f, facets, ring_offset, ring):
    """Whether a facet around node n has a vertex in common with facet f."""
    for k in range(ring_offset[n], ring_offset[n + 1]):
        for i in range(3):
            for j in range(3):
                if facets[ring[k], i] == facets[f, j]:
                    return True
    return False


@numba.njit(cache=True, error_model="numpy")
def _node_normal(x, n, facets, ring_offset, ring):
    """Unit mean of the normals around a node."""
    nx, ny, nz = 0.0, 0.0, 0.0
    for k in range(ring_offset[n], ring_offset[n + 1]):
        f = ring[k]
        mx, my, mz = facet_normal(x, facets[f, 0], facets[f, 1], facets[f, 2])
        nx, ny, nz = nx + mx, ny + my, nz + mz
    scale = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    return nx * scale, ny * scale, nz * scale


@numba.njit(cache=True)
def find_self_candidates(x, grain_of_node, facets, grain_of_facet, ring_offset, ring, reach,
                         depth_of_node, depth_of_facet, low, size, shape, cell_offset,
                         cell_nodes):  # fmt: skip
    """Facets of its own grain near a node that can meet others of them across a void.

    Not those within two rings of facets around the node, nor those that it is behind: it
    would meet them through the body. One at least has to face the surface at the node,
    each in front of the other; the ones beside it tell on which side the node is.

    Args:
        x: Positions [m], shape (num_nodes_with_ghosts, 3).
        grain_of_node: Grains of own nodes, shape (num_nodes,).
        facets: Vertices, shape (num_facets, 3).
        grain_of_facet: Their grains, shape (num_facets,).
        ring_offset, ring: Facets around each node, compressed rows.
        reach: Largest distance of each facet [m], shape (num_facets,).
        depth_of_node, depth_of_facet: Parts in the largest depth of a pair [m].
        low, size, shape, cell_offset, cell_nodes: As in kernels.contact.search.

    Returns:
        Nodes and facets, one of each for every candidate.
    """
    count, capacity = 0, grain_of_node.size + 16
    node, facet = np.empty(capacity, np.int32), np.empty(capacity, np.int32)
    has_facing = np.zeros(grain_of_node.size, np.bool_)
    begin, end = np.empty(3, np.int64), np.empty(3, np.int64)
    for f in range(facets.shape[0]):
        a, b, c = facets[f, 0], facets[f, 1], facets[f, 2]
        nx, ny, nz = facet_normal(x, a, b, c)
        for i in range(3):
            lowest = min(x[a, i], x[b, i], x[c, i]) - reach[f]
            highest = max(x[a, i], x[b, i], x[c, i]) + reach[f]
            begin[i] = max(math.floor((lowest - low[i]) / size), 0)
            end[i] = min(math.floor((highest - low[i]) / size), shape[i] - 1) + 1
        for i in range(begin[0], end[0]):
            for j in range(begin[1], end[1]):
                row = (i * shape[1] + j) * shape[2]
                if begin[2] >= end[2]:
                    continue
                for k in range(cell_offset[row + begin[2]], cell_offset[row + end[2]]):
                    n = cell_nodes[k]
                    if grain_of_node[n] != grain_of_facet[f]:
                        continue
                    px, py, pz = x[n, 0], x[n, 1], x[n, 2]
                    wa, wb, wc, _ = closest_point(px, py, pz, x, a, b, c)
                    dx = px - wa * x[a, 0] - wb * x[b, 0] - wc * x[c, 0]
                    dy = py - wa * x[a, 1] - wb * x[b, 1] - wc * x[c, 1]
                    dz = pz - wa * x[a, 2] - wb * x[b, 2] - wc * x[c, 2]
                    if dx * dx + dy * dy + dz * dz > reach[f] * reach[f]:
                        continue
                    deep = DEEP * (depth_of_node[n] + depth_of_facet[f])
                    if dx * nx + dy * ny + dz * nz < -deep:
                        continue
                    if _within_two_rings(n, f, facets, ring_offset, ring):
                        continue
                    mx, my, mz = _node_normal(x, n, facets, ring_offset, ring)
                    opposed = nx * mx + ny * my + nz * mz < OPPOSED
                    if opposed and dx * mx + dy * my + dz * mz <= deep:
                        has_facing[n] = True
                    if count == capacity:
                        capacity *= 2
                        node, facet = resized(node, capacity), resized(facet, capacity)
                    node[count], facet[count] = n, f
                    count += 1
    kept = 0
    for k in range(count):
        if has_facing[node[k]]:
            node[kept], facet[kept] = node[k], facet[k]
            kept += 1
    return node[:kept].copy(), facet[:kept].copy()
