"""Signed distances of many points from one closed surface."""

import math

import numba

from .closest import closest_point, pseudo_normal


@numba.njit(cache=True, error_model="numpy")
def find_signed_distances(
    distance, at, x, facets, neighbour, ring_offset, ring, centre, radius
):  # fmt: skip
    """Distance of each point from a closed surface, negative inside; exact for its triangles.

    All facets are looked at but those whose ball about ``centre`` is farther than the closest
    point so far. The facet that was closest to the point before comes first, so that points
    in a row cost little more than a comparison a facet. Sign by the pseudo-normal of the
    closest feature, as in :func:`~mufe_fenicsx.kernels.contact.gaps.find_gaps`.

    Args:
        distance: To be filled [m], shape (num_points,).
        at: Positions [m], shape (num_points, 3).
        x: Vertices [m], shape (num_nodes, 3).
        facets, neighbour, ring_offset, ring: Surface, as in kernels.geometry.closest.
        centre: A point of each facet [m], shape (num_facets, 3).
        radius: Of a ball about it that holds the facet [m], shape (num_facets,).
    """
    nearest = 0
    for p in range(at.shape[0]):
        px, py, pz = at[p, 0], at[p, 1], at[p, 2]
        best, reach, feature = math.inf, math.inf, 0
        rx, ry, rz = 0.0, 0.0, 0.0
        first = nearest
        for k in range(-1, facets.shape[0]):
            f = first if k < 0 else k
            ux, uy, uz = px - centre[f, 0], py - centre[f, 1], pz - centre[f, 2]
            if ux * ux + uy * uy + uz * uz > (reach + radius[f]) ** 2:
                continue
            a, b, c = facets[f, 0], facets[f, 1], facets[f, 2]
            wa, wb, wc, touched = closest_point(px, py, pz, x, a, b, c)
            dx = px - wa * x[a, 0] - wb * x[b, 0] - wc * x[c, 0]
            dy = py - wa * x[a, 1] - wb * x[b, 1] - wc * x[c, 1]
            dz = pz - wa * x[a, 2] - wb * x[b, 2] - wc * x[c, 2]
            square = dx * dx + dy * dy + dz * dz
            if square < best:
                best, reach, nearest, feature = square, math.sqrt(square), f, touched
                rx, ry, rz = dx, dy, dz
        nx, ny, nz = pseudo_normal(x, facets, nearest, feature, neighbour, ring_offset, ring)
        distance[p] = reach if rx * nx + ry * ny + rz * nz >= 0.0 else -reach
