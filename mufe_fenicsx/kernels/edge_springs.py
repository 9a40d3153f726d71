"""Springs of crossing edges for tangents: their stiffness by the place, as in edge_springs.h."""

import numba

#: As in edge_springs.h.
END = 1e-3


@numba.njit(cache=True)
def _parts(place, share):
    """Parts of the stiffness of a crossing by its place on an edge: at corners, and beside edges.

    Toward a corner of k edges it falls to a k-th over a quarter of the edge, for several of them
    can cross there at once. Toward an end where the edge goes on, ``share`` 1, it fades out while
    that of the next edge fades in: the two of a straight ridge add up to one.
    """
    inside = place if place < 0.5 else 1.0 - place
    end = share[0] if place < 0.5 else share[1]
    if end == 1.0:
        return 1.0, min(max(0.5 + 0.5 * inside / END, 0.0), 1.0)
    return end + (1.0 - end) * min(max(4.0 * inside, 0.0), 1.0), 1.0


@numba.njit(cache=True)
def at_place(i, j, s, t, area, layer, share):
    """Stiffness of a crossing between meshes that are even [N/m], and the part that has faded in.

    A/2 of a node of the finer edge, over both layers.
    """
    corner, fade = _parts(s, share[i])
    other_corner, other_fade = _parts(t, share[j])
    k = 0.5 * min(corner, other_corner) * min(area[i], area[j]) / (layer[i] + layer[j])
    return k, fade * other_fade


@numba.njit(cache=True)
def in_series(k, fade, s, t, compliance, other_compliance):
    """Stiffness of a crossing [N/m], and its derivatives by s and t.

    Between the ends of an edge a force finds the mesh stiffer than at them, by what the place ξ
    takes off its compliance, ξ (1 - ξ) D. That is added to the spring's own:
    1/k' = 1/k + s (1 - s) D + t (1 - t) D of the other.
    """
    s, t = min(max(s, 0.0), 1.0), min(max(t, 0.0), 1.0)
    soft = 1.0 + k * (s * (1.0 - s) * compliance + t * (1.0 - t) * other_compliance)
    slope = -fade * (k / soft) ** 2
    return (
        fade * k / soft,
        slope * (1.0 - 2.0 * s) * compliance,
        slope * (1.0 - 2.0 * t) * other_compliance,
    )


@numba.njit(cache=True)
def both_edges(x, first, second):
    """The vectors of two edges with these ends [m]."""
    a, b, c, d = first[0], first[1], second[0], second[1]
    u = (x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2])
    return u, (x[d, 0] - x[c, 0], x[d, 1] - x[c, 1], x[d, 2] - x[c, 2])


@numba.njit(cache=True, error_model="numpy")
def parts_along(u, v, along_u, along_v):
    """s and t of the vector s u - t v that has these products with u and v."""
    uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    vv = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    uv = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    det = uu * vv - uv * uv
    return (vv * along_u - uv * along_v) / det, (uv * along_u - uu * along_v) / det


@numba.njit(cache=True, error_model="numpy")
def push_along(x, first, second, by_s, by_t):
    """Force Q = q u + r v on edge u, its opposite on edge v, by which an energy moves a crossing.

    Where edge u moves by w, the crossing moves by ds and dt with ds u - dt v = -w, less what w has
    along the normal: Q.u is the derivative of the energy by s, -Q.v that by t.

    Args:
        x: Positions [m].
        first, second: Ends of u and of v in ``x``.
        by_s, by_t: Derivatives of the energy [J].

    Returns:
        q and r [N/m], and Q [N].
    """
    if by_s == 0.0 and by_t == 0.0:
        return 0.0, 0.0, (0.0, 0.0, 0.0)
    u, v = both_edges(x, first, second)
    q, t = parts_along(u, v, by_s, -by_t)
    return q, -t, (q * u[0] - t * v[0], q * u[1] - t * v[1], q * u[2] - t * v[2])
