"""Points of facets: their nodes, and their positions from these."""

import numba


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
        p = points[k]
        a, b, c = corner[p, 0], corner[p, 1], corner[p, 2]
        for i in range(3):
            x[p, i] = weight[p, 0] * x[a, i] + weight[p, 1] * x[b, i] + weight[p, 2] * x[c, i]
