"""Gaps of all pairs anew, without memory: for output and for what happens before a test."""

import math

import numba
import numpy as np

from ..geometry.closest import INTERIOR, closest_point, pseudo_normal


@numba.njit(cache=True, error_model="numpy")
def find_gaps(
    gap, normal, place, x, first, candidate, facets, bulge, neighbour, ring_offset, ring
):  # fmt: skip
    """Distance of each pair's point over the smooth surface of the other grain, and its direction.

    Closest feature first, then the side by its pseudo-normal, as in
    :class:`~mufe_fenicsx.kernels.contact.pairs.PairForces`.

    Args:
        gap: Distances, negative inside [m], shape (num_pairs,).
        normal: Unit vectors from the closest point to the node where it is outside, from
            the node to the closest point where it is inside, shape (num_pairs, 3).
        place: Of each pair's point [m], shape (num_pairs, 3).
        x: Positions of nodes [m], shape (num_nodes_with_ghosts, 3).
        first, candidate: Pairs, as in kernels.contact.search.
        bulge: Of the facets, as of contact.surface.bulges [m], shape (num_facets, 6).
        facets, neighbour, ring_offset, ring: Surface, as in kernels.geometry.closest.
    """
    for p in range(gap.size):
        px, py, pz = place[p, 0], place[p, 1], place[p, 2]
        # Integers of one type throughout: `pseudo_normal` is compiled once.
        best, t, feature = math.inf, np.int64(-1), np.int64(INTERIOR)
        rx, ry, rz = 0.0, 0.0, 0.0
        va, vb, vc = 0.0, 0.0, 0.0
        for k in range(first[p], first[p + 1]):
            f = candidate[k]
            a, b, c = facets[f, 0], facets[f, 1], facets[f, 2]
            wa, wb, wc, touched = closest_point(px, py, pz, x, a, b, c)
            dx = px - wa * x[a, 0] - wb * x[b, 0] - wc * x[c, 0]
            dy = py - wa * x[a, 1] - wb * x[b, 1] - wc * x[c, 1]
            dz = pz - wa * x[a, 2] - wb * x[b, 2] - wc * x[c, 2]
            square = dx * dx + dy * dy + dz * dz
            if square < best:
                best, t, feature, rx, ry, rz = square, f, touched, dx, dy, dz
                va, vb, vc = wa, wb, wc
        d = math.sqrt(best)
        nx, ny, nz = pseudo_normal(x, facets, t, feature, neighbour, ring_offset, ring)
        g = d if rx * nx + ry * ny + rz * nz >= 0.0 else -d
        q = bulge[t]
        gap[p] = g - q[0] * va * vb - q[1] * vb * vc - q[2] * vc * va
        gap[p] += q[3] * va + q[4] * vb + q[5] * vc
        if feature != INTERIOR:
            a, b = facets[t, 0], facets[t, 1]
            edge = (
                math.fabs(x[a, 0] - x[b, 0])
                + math.fabs(x[a, 1] - x[b, 1])
                + math.fabs(x[a, 2] - x[b, 2])
            )
            # On the surface itself the direction is that of the pseudo-normal.
            if d > 1e-9 * edge:
                nx, ny, nz, size = rx, ry, rz, g
            else:
                size = math.sqrt(nx * nx + ny * ny + nz * nz)
            nx, ny, nz = nx / size, ny / size, nz / size
        normal[p, 0], normal[p, 1], normal[p, 2] = nx, ny, nz
