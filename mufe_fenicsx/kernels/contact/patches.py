"""Closed points of contact: which hang together, and what each adds to the sums of its patch."""

import math

import numba
import numpy as np

from ..geometry.pieces import first_of

#: Columns of the sums over the points of a patch.
COUNT, AREA, DEFORMED, FORCE, EDGE, PLACE, MOMENT = 0, 1, 2, 3, 4, 5, 8
#: Area of each side whose yield stress is known, that area times the stress, and the overlap.
KNOWN, STRENGTH, OVERLAP, NUM_COLUMNS = 17, 19, 21, 22


@numba.njit(cache=True)
def join_points(bodies, order, vertices, num_vertices):
    """Number of the connected part of each point, from 0 on, in the order of their first points.

    Points of the same two bodies belong together where they share a vertex.

    Args:
        bodies: A number for the two bodies of each point, shape (num_points,).
        order: The points by increasing ``bodies``, shape (num_points,).
        vertices: Of each point, -1 for none, shape (num_points, k).
        num_vertices: How many there are.
    """
    first = np.arange(bodies.size)  # a point of the same part, the first of it in the end
    last = np.full(num_vertices, -1)  # the last point seen at each vertex
    for point in order:
        for vertex in vertices[point]:
            if vertex < 0:
                continue
            other = last[vertex]
            if other >= 0 and bodies[other] == bodies[point]:
                one, two = first_of(first, point), first_of(first, other)
                first[max(one, two)] = min(one, two)
            last[vertex] = point
    part, num = np.empty(bodies.size, np.int64), 0
    for point in range(bodies.size):
        root = first_of(first, point)
        if root == point:
            part[point] = num
            num += 1
        else:
            part[point] = part[root]
    return part


@numba.njit(cache=True)
def mean_depth(gap):
    """Mean over a triangle of what lies below zero of a linear field.

    Args:
        gap: At its corners [m], shape (3,).
    """
    one, two, three = gap
    less, more = min(one, two), max(one, two)
    low, middle, high = min(less, three), max(less, min(more, three)), max(more, three)
    mean = (one + two + three) / 3.0
    if high <= 0.0:
        return -mean
    # A corner below zero cuts a pyramid from the prism, and so does one above.
    if middle < 0.0:
        return high**3 / (3.0 * (high - low) * (high - middle)) - mean
    if low < 0.0:
        return -(low**3) / (3.0 * (middle - low) * (high - low))
    return 0.0


@numba.njit(cache=True)
def heights_over_facets(height, x, corner, surface, facet):
    """Heights of the corners of points over the planes of the facets opposite [m].

    Args:
        height: Set, shape (num, 3).
        x: Positions of own surface nodes [m], shape (num_nodes, 3).
        corner: Of each point in ``x``, shape (num, 3).
        surface: Positions of surface nodes with ghosts [m].
        facet: Corners of the facet opposite each point in ``surface``, shape (num, 3).
    """
    normal = np.empty(3)
    for p in range(len(corner)):
        a = surface[facet[p, 0]]
        area = _twice_area(normal, a, surface[facet[p, 1]], surface[facet[p, 2]])
        for k in range(3):
            over = 0.0
            for i in range(3):
                over += (x[corner[p, k], i] - a[i]) * normal[i]
            height[p, k] = over / area


@numba.njit(cache=True)
def _twice_area(normal, a, b, c):
    """Twice the area of a triangle, and its normal of that length."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        normal[i] = (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j])
    return math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)


@numba.njit(cache=True)
def terms_of_points(
    terms, side, counts, area, force, gap, corner, weight, x, ring, begin, facets, of_facet
):
    """What closed points add to the sums of their patches.

    Args:
        terms: Set, zeros before, shape (num, NUM_COLUMNS).
        side: Of the two bodies, whether the second one carries the point, shape (num,).
        counts: Whether the overlap beneath it counts; vertices stand on the area of the facets
            around, shape (num,).
        area: Part of the reference area that each carries [m²], shape (num,).
        force: Normal force [N], shape (num,).
        gap: At the corners of its facet [m], shape (num, 3).
        corner, weight: Nodes in ``x`` that carry each point and their weights, shape (num, 3).
        x: Positions of own surface nodes [m], shape (num_nodes, 3).
        ring, begin: Own facets at each point, compressed rows: those of p are
            ``ring[begin[p] : begin[p + 1]]``.
        facets: Corners of own facets in ``x``, shape (num_facets, 3).
        of_facet: Area [m²], mean edge [m] and yield stress reached [Pa] of own facets, nan where
            it is not known, shape (num_facets, 3).
    """
    normal, place = np.empty(3), np.empty(3)
    for p in range(area.size):
        row, now, before, edge, strength = terms[p], 0.0, 0.0, 0.0, 0.0
        for at in range(begin[p], begin[p + 1]):
            f = ring[at]
            now += 0.5 * _twice_area(normal, x[facets[f, 0]], x[facets[f, 1]], x[facets[f, 2]])
            before += of_facet[f, 0]
            edge += of_facet[f, 1]
            strength += of_facet[f, 2]
        num = begin[p + 1] - begin[p]
        row[COUNT], row[AREA], row[DEFORMED] = 1.0, area[p], area[p] * now / before
        row[FORCE], row[EDGE] = force[p], area[p] * edge / num
        for i in range(3):
            place[i] = 0.0
            for k in range(3):
                place[i] += weight[p, k] * x[corner[p, k], i]
        for i in range(3):
            row[PLACE + i] = area[p] * place[i]
            for j in range(3):
                row[MOMENT + 3 * i + j] = area[p] * place[i] * place[j]
        if not math.isnan(strength):
            row[KNOWN + side[p]] = area[p]
            row[STRENGTH + side[p]] = area[p] * strength / num
        if counts[p]:
            row[OVERLAP] = row[DEFORMED] * mean_depth(gap[p])
