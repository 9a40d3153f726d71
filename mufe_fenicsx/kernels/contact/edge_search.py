"""Sharp edges of a triangulated surface, and which of them are near each other."""

import math

import numba
import numpy as np

from ..build.rows import resized
from ..geometry.closest import facet_normal

#: Cosine between the normals of two facets that lie on each other, to rounding.
BACK_TO_BACK = -1.0 + 1e-12


@numba.njit(cache=True, error_model="numpy")
def sharp_edges(x, facets, neighbour, cosine):
    """Which edges of facets are convex and turn by more than an angle.

    Args:
        x: Positions [m], shape (num_nodes, 3).
        facets: Vertices, outward, shape (num_facets, 3).
        neighbour: Facets across the edges 0-1, 1-2, 2-0, -1 for none, shape (num_facets, 3).
        cosine: Cosine of that angle between the outward normals of both facets.

    Returns:
        Shape (num_facets, 3), the same from both sides of an edge.
    """
    sharp = np.zeros(facets.shape, np.bool_)
    normal = np.empty(facets.shape)
    for f in range(facets.shape[0]):
        nx, ny, nz = facet_normal(x, facets[f, 0], facets[f, 1], facets[f, 2])
        normal[f, 0], normal[f, 1], normal[f, 2] = nx, ny, nz
    for f in range(facets.shape[0]):
        for k in range(3):
            o = neighbour[f, k]
            if o < 0:
                continue
            nx, ny, nz = normal[f, 0], normal[f, 1], normal[f, 2]
            turn = nx * normal[o, 0] + ny * normal[o, 1] + nz * normal[o, 2]
            if not BACK_TO_BACK < turn <= cosine:  # the two sides of a crack end at no convex edge
                continue
            a, b = facets[f, k], facets[f, (k + 1) % 3]
            d = _third(facets, o, a, b)
            height = nx * (x[d, 0] - x[a, 0]) + ny * (x[d, 1] - x[a, 1]) + nz * (x[d, 2] - x[a, 2])
            sharp[f, k] = height < 0.0
    return sharp


@numba.njit(cache=True)
def _third(facets, f, a, b):
    """The vertex of a facet that is neither a nor b."""
    for m in range(2):
        if facets[f, m] != a and facets[f, m] != b:
            return facets[f, m]
    return facets[f, 2]


@numba.njit(cache=True)
def _is_listed(neighbour, number, sharp, f, k):
    """Whether an edge is sharp, and this facet the one of its two with the lower number."""
    o = neighbour[f, k]
    return sharp[f, k] and o >= 0 and number[o] >= number[f]


@numba.njit(cache=True)
def list_sharp_edges(facets, neighbour, number, sharp):
    """Sharp edges, each once.

    Args:
        facets: Vertices, outward, shape (num_facets, 3).
        neighbour: Facets across the edges 0-1, 1-2, 2-0, shape (num_facets, 3).
        number: Numbers of the facets over all ranks, shape (num_facets,).
        sharp: As of :func:`sharp_edges`.

    Returns:
        ends, shape (num_edges, 2); the vertex beyond the edge in each of its two facets,
        shape (num_edges, 2); these facets, shape (num_edges, 2), the one with the lower
        number first; key, three times that number plus the place of the edge in that facet,
        shape (num_edges,). In the order of the first facets.
    """
    count = 0
    for f in range(facets.shape[0]):
        for k in range(3):
            if _is_listed(neighbour, number, sharp, f, k):
                count += 1
    ends, beyond = np.empty((count, 2), np.int32), np.empty((count, 2), np.int32)
    sides, key = np.empty((count, 2), np.int32), np.empty(count, np.int64)
    count = 0
    for f in range(facets.shape[0]):
        for k in range(3):
            if not _is_listed(neighbour, number, sharp, f, k):
                continue
            o = neighbour[f, k]
            a, b = facets[f, k], facets[f, (k + 1) % 3]
            ends[count, 0], ends[count, 1] = a, b
            beyond[count, 0], beyond[count, 1] = facets[f, (k + 2) % 3], _third(facets, o, a, b)
            sides[count, 0], sides[count, 1] = f, o
            key[count] = 3 * number[f] + k
            count += 1
    return ends, beyond, sides, key


@numba.njit(cache=True)
def edge_areas(area, ends, area_of_facet, ring_offset, ring):
    """Mean area of the nodes at the ends of edges [m²], a third of their facets', in place.

    Args:
        area: Result, shape (num_edges,).
        ends: Ends of the edges, shape (num_edges, 2).
        area_of_facet: In the reference configuration [m²], shape (num_facets,).
        ring_offset, ring: Surface, as in kernels.geometry.closest.
    """
    for e in range(area.size):
        area[e] = 0.0
        for m in range(2):
            for k in range(ring_offset[ends[e, m]], ring_offset[ends[e, m] + 1]):
                area[e] += area_of_facet[ring[k]] / 6.0


@numba.njit(cache=True, error_model="numpy")
def segment_distance(x, a, b, c, d):
    """Distance [m] of the segments from node a to b and from c to d.

    C. Ericson, Real-Time Collision Detection, 2005, section 5.1.9.
    """
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[d, 0] - x[c, 0], x[d, 1] - x[c, 1], x[d, 2] - x[c, 2]
    wx, wy, wz = x[a, 0] - x[c, 0], x[a, 1] - x[c, 1], x[a, 2] - x[c, 2]
    uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
    uv = ux * vx + uy * vy + uz * vz
    uw, vw = ux * wx + uy * wy + uz * wz, vx * wx + vy * wy + vz * wz
    det = uu * vv - uv * uv
    s = 0.0
    if det > 1e-14 * uu * vv:
        s = min(max((uv * vw - uw * vv) / det, 0.0), 1.0)
    t = (uv * s + vw) / vv
    if t < 0.0:
        t = 0.0
        s = min(max(-uw / uu, 0.0), 1.0)
    elif t > 1.0:
        t = 1.0
        s = min(max((uv - uw) / uu, 0.0), 1.0)
    dx, dy, dz = wx + s * ux - t * vx, wy + s * uy - t * vy, wz + s * uz - t * vz
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@numba.njit(cache=True)
def _cells_of(begin, end, x, a, b, reach, low, size, shape):
    """Range of cells that the box of a segment, grown by ``reach``, covers; False if none."""
    some = True
    for i in range(3):
        lowest, highest = min(x[a, i], x[b, i]) - reach, max(x[a, i], x[b, i]) + reach
        begin[i] = max(math.floor((lowest - low[i]) / size), 0)
        end[i] = min(math.floor((highest - low[i]) / size), shape[i] - 1) + 1
        some = some and begin[i] < end[i]
    return some


@numba.njit(cache=True)
def sort_edges_into_cells(x, ends, num_edges, low, size, shape):
    """The first edges in all cells of a regular grid that their boxes touch.

    Args:
        x: Positions [m], shape (num_nodes, 3).
        ends: Ends of the edges, shape (at least num_edges, 2).
        num_edges: How many of them to sort.
        low, size, shape: Lower corner of the grid [m], edge of its cells [m], their numbers.

    Returns:
        first entry of each cell, shape (num_cells + 1,); edges.
    """
    offset = np.zeros(shape[0] * shape[1] * shape[2] + 1, np.int64)
    begin, end = np.empty(3, np.int64), np.empty(3, np.int64)
    entries = np.empty(0, np.int32)
    fill = offset[:-1].copy()
    for last in range(2):
        for e in range(num_edges):
            if not _cells_of(begin, end, x, ends[e, 0], ends[e, 1], 0.0, low, size, shape):
                continue
            for i in range(begin[0], end[0]):
                for j in range(begin[1], end[1]):
                    for k in range(begin[2], end[2]):
                        cell = (i * shape[1] + j) * shape[2] + k
                        if last:
                            entries[fill[cell]] = e
                            fill[cell] += 1
                        else:
                            offset[cell + 1] += 1
        if not last:
            for c in range(offset.size - 1):
                offset[c + 1] += offset[c]
            fill = offset[:-1].copy()
            entries = np.empty(offset[-1], np.int32)
    return offset, entries


@numba.njit(cache=True)
def find_edge_pairs(x, ends, grain, body, num_own, reach, low, size, shape, cell_offset,
                    cell_edges):  # fmt: skip
    """Pairs of an own edge with an edge of a grain of higher number within ``reach``.

    So each pair of edges is found once, on the rank of the lower grain. Of other bodies that are
    pieces of the same grain the edge of higher number is the second.

    Args:
        x: Positions [m], shape (num_nodes, 3).
        ends: Ends of the edges, own edges first, shape (num_edges, 2).
        grain, body: Their grains and bodies, shape (num_edges,).
        num_own: Number of own edges; these are in the grid.
        reach: Largest distance [m].
        low, size, shape, cell_offset, cell_edges: As in :func:`sort_edges_into_cells`.

    Returns:
        Own edge and other edge of each pair, shape (num_pairs,).
    """
    count, capacity = 0, 4 * num_own + 16
    own, other = np.empty(capacity, np.int32), np.empty(capacity, np.int32)
    begin, end = np.empty(3, np.int64), np.empty(3, np.int64)
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for e in range(grain.size):
        a, b = ends[e, 0], ends[e, 1]
        if not _cells_of(begin, end, x, a, b, reach, low, size, shape):
            continue
        for i in range(begin[0], end[0]):
            for j in range(begin[1], end[1]):
                for k in range(begin[2], end[2]):
                    cell = (i * shape[1] + j) * shape[2] + k
                    for m in range(cell_offset[cell], cell_offset[cell + 1]):
                        o = cell_edges[m]
                        if grain[o] > grain[e]:
                            continue
                        if grain[o] == grain[e] and (body[o] == body[e] or o > e):
                            continue
                        # Both are in several cells: the pair counts in the first common one.
                        c, d = ends[o, 0], ends[o, 1]
                        _cells_of(first, last, x, c, d, 0.0, low, size, shape)
                        if (
                            i != max(begin[0], first[0])
                            or j != max(begin[1], first[1])
                            or k != max(begin[2], first[2])
                            or segment_distance(x, c, d, a, b) > reach
                        ):
                            continue
                        if count == capacity:
                            capacity *= 2
                            own, other = resized(own, capacity), resized(other, capacity)
                        own[count], other[count] = o, e
                        count += 1
    return resized(own, count), resized(other, count)
