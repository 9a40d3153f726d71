"""Closest feature of a triangulated surface, and on which side of it a point lies."""

import math

import numba

# Features of a triangle: its interior, its vertices, its edges (0-1, 1-2, 2-0).
INTERIOR, VERTEX, EDGE = 0, 1, 4


@numba.njit(cache=True, error_model="numpy")
def closest_point(px, py, pz, x, a, b, c):
    """Closest point of the triangle a, b, c to a point.

    Voronoi regions of the features in turn (C. Ericson, Real-Time Collision
    Detection, 2005, section 5.1.5).

    Args:
        px, py, pz: The point [m].
        x: Positions [m], shape (num_nodes, 3).
        a, b, c: Vertices of the triangle.

    Returns:
        Weights of the vertices at the closest point, and its feature: 0 interior,
        1 to 3 vertices, 4 to 6 edges.
    """
    abx, aby, abz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    acx, acy, acz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    apx, apy, apz = px - x[a, 0], py - x[a, 1], pz - x[a, 2]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0, VERTEX
    ab2 = abx * abx + aby * aby + abz * abz
    ac2 = acx * acx + acy * acy + acz * acz
    abac = abx * acx + aby * acy + abz * acz
    d3, d4 = d1 - ab2, d2 - abac
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0, VERTEX + 1
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / (d1 - d3)
        return 1.0 - t, t, 0.0, EDGE
    d5, d6 = d1 - abac, d2 - ac2
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0, VERTEX + 2
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
        return 1.0 - t, 0.0, t, EDGE + 2
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - t, t, EDGE + 1
    scale = 1.0 / (va + vb + vc)
    v, w = vb * scale, vc * scale
    return 1.0 - v - w, v, w, INTERIOR


@numba.njit(cache=True, error_model="numpy")
def facet_normal(x, a, b, c):
    """Unit normal of the triangle a, b, c, outward where the vertices turn to the left."""
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    scale = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    return nx * scale, ny * scale, nz * scale


@numba.njit(cache=True, error_model="numpy")
def pseudo_normal(x, facets, facet, feature, neighbour, ring_offset, ring):
    """Normal of a feature whose sign tells inside from outside; not of unit length.

    Facet: its normal. Edge: the sum of the two normals. Vertex: the sum of the
    normals around it, each times its angle there (J. A. Bærentzen, H. Aanæs, IEEE
    Trans. Vis. Comput. Graph. 11, 2005, 243-253).

    Args:
        x: Positions [m], shape (num_nodes, 3).
        facets: Vertices, shape (num_facets, 3).
        facet: The facet, and ``feature`` its feature as in :func:`closest_point`.
        neighbour: Facets across the edges 0-1, 1-2, 2-0, shape (num_facets, 3).
        ring_offset, ring: Facets around each node, compressed rows.
    """
    nx, ny, nz = facet_normal(x, facets[facet, 0], facets[facet, 1], facets[facet, 2])
    if feature == INTERIOR:
        return nx, ny, nz
    if feature >= EDGE:
        o = neighbour[facet, feature - EDGE]
        if o >= 0:
            mx, my, mz = facet_normal(x, facets[o, 0], facets[o, 1], facets[o, 2])
            nx, ny, nz = nx + mx, ny + my, nz + mz
        return nx, ny, nz
    node = facets[facet, feature - VERTEX]
    sx, sy, sz = 0.0, 0.0, 0.0
    for k in range(ring_offset[node], ring_offset[node + 1]):
        f = ring[k]
        a, b, c = facets[f, 0], facets[f, 1], facets[f, 2]
        nx, ny, nz = facet_normal(x, a, b, c)
        if b == node:
            b, c = c, a
        elif c == node:
            b, c = a, b
        ux, uy, uz = x[b, 0] - x[node, 0], x[b, 1] - x[node, 1], x[b, 2] - x[node, 2]
        vx, vy, vz = x[c, 0] - x[node, 0], x[c, 1] - x[node, 1], x[c, 2] - x[node, 2]
        cosine = (ux * vx + uy * vy + uz * vz) / math.sqrt(
            (ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz)
        )
        angle = math.acos(min(1.0, max(-1.0, cosine)))
        sx, sy, sz = sx + angle * nx, sy + angle * ny, sz + angle * nz
    return sx, sy, sz
