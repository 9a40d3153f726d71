"""Points of facets: their positions from the nodes, and their forces back to the nodes."""

import numba


@numba.njit(cache=True, inline="always")
def place_point(x, p, corner, weight):
    """:func:`place_points` for the point ``p`` alone."""
    a, b, c = corner[p, 0], corner[p, 1], corner[p, 2]
    for i in range(3):
        x[p, i] = weight[p, 0] * x[a, i] + weight[p, 1] * x[b, i] + weight[p, 2] * x[c, i]


@numba.njit(cache=True, inline="always")
def spread_point(f, p, corner, weight, fx, fy, fz):
    """Add the force on the point ``p`` to its nodes."""
    for m in range(3):
        n = corner[p, m]
        f[n, 0] += weight[p, m] * fx
        f[n, 1] += weight[p, m] * fy
        f[n, 2] += weight[p, m] * fz


@numba.njit(cache=True, inline="always")
def add_force(f, p, corner, weight, fx, fy, fz):
    """Add a force to the point ``p``: to its nodes, or to itself where points are nodes.

    ``corner`` and ``weight`` have the shape (0, 3) there.
    """
    if corner.shape[0]:
        spread_point(f, p, corner, weight, fx, fy, fz)
    else:
        f[p, 0] += fx
        f[p, 1] += fy
        f[p, 2] += fz


@numba.njit(cache=True)
def place_points(x, points, corner, weight):
    """Rows ``points`` of ``x`` become the weighted means of the rows in ``corner``, in place.

    Args:
        x: Points first, then nodes [m], shape (num_points + num_nodes, 3).
        points: The points to place, shape (num_placed,).
        corner: Rows of the nodes of each point, shape (num_points, 3).
        weight: Their weights, shape (num_points, 3).
    """
    for k in range(points.size):
        place_point(x, points[k], corner, weight)


@numba.njit(cache=True)
def spread_points(f, points, corner, weight):
    """Move the forces in rows ``points`` of ``f`` to their nodes, in place."""
    for k in range(points.size):
        p = points[k]
        fx, fy, fz = f[p, 0], f[p, 1], f[p, 2]
        if fx == 0.0 and fy == 0.0 and fz == 0.0:
            continue
        f[p, 0] = f[p, 1] = f[p, 2] = 0.0
        spread_point(f, p, corner, weight, fx, fy, fz)
