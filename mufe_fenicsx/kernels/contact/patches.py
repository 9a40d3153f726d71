"""Which closed points of contact hang together."""

import numba
import numpy as np


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
                one, two = _first_of(first, point), _first_of(first, other)
                first[max(one, two)] = min(one, two)
            last[vertex] = point
    part, num = np.empty(bodies.size, np.int64), 0
    for point in range(bodies.size):
        root = _first_of(first, point)
        if root == point:
            part[point] = num
            num += 1
        else:
            part[point] = part[root]
    return part


@numba.njit(cache=True)
def _first_of(first, point):
    """Follow a point to the one that stands for its part, and shorten the way there."""
    while first[point] != point:
        first[point] = first[first[point]]
        point = first[point]
    return point
