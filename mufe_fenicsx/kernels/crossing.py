"""Where two edges cross, and whether they do so inside the bodies."""

import math

import numba

#: Sine of the angle below which two edges are parallel, and left to nodes and facets.
PARALLEL = 0.01
#: Angle by which the normal may lie outside the normals of an edge's facets [rad]: where an
#: edge lies flat on a facet, or two facets on each other, all their crossings carry.
ARC = 0.1
#: Part of an edge by which a crossing may lie beyond its end, where another edge takes over.
END = 1e-3


@numba.njit(cache=True, error_model="numpy")
def _outside(x, a, b, c, d, nx, ny, nz):
    """Sine of the angle by which a direction lies outside the normals of the edge a, b.

    c and d are the vertices beyond the edge. The normals of a convex edge are the
    directions n, at right angles to it, with n.u <= 0 for every u into its facets.
    Negative within them.
    """
    ex, ey, ez = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    ee = ex * ex + ey * ey + ez * ez
    worst = -math.inf
    for o in (c, d):
        rx, ry, rz = x[o, 0] - x[a, 0], x[o, 1] - x[a, 1], x[o, 2] - x[a, 2]
        along = rx * ex + ry * ey + rz * ez
        height = math.sqrt(rx * rx + ry * ry + rz * rz - along * along / ee)
        worst = max(worst, (rx * nx + ry * ny + rz * nz) / height)
    return worst


@numba.njit(cache=True, error_model="numpy")
def crossing(x, ends, beyond, i, j):
    """Where the lines of two edges come closest.

    The normal is that of the separating planes of two convex bodies that touch there:
    it lies between the normals of the facets at edge j and, reversed, at edge i
    (S. Gottschalk, M. C. Lin, D. Manocha, OBBTree, SIGGRAPH 1996, for the axis; D. Gregorius,
    The separating axis test between convex polyhedra, GDC 2013, for the arcs).

    Args:
        x: Positions [m], shape (num_nodes, 3).
        ends, beyond: Edges, as in kernels.edge_search.
        i, j: The two edges.

    Returns:
        By how much it lies outside of the edges or of the normals of their facets, in parts
        of the edge or radians, at most 0 within both; places s and t on the edges, 0 to 1;
        unit normal from edge j to edge i; gap [m], negative where they are inside each other;
        the shorter edge across the other [m], by which motions move the crossing; sine of the
        angle by which the normal lies outside those of the facets.
    """
    a, b, c, d = ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1]
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[d, 0] - x[c, 0], x[d, 1] - x[c, 1], x[d, 2] - x[c, 2]
    wx, wy, wz = x[a, 0] - x[c, 0], x[a, 1] - x[c, 1], x[a, 2] - x[c, 2]
    uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    det = nx * nx + ny * ny + nz * nz
    if not det > PARALLEL * PARALLEL * uu * vv:
        return math.inf, 0.5, 0.5, 0.0, 0.0, 0.0, math.inf, 0.0, math.inf
    uv = ux * vx + uy * vy + uz * vz
    uw, vw = ux * wx + uy * wy + uz * wz, vx * wx + vy * wy + vz * wz
    s, t = (uv * vw - vv * uw) / det, (uu * vw - uv * uw) / det
    # Out of grain j: away from its facets, and towards those of grain i.
    side = 0.0
    for m in range(2):
        o, q = beyond[i, m], beyond[j, m]
        side += nx * (x[o, 0] - x[a, 0]) + ny * (x[o, 1] - x[a, 1]) + nz * (x[o, 2] - x[a, 2])
        side -= nx * (x[q, 0] - x[c, 0]) + ny * (x[q, 1] - x[c, 1]) + nz * (x[q, 2] - x[c, 2])
    scale = math.copysign(1.0 / math.sqrt(det), side)
    nx, ny, nz = nx * scale, ny * scale, nz * scale
    gap = wx * nx + wy * ny + wz * nz
    turned = max(
        _outside(x, a, b, beyond[i, 0], beyond[i, 1], -nx, -ny, -nz),
        _outside(x, c, d, beyond[j, 0], beyond[j, 1], nx, ny, nz),
    )
    beside = max(-s, s - 1.0, -t, t - 1.0)
    across = math.sqrt(det / max(uu, vv))
    return max(beside - END, turned - ARC), s, t, nx, ny, nz, gap, across, turned


@numba.njit(cache=True)
def _point(x, n):
    return x[n, 0], x[n, 1], x[n, 2]


@numba.njit(cache=True)
def _volume(a, b, c, d):
    """Six times the volume of a tetrahedron."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = d[0] - a[0], d[1] - a[1], d[2] - a[2]
    return ux * (vy * wz - vz * wy) + uy * (vz * wx - vx * wz) + uz * (vx * wy - vy * wx)


@numba.njit(cache=True)
def _pierces(a, b, c, d, e):
    """Whether the segment a, b meets the triangle c, d, e."""
    if _volume(a, c, d, e) * _volume(b, c, d, e) > 0.0:
        return False
    first, second, third = _volume(a, b, c, d), _volume(a, b, d, e), _volume(a, b, e, c)
    return (first >= 0.0 and second >= 0.0 and third >= 0.0) or (
        first <= 0.0 and second <= 0.0 and third <= 0.0
    )


@numba.njit(cache=True)
def _reach(x, ends, share, i):
    """Ends of an edge, a little farther where it goes on as another one."""
    a, b = _point(x, ends[i, 0]), _point(x, ends[i, 1])
    along = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    before, after = END * (share[i, 0] == 1.0), END * (share[i, 1] == 1.0)
    return (
        (a[0] - before * along[0], a[1] - before * along[1], a[2] - before * along[2]),
        (b[0] + after * along[0], b[1] + after * along[1], b[2] + after * along[2]),
    )


@numba.njit(cache=True)
def piercings(x, ends, beyond, share, i, j):
    """How often two edges pierce facets of each other, 0 to 4.

    Not at all where the lines of edges cross inside each other but the edges or the facets
    have ended before.
    """
    (a, b), (c, d) = _reach(x, ends, share, i), _reach(x, ends, share, j)
    count = 0
    for m in range(2):
        count += _pierces(a, b, c, d, _point(x, beyond[j, m]))
        count += _pierces(c, d, a, b, _point(x, beyond[i, m]))
    return count
