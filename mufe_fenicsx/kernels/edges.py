"""Contact of sharp edges that cross: how they close, slide, move on and open."""

import math

import numba

from .contact_law import coulomb, friction_of, lost_in_slip, normal_force, stored_energy
from .crossing import END, crossing, piercings
from .edge_search import segment_distance
from .edge_springs import (
    at_place,
    both_edges,
    crossing_stiffness,
    in_series,
    parts_along,
    push_along,
)

#: Crossings deeper than this part of the mean edge are none. The vertices of right-angled edges
#: that cross at their middles are inside from a half on, and nodes and facets hold those.
DEEPEST = 0.6
#: Angle by which a crossing that was open may seem to lie outside its facets by rounding [rad].
ROUNDING = 1e-3
#: Part of its edge from the end on which a crossing may leave to the next one: more than fades out.
LEAVING = 10.0 * END
#: How far ``outside`` a crossing is whose edges or facets end before they meet.
UNPIERCED = 2.0


@numba.njit(cache=True, error_model="numpy")
def _spring(x, ends, i, j, ds, dt):
    """The vector ds u - dt v of edges u and v: between stick points, along the surfaces [m]."""
    u, v = both_edges(x, ends[i], ends[j])
    return ds * u[0] - dt * v[0], ds * u[1] - dt * v[1], ds * u[2] - dt * v[2]


@numba.njit(cache=True, error_model="numpy")
def add_edge_forces(
    f,
    next_check,
    outside,
    place,
    normal,
    gap,
    offset,
    closed,
    sliding,
    stiffness,
    stick_point,
    shear,
    slip,
    work,
    bound,
    x,
    first,
    second,
    ends,
    beyond,
    area,
    layer,
    share,
    compliance,
    ratio,
    friction,
    friction_row,
    size,
    largest_depth,
    recess,
    accept,
):
    """Find the crossings of all pairs and add the forces of the closed ones to ``f``, in place.

    A closed pair with gap g (less its offset) carries the normal force -k g at the
    closest points p of the one and q of the other edge, p - q = g n: the gradient of
    k g²/2, with net force and net moment zero. Friction is the force of a spring between
    two stick points, points of the edges that start as p and q and that Coulomb's limit drags
    along. What separates them beside g n is a vector d = ds u - dt v of the edges u and
    v; friction T = -k_t d acts at the stick points, and its couple g n x T is borne by forces
    ± h n at the ends of the edges, h u + h' v = g T. That is the gradient of k_t d²/2.

    Where k falls along an edge, so does the energy of both springs: it pushes the crossing there by
    a force along the edges, Q, with a couple like that of friction. Both are parts of the gradient.

    The normal force follows from where the edges are now: a pair carries where they cross between
    their ends, with the stiffness of that place. It begins at a gap that was open, or where another
    one leaves an edge that goes on. Edges that come in from the side, inside each other already,
    are those of bodies that touch elsewhere: they carry from the depth on at which they came. What
    springs lose where a crossing fades out or leaves its edges is counted. Anchors pass on to
    the crossing that takes over.

    Args:
        f: Forces on surface nodes [N], shape (num_nodes, 3).
        next_check: Bound before which a pair cannot close [m], shape (num_pairs,).
        outside: By how much the crossing lies outside, as of :func:`crossing`, (num_pairs,);
            ``UNPIERCED`` where lines cross inside each other, but edges or facets end before.
        place: s and t of the crossing, shape (num_pairs, 2).
        normal: Unit normals, from the second to the first edge, shape (num_pairs, 3).
        gap, offset: Gap and its offset (<= 0) [m], shape (num_pairs,).
        closed: Whether the pair carries force, shape (num_pairs,).
        sliding: Whether it slipped in the last step, shape (num_pairs,).
        stiffness: Of closed pairs [N/m], shape (num_pairs,).
        stick_point: s and t of the stick points, shape (num_pairs, 2).
        shear: Friction on the first edge [N], shape (num_pairs, 3).
        slip: Slip since the last search [m], shape (num_pairs,).
        work: Energy dissipated since the last search [J], shape (num_pairs,).
        bound: Of all relative motion so far [m].
        x: Positions [m], shape (num_nodes, 3).
        first, second: The edges of each pair, shape (num_pairs,).
        ends, beyond: Edges, as in kernels.edge_search.
        area: Area that stands for an edge [m²], shape (num_edges,).
        layer: Compliance c h/E* of the edges [m/Pa], shape (num_edges,).
        share: Part of the stiffness that acts at the ends of the edges, shape (num_edges, 2).
        compliance: Relative one of their ends [m/N], shape (num_edges,).
        ratio: Tangential over normal stiffness, shape (num_own_edges,).
        friction, friction_row: Coefficients, as of :class:`~.pairs.PairForces`.
        size: Mean edge of both sides [m], shape (num_pairs,).
        largest_depth: Depth beyond which the force does not grow [m], shape (num_pairs,).
        recess: Depth at which the contact of edges begins [m], shape (num_pairs,).
        accept: True to accept every overlap (start of a test).

    Returns:
        Energy dissipated [J]; energy that springs lost where crossings changed [J]; number of
        accepted pairs; largest accepted depth [m].
    """
    dissipated, switched, num_accepted, deepest = 0.0, 0.0, 0, 0.0
    for p in range(first.size):
        if next_check[p] > bound:
            continue
        i, j = first[p], second[p]
        was_open, was_inside = outside[p] <= 0.0, outside[p] <= 0.0 and gap[p] < 0.0
        outside[p], s, t, nx, ny, nz, g, across, turned = crossing(x, ends, beyond, i, j)
        if g < math.inf:  # not parallel
            if closed[p]:
                # What the stiffness changes by along even edges is a work of the forces.
                k, fade = at_place(i, j, place[p, 0], place[p, 1], area, layer, share)
                stiffness[p] = in_series(k, fade, s, t, compliance[i], compliance[j])[0]
            gap[p], place[p, 0], place[p, 1] = g, s, t
            normal[p, 0], normal[p, 1], normal[p, 2] = nx, ny, nz
        if closed[p]:
            next_check[p] = bound
            continue
        if outside[p] <= 0.0 and g < 0.0 and not (was_open and turned <= ROUNDING):
            if g <= -DEEPEST * size[p] or not piercings(x, ends, beyond, share, i, j):
                outside[p] = UNPIERCED
        if offset[p] < 0.0:
            # What overlapped at the start: the offset of a pair that moves out follows it.
            offset[p] = min(max(offset[p], g + recess[p]), 0.0)
        if accept and outside[p] <= 0.0 and g + recess[p] < offset[p]:
            num_accepted += 1
            deepest = max(deepest, -g)
            offset[p] = g + recess[p]
        # What is deeper than it can have moved since it was last open came in from the side.
        deep = -g > bound - next_check[p] + 1e-9 * size[p]
        if outside[p] <= 0.0 and deep and not was_inside and not accept:
            offset[p] = min(offset[p], g + recess[p])
        if outside[p] > 0.0:
            # An edge can come in from the side, below the other one, or begin to pierce a facet.
            distance = segment_distance(x, ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1])
            way = 0.0 if outside[p] == UNPIERCED else 0.25 * min(outside[p], 1.0) * across
            next_check[p] = bound + max(distance - DEEPEST * size[p], way)
        else:
            next_check[p] = bound + max(g, 0.0)

    # Crossings that take over from one that fades out begin as deep, and have its stick points.
    for p in range(first.size):
        if next_check[p] > bound or closed[p] or -gap[p] <= recess[p]:
            continue
        s, t = place[p, 0], place[p, 1]
        if outside[p] > 0.0 and (outside[p] != UNPIERCED or min(s, 1.0 - s, t, 1.0 - t) > LEAVING):
            continue
        stick_point[p, 0], stick_point[p, 1] = place[p, 0], place[p, 1]
        sliding[p] = False
        q = _left_to(closed, outside, gap, first, second, ends, share, p)
        if q >= 0:
            # Near a corner of facets, edges need not pierce those beside them.
            outside[p], offset[p], next_check[p] = min(outside[p], 0.0), offset[q], bound
            depth = max(offset[p] - gap[p] - recess[p], 0.0)
            i, j = first[p], second[p]
            kn, _, _ = crossing_stiffness(i, j, s, t, area, layer, share, compliance)
            switched -= stored_energy(kn, depth, largest_depth[p], 0.0)
            ds, dt = stick_point[q, 0] - place[q, 0], stick_point[q, 1] - place[q, 1]
            ds, dt = _turned_spring(x, ends, normal, ds, dt, first, second, q, p)
            stick_point[p, 0], stick_point[p, 1] = place[p, 0] + ds, place[p, 1] + dt
            sliding[p] = sliding[q]

    for p in range(first.size):
        if next_check[p] > bound or not (closed[p] or outside[p] <= 0.0):
            continue
        i, j = first[p], second[p]
        depth, carried = offset[p] - gap[p] - recess[p], stiffness[p]
        ds, dt = stick_point[p, 0] - place[p, 0], stick_point[p, 1] - place[p, 1]
        dx, dy, dz = _spring(x, ends, i, j, ds, dt)
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        # As long as friction holds it, whatever the stiffness; its energy over that.
        pressed = max(min(depth, largest_depth[p]), 0.0) / ratio[i]
        mu = friction_of(friction, friction_row, p)
        sliding[p], keep = coulomb(length, mu[0] * pressed, mu[1] * pressed, sliding[p])
        half = 0.5 * ratio[i] * (keep * length) ** 2
        if outside[p] > 0.0 or depth <= 0.0:
            if closed[p]:
                if depth <= 0.0:
                    released = lost_in_slip(shear[p], 0.0, 1.0, dx, dy, dz)
                    dissipated += released
                    work[p] += released
                else:  # it left sideways
                    stored = stored_energy(carried, depth, largest_depth[p], 0.0)
                    switched += stored + carried * half
                closed[p] = False
                shear[p, 0] = shear[p, 1] = shear[p, 2] = 0.0
                next_check[p] = bound + (max(gap[p], 0.0) if outside[p] <= 0.0 else 0.0)
            sliding[p] = False
            continue
        s, t = place[p, 0], place[p, 1]
        kn, by_s, by_t = crossing_stiffness(i, j, s, t, area, layer, share, compliance)
        if closed[p]:
            switched += stored_energy(carried - kn, depth, largest_depth[p], 0.0)
            switched += (carried - kn) * half
        else:
            switched -= kn * half
            closed[p] = True
        stiffness[p] = kn
        next_check[p] = bound
        kt = kn * ratio[i]
        N = normal_force(kn, depth, largest_depth[p])
        if sliding[p]:
            released = lost_in_slip(shear[p], kt * keep, 1.0 - keep, dx, dy, dz)
            dissipated += released
            work[p] += released
            slip[p] += (1.0 - keep) * length
            ds, dt = keep * ds, keep * dt
            dx, dy, dz = keep * dx, keep * dy, keep * dz
            stick_point[p, 0], stick_point[p, 1] = place[p, 0] + ds, place[p, 1] + dt
        shear[p, 0], shear[p, 1], shear[p, 2] = -kt * dx, -kt * dy, -kt * dz
        # Couple: T = -kt (ds u - dt v), so h = -kt g ds on the first edge, kt g dt on the second.
        h0, h1 = -kt * gap[p] * ds, kt * gap[p] * dt
        # The same of the force along the edges, towards where the spring is softer.
        stored = stored_energy(1.0, depth, largest_depth[p], 0.0) + half
        q, r, along = push_along(x, ends[i], ends[j], by_s * stored, by_t * stored)
        h0, h1 = h0 + gap[p] * q, h1 + gap[p] * r
        a, b, c, d = ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1]
        ps, pt = stick_point[p, 0], stick_point[p, 1]
        for m in range(3):
            n, T, Q = normal[p, m], shear[p, m], along[m]
            f[a, m] += ((1.0 - s) * N - h0) * n + (1.0 - ps) * T + (1.0 - s) * Q
            f[b, m] += (s * N + h0) * n + ps * T + s * Q
            f[c, m] -= ((1.0 - t) * N + h1) * n + (1.0 - pt) * T + (1.0 - t) * Q
            f[d, m] -= (t * N - h1) * n + pt * T + t * Q
    return dissipated, switched, num_accepted, deepest


@numba.njit(cache=True)
def _left_to(closed, outside, gap, first, second, ends, share, p):
    """The deepest closed crossing that fades out, or has left, where that of p goes on; -1 if none.

    Both edges of p are its edges, or go on from these.
    """
    best = -1
    for q in range(first.size):
        if (
            closed[q]
            and outside[q] > -LEAVING
            and (best < 0 or gap[q] < gap[best])
            and _goes_on(ends, share, first[q], first[p])
            and _goes_on(ends, share, second[q], second[p])
        ):
            best = q
    return best


@numba.njit(cache=True)
def _goes_on(ends, share, i, j):
    """Whether two edges are the same, or one goes on as the other."""
    for m in range(2):
        for n in range(2):
            if ends[i, m] == ends[j, n] and share[i, m] == 1.0:
                return True
    return i == j


@numba.njit(cache=True, error_model="numpy")
def _turned_spring(x, ends, normal, ds, dt, first, second, q, p):
    """The spring of the pair q as one of the pair p: it keeps its length and turns."""
    dx, dy, dz = _spring(x, ends, first[q], second[q], ds, dt)
    along = dx * normal[p, 0] + dy * normal[p, 1] + dz * normal[p, 2]
    d2 = dx * dx + dy * dy + dz * dz
    now2 = d2 - along * along
    keep = math.sqrt(d2 / now2) if now2 > 0.0 else 0.0
    dx, dy, dz = keep * dx, keep * dy, keep * dz
    u, v = both_edges(x, ends[first[p]], ends[second[p]])
    du, dv = dx * u[0] + dy * u[1] + dz * u[2], dx * v[0] + dy * v[1] + dz * v[2]
    return parts_along(u, v, du, dv)
