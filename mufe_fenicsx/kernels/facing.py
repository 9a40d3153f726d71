"""Which facet a node inside another body has come through, beside sharp edges.

The facet closest to a node just inside a sharp edge can be one that the body around the
node cannot touch: pushed out there, the node would slip off the edge while its body stays
inside. A body can rest with a node on a plane only if no node around it lies below.
"""

import numba

from .closest import facet_normal

#: Sine of the angle by which a node around may lie below such a plane: 20 degrees.
FACING = 0.342
#: Part of a facet by which the foot of such a node may lie beside it: edges may lie on edges.
BESIDE = 1e-3


@numba.njit(cache=True, error_model="numpy")
def faces(x, n, nx, ny, nz, facets, ring_offset, ring):
    """Whether a body can rest with node n on a plane of the given normal.

    Args:
        x: Positions [m], shape (num_nodes, 3).
        n: The node.
        nx, ny, nz: Unit normal of the plane, towards the body.
        facets, ring_offset, ring: Surface, as in kernels.closest.
    """
    for k in range(ring_offset[n], ring_offset[n + 1]):
        for m in range(3):
            w = facets[ring[k], m]
            dx, dy, dz = x[w, 0] - x[n, 0], x[w, 1] - x[n, 1], x[w, 2] - x[n, 2]
            height = dx * nx + dy * ny + dz * nz
            if height < 0.0 and height * height > FACING * FACING * (dx * dx + dy * dy + dz * dz):
                return False
    return True


@numba.njit(cache=True, error_model="numpy")
def find_facing(pair, x, node, first, candidate, facets, ring_offset, ring, limit):
    """The nearest facet that a node is straight behind and that its body faces.

    Args:
        pair: The pair of node and grain.
        x, node, first, candidate, facets, ring_offset, ring: As in kernels.pairs.
        limit: Largest depth [m].

    Returns:
        Candidate, -1 if none; gap [m]; weights of the foot; unit normal.
    """
    n = node[pair]
    best = (-1, -limit, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(first[pair], first[pair + 1]):
        a, b, c = facets[candidate[k], 0], facets[candidate[k], 1], facets[candidate[k], 2]
        nx, ny, nz = facet_normal(x, a, b, c)
        dx, dy, dz = x[n, 0] - x[a, 0], x[n, 1] - x[a, 1], x[n, 2] - x[a, 2]
        g = dx * nx + dy * ny + dz * nz
        if not best[1] < g < 0.0:
            continue
        ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
        vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
        uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
        uv = ux * vx + uy * vy + uz * vz
        du, dv = dx * ux + dy * uy + dz * uz, dx * vx + dy * vy + dz * vz
        det = uu * vv - uv * uv
        wb, wc = (vv * du - uv * dv) / det, (uu * dv - uv * du) / det
        if min(1.0 - wb - wc, wb, wc) >= -BESIDE and faces(
            x, n, nx, ny, nz, facets, ring_offset, ring
        ):
            best = (k, g, 1.0 - wb - wc, wb, wc, nx, ny, nz)
    return best
