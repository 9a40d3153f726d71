"""Springs of crossing edges: their stiffness, their energy, and their part in the time step."""

import numba
import numpy as np

from .contact_law import spring_energy, stored_energy
from .crossing import END

#: Crossings up to this part of their edges, or this angle [rad], outside can carry soon.
BEYOND = 0.1


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
def crossing_stiffness(i, j, s, t, area, layer, share, compliance):
    """Stiffness of a crossing [N/m], and its derivatives by s and t as of :func:`in_series`."""
    k, fade = at_place(i, j, s, t, area, layer, share)
    return in_series(k, fade, s, t, compliance[i], compliance[j])


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


@numba.njit(cache=True)
def edge_energy(gap, offset, recess, closed, stiffness, shear, first, ratio, largest_depth):
    """Energy stored in the springs of closed pairs [J], and their number."""
    energy, count = 0.0, 0
    for p in range(first.size):
        if closed[p]:
            count += 1
            depth = offset[p] - gap[p] - recess[p]
            energy += stored_energy(stiffness[p], depth, largest_depth[p], 0.0)
            energy += spring_energy(shear[p], stiffness[p] * ratio[first[p]])
    return energy, count


@numba.njit(cache=True)
def _can_close(outside, gap, wait, margin, size):
    """Whether a crossing can come between edges and facets, and close, by such a motion."""
    nearest = wait if wait > 0.0 else gap  # not looked at since: the gap is of then
    return nearest < margin and outside <= BEYOND + 2.0 * margin / size


@numba.njit(cache=True)
def find_edge_springs(margin, size, next_check, outside, gap, bound, place, closed, stiffness,
                      first, second, area, layer, share):  # fmt: skip
    """Pairs that are closed or can close by a motion of ``margin`` [m], and their stiffness.

    Crossings that come between edges and facets by such a motion count too, an upper bound.

    Args:
        others: As in :func:`~.edges.add_edge_forces`.

    Returns:
        Pairs, shape (n,); stiffness [N/m], shape (n,).
    """
    found, k = np.empty(first.size, np.int64), np.empty(first.size)
    n = 0
    for p in range(first.size):
        wait = next_check[p] - bound
        if not (closed[p] or _can_close(outside[p], gap[p], wait, margin, size[p])):
            continue
        # As if it did not fade out where one edge goes on as the next, and were at nodes.
        s, t = place[p, 0], place[p, 1]
        found[n] = p
        k[n], _ = at_place(first[p], second[p], s, t, area, layer, share)
        n += 1
    return found[:n], k[:n]


@numba.njit(cache=True)
def areas_and_pushes(area_of, along, on, x, place, depth, largest_depth, stiffness, shear, first,
                     second, ends, area, layer, share, compliance, ratio):  # fmt: skip
    """Areas that crossings stand for, and their forces along edges, in place.

    Args:
        area_of: Result [m²], shape (n,).
        along: q, r and Q as of :func:`push_along`, shape (n, 5).
        on: The crossings, shape (n,).
        depth: Of these, without offset and recess [m], shape (n,).
        others: As in :func:`~.edges.add_edge_forces`.
    """
    for k in range(on.size):
        p = on[k]
        i, j = first[p], second[p]
        s, t = place[p, 0], place[p, 1]
        even, fade = at_place(i, j, s, t, area, layer, share)
        area_of[k] = fade * even * (layer[i] + layer[j])
        kn, by_s, by_t = in_series(even, fade, s, t, compliance[i], compliance[j])
        stored = stored_energy(1.0, depth[k], largest_depth[p], 0.0)
        stored += spring_energy(shear[p], kn * ratio[i]) / kn
        q, r, Q = push_along(x, ends[i], ends[j], by_s * stored, by_t * stored)
        along[k, 0], along[k, 1], along[k, 2], along[k, 3], along[k, 4] = q, r, Q[0], Q[1], Q[2]
