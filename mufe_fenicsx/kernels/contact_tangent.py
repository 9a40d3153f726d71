"""Derivatives of the forces of closed contacts by the positions of their nodes.

A contact joins a few nodes, so that differences over all of their coordinates cost little. The
force is written down here as a function of these alone, kernels.pairs and kernels.edges for one
contact: facet, feature, side, stick point, offset and stiffness are those of the last evaluation,
and whether it slips. Positions are taken relative to one of the nodes, and central differences over
``STEP`` of the size of a contact leave some 1e-9 of the stiffness, by truncation and by rounding.
Friction of a contact that slips has the direction of its spring, and beside an edge or a vertex the
normal has that of the way to it: steps are ``NEAR`` of these lengths at most.
Walls are planes; their derivative is written out but for that of the normal force by the depth.
"""

import math

import numba
import numpy as np

from .closest import EDGE, INTERIOR, VERTEX, closest_point, facet_normal, project
from .contact_law import (
    friction_of,
    law_slope,
    left_by_slip,
    limit_of_friction,
    normal_force,
    pressing_force,
    share_of_stiffness,
    slope_of_share,
    stored_energy,
)
from .edge_springs import at_place, in_series, push_along

#: Step of the differences over the size of a contact.
STEP = 1e-5
#: The same over lengths that directions come from; least step over the size of a contact.
NEAR, LEAST = 1e-4, 1e-9
#: A foot found again is the same up to this part of a facet.
SAME = 1e-7
#: Nodes of a contact of a point with a facet, and of two edges.
OF_PAIR, OF_EDGES = 6, 4
#: Ends of two edges as places among four nodes.
FIRST, SECOND = (0, 1), (2, 3)


@numba.njit(cache=True, error_model="numpy")
def _anchor_of(sx, sy, sz, px, py, pz, nx, ny, nz, x, a, b, c):
    """Weights of the point of the facet a, b, c that a spring s from the node leads to.

    ``p`` is the closest point of the facet to the node and ``n`` the normal of the contact,
    which differs from that of the facet on its edges and vertices. The spring lies
    across n, so its end is moved along n into the facet: along the facet's own normal a
    node at depth would find another spring in the next step.
    """
    ux, uy, uz = facet_normal(x, a, b, c)
    slant = nx * ux + ny * uy + nz * uz
    along = (sx * ux + sy * uy + sz * uz) / slant if slant > 0.1 else 0.0
    return project(px - sx + along * nx, py - sy + along * ny, pz - sz + along * nz, x, a, b, c)


@numba.njit(cache=True, error_model="numpy")
def _foot(X, feature):
    """Weights in the triangle X[3:6] of the foot of X[6] on a feature that goes on beyond its end.

    Features as in kernels.closest.
    """
    if feature == INTERIOR:
        return project(X[6, 0], X[6, 1], X[6, 2], X, 3, 4, 5)
    w = np.zeros(3)
    if feature < EDGE:
        w[feature - VERTEX] = 1.0
    else:
        i, j = feature - EDGE, (feature - EDGE + 1) % 3
        along = length = 0.0
        for m in range(3):
            e = X[3 + j, m] - X[3 + i, m]
            along += e * (X[6, m] - X[3 + i, m])
            length += e * e
        w[j] = along / length
        w[i] = 1.0 - w[j]
    return w[0], w[1], w[2]


@numba.njit(cache=True, error_model="numpy")
def _of_pair(F, X, weight, feature, side, fixed, kn, kt, mu, offset, recess, largest, stick_point,
             bulge, softer, left):  # fmt: skip
    """Forces F (6, 3) on the nodes of a contact at positions X (6, 3), the point at X[6].

    ``fixed``: normal where the point lies on an edge or a vertex, zero elsewhere; ``mu``: the
    coefficient of a contact that slips, negative for one that sticks; ``left``: part of the law's
    slope and the depth from which on.
    """
    for m in range(3):
        X[6, m] = weight[0] * X[0, m] + weight[1] * X[1, m] + weight[2] * X[2, m]
    wa, wb, wc = _foot(X, feature)
    rx = X[6, 0] - wa * X[3, 0] - wb * X[4, 0] - wc * X[5, 0]
    ry = X[6, 1] - wa * X[3, 1] - wb * X[4, 1] - wc * X[5, 1]
    rz = X[6, 2] - wa * X[3, 2] - wb * X[4, 2] - wc * X[5, 2]
    ux, uy, uz = facet_normal(X, 3, 4, 5)
    if feature == INTERIOR:
        nx, ny, nz = ux, uy, uz
        height = rx * nx + ry * ny + rz * nz
    elif fixed[0] != 0.0 or fixed[1] != 0.0 or fixed[2] != 0.0:
        nx, ny, nz = fixed[0], fixed[1], fixed[2]
        height = rx * nx + ry * ny + rz * nz
    else:
        height = side * math.sqrt(rx * rx + ry * ry + rz * rz)
        nx, ny, nz = rx / height, ry / height, rz / height
    # The smooth surface over the facet: its height at the foot, and its slope (kernels/pairs.h).
    e1x, e1y, e1z = X[4, 0] - X[3, 0], X[4, 1] - X[3, 1], X[4, 2] - X[3, 2]
    e2x, e2y, e2z = X[5, 0] - X[3, 0], X[5, 1] - X[3, 1], X[5, 2] - X[3, 2]
    twice = ux * (e1y * e2z - e1z * e2y) + uy * (e1z * e2x - e1x * e2z)
    twice += uz * (e1x * e2y - e1y * e2x)
    bx, by, bz = e2y * uz - e2z * uy, e2z * ux - e2x * uz, e2x * uy - e2y * ux
    cx, cy, cz = uy * e1z - uz * e1y, uz * e1x - ux * e1z, ux * e1y - uy * e1x
    ab, bc, ca = bulge[0], bulge[1], bulge[2]
    by_a, by_b = ab * wb + ca * wc - bulge[3], ab * wa + bc * wc - bulge[4]
    by_c = bc * wb + ca * wa - bulge[5]
    z = ab * wa * wb + bc * wb * wc + ca * wc * wa
    z -= bulge[3] * wa + bulge[4] * wb + bulge[5] * wc
    if feature == INTERIOR:
        rise_b, rise_c = (by_b - by_a) / twice, (by_c - by_a) / twice
        gx, gy, gz = rise_b * bx + rise_c * cx, rise_b * by + rise_c * cy, rise_b * bz + rise_c * cz
    elif feature >= EDGE:
        i, j = feature - EDGE, (feature - EDGE + 1) % 3
        lx, ly, lz = X[3 + j, 0] - X[3 + i, 0], X[3 + j, 1] - X[3 + i, 1], X[3 + j, 2] - X[3 + i, 2]
        slopes = (by_a, by_b, by_c)
        rise = (slopes[j] - slopes[i]) / (lx * lx + ly * ly + lz * lz)
        gx, gy, gz = rise * lx, rise * ly, rise * lz
    else:
        gx = gy = gz = 0.0
    hx, hy, hz = nx - gx, ny - gy, nz - gz
    steep = math.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx / steep, hy / steep, hz / steep
    depth = offset - height - recess + z
    depth = left[1] + left[0] * (depth - left[1])
    N = steep * normal_force(kn, depth, largest, softer)
    slope = steep * kt * slope_of_share(depth, softer) if depth < largest else 0.0
    kt *= share_of_stiffness(min(depth, largest), softer)
    sx = X[6, 0] - stick_point[0] * X[3, 0] - stick_point[1] * X[4, 0] - stick_point[2] * X[5, 0]
    sy = X[6, 1] - stick_point[0] * X[3, 1] - stick_point[1] * X[4, 1] - stick_point[2] * X[5, 1]
    sz = X[6, 2] - stick_point[0] * X[3, 2] - stick_point[1] * X[4, 2] - stick_point[2] * X[5, 2]
    along = sx * nx + sy * ny + sz * nz
    sx, sy, sz = sx - along * nx, sy - along * ny, sz - along * nz
    if mu >= 0.0:
        limit = limit_of_friction(mu, N, kt, slope)
        keep = left_by_slip(kt * math.sqrt(sx * sx + sy * sy + sz * sz), limit)
        sx, sy, sz = keep * sx, keep * sy, keep * sz
    N += 0.5 * slope * (sx * sx + sy * sy + sz * sz)
    tx, ty, tz = -kt * sx, -kt * sy, -kt * sz
    fx, fy, fz = N * hx + tx, N * hy + ty, N * hz + tz
    for m in range(3):
        F[m, 0], F[m, 1], F[m, 2] = weight[m] * fx, weight[m] * fy, weight[m] * fz
    # The couple of the height and the force in the facet, borne by the facet.
    tilt = (fx * ux + fy * uy + fz * uz) / (nx * ux + ny * uy + nz * uz)
    tx, ty, tz = fx - tilt * nx, fy - tilt * ny, fz - tilt * nz
    hb = height / twice * (tx * bx + ty * by + tz * bz)
    hc = height / twice * (tx * cx + ty * cy + tz * cz)
    ha = -hb - hc
    F[3, 0], F[3, 1], F[3, 2] = ha * nx - wa * fx, ha * ny - wa * fy, ha * nz - wa * fz
    F[4, 0], F[4, 1], F[4, 2] = hb * nx - wb * fx, hb * ny - wb * fy, hb * nz - wb * fz
    F[5, 0], F[5, 1], F[5, 2] = hc * nx - wc * fx, hc * ny - wc * fy, hc * nz - wc * fz


@numba.njit(cache=True)
def _take_corners(at, weight, n, corner, corner_weight):
    """Nodes and weights of the point n, which is a node where there are no corners, in place."""
    for m in range(3):
        at[m], weight[m] = n, 1.0 if m == 0 else 0.0
        if corner.shape[0]:
            at[m], weight[m] = corner[n, m], corner_weight[n, m]


@numba.njit(cache=True, error_model="numpy")
def pair_tangent(
    rows, columns, blocks, x, num_before, corner, corner_weight, node, candidate, closest, closed,
    closed0, weights, normal, gap, offset, stiffness, stick_point, shear, slip, slip0,
    normal_force, sliding, facets, area, recess, ratio_of_node, friction, friction_row,
    largest_depth, facing, height_of, bulge, softer, dent, slope_left,
):  # fmt: skip
    """Minus the derivative of the forces of all closed pairs, in turn, as blocks of two nodes.

    Args:
        rows, columns: Written: nodes of each block, shape (36 num_closed,), int32.
        blocks: Written: [N/m], shape (36 num_closed, 3, 3).
        x: Positions of points and nodes of the last evaluation [m].
        num_before: Rows of ``x`` before those of nodes.
        closed0: Whether the pairs were closed before the increment: stick points begin where those
            that were not are now, without friction yet.
        slip, slip0: Accumulated slip [m] after that evaluation and before the increment,
            shape (num_pairs,).
        slope_left: Part of the law's slope, 1 where no dent deepens, shape (num_pairs,).
        others: As of :class:`~.pairs.PairForces`.
    """
    X, F, G = np.zeros((7, 3)), np.zeros((6, 3)), np.zeros((6, 3))
    at, weight, fixed = np.empty(6, np.int32), np.zeros(3), np.zeros(3)
    spring = np.zeros(3)
    count = 0
    for p in range(node.size):
        if not closed[p]:
            continue
        n, t = node[p], candidate[closest[p]]
        _take_corners(at, weight, n, corner, corner_weight)
        for m in range(3):
            at[3 + m] = facets[t, m]
        for i in range(6):
            for m in range(3):
                X[i, m] = x[at[i], m] - x[at[0], m]
        for m in range(3):
            X[6, m] = weight[0] * X[0, m] + weight[1] * X[1, m] + weight[2] * X[2, m]
        wa, wb, wc, feature = closest_point(X[6, 0], X[6, 1], X[6, 2], X, 3, 4, 5)
        off = abs(wa - weights[p, 0]) + abs(wb - weights[p, 1]) + abs(wc - weights[p, 2])
        if off > SAME:  # the plane of a facet that it came through beside a sharp edge
            feature = INTERIOR
        height = height_of[p]
        size = math.sqrt(area[n])
        on_it = feature != INTERIOR and abs(height) <= 1e-8 * size
        for m in range(3):
            fixed[m] = facing[p, m] if on_it else 0.0
        kn = stiffness[p]
        kt = kn * ratio_of_node[n] if closed0[p] else 0.0
        mu, short = -1.0, math.inf
        if feature != INTERIOR and not on_it:
            short = abs(height)
        a0, a1, a2 = stick_point[p, 0], stick_point[p, 1], stick_point[p, 2]
        if sliding[p] and closed0[p]:
            mu = friction_of(friction, friction_row, p)[1]
            limit = mu * normal_force[p]
            if limit > 0.0:  # back to the spring before the slip
                share = share_of_stiffness(min(offset[p] - gap[p], largest_depth[p]), softer[p])
                length = limit / (kt * share) + slip[p] - slip0[p]
                short = min(short, length)
                for m in range(3):
                    spring[m] = -length / limit * shear[p, m]
                a0, a1, a2 = _anchor_of(
                    spring[0], spring[1], spring[2], X[6, 0] - height * facing[p, 0],
                    X[6, 1] - height * facing[p, 1], X[6, 2] - height * facing[p, 2],
                    facing[p, 0], facing[p, 1], facing[p, 2], X, 3, 4, 5,
                )  # fmt: skip
            else:
                mu = 0.0
        begin = (a0, a1, a2)
        left = (slope_left[p], offset[p] - gap[p])
        side = 1.0 if height >= 0.0 else -1.0
        step = max(min(STEP * size, NEAR * short), LEAST * size)
        for j in range(6):
            for k in range(3):
                if j < 3 and weight[j] == 0.0:
                    G[:] = 0.0
                    F[:] = 0.0
                else:
                    before = X[j, k]
                    X[j, k] = before + step
                    _of_pair(F, X, weight, feature, side, fixed, kn, kt, mu, offset[p],
                             recess[n] + dent[p], largest_depth[p], begin, bulge[p], softer[p],
                             left)  # fmt: skip
                    X[j, k] = before - step
                    _of_pair(G, X, weight, feature, side, fixed, kn, kt, mu, offset[p],
                             recess[n] + dent[p], largest_depth[p], begin, bulge[p], softer[p],
                             left)  # fmt: skip
                    X[j, k] = before
                for i in range(6):
                    b = count + 6 * i + j
                    rows[b], columns[b] = at[i] - num_before, at[j] - num_before
                    for m in range(3):
                        blocks[b, m, k] = (G[i, m] - F[i, m]) / (2.0 * step)
        count += 36


@numba.njit(cache=True, error_model="numpy")
def _of_edges(F, X, side, law, state):
    """Forces F (4, 3) on the ends X (4, 3) of two edges that cross, as kernels.edges."""
    even, fade, compliance, other_compliance, ratio = law
    mu, offset, largest, stick_point_s, stick_point_t = state
    ux, uy, uz = X[1, 0] - X[0, 0], X[1, 1] - X[0, 1], X[1, 2] - X[0, 2]
    vx, vy, vz = X[3, 0] - X[2, 0], X[3, 1] - X[2, 1], X[3, 2] - X[2, 2]
    wx, wy, wz = X[0, 0] - X[2, 0], X[0, 1] - X[2, 1], X[0, 2] - X[2, 2]
    uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    det = nx * nx + ny * ny + nz * nz
    scale = side / math.sqrt(det)
    nx, ny, nz = nx * scale, ny * scale, nz * scale
    uv = ux * vx + uy * vy + uz * vz
    uw, vw = ux * wx + uy * wy + uz * wz, vx * wx + vy * wy + vz * wz
    s, t = (uv * vw - vv * uw) / det, (uu * vw - uv * uw) / det
    gap = wx * nx + wy * ny + wz * nz
    kn, by_s, by_t = in_series(even, fade, s, t, compliance, other_compliance)
    depth, kt = offset - gap, kn * ratio
    N = normal_force(kn, depth, largest)
    ds, dt = stick_point_s - s, stick_point_t - t
    dx, dy, dz = ds * ux - dt * vx, ds * uy - dt * vy, ds * uz - dt * vz
    if mu >= 0.0:
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        keep = left_by_slip(ratio * length, mu * normal_force(1.0, depth, largest))
        ds, dt, dx, dy, dz = keep * ds, keep * dt, keep * dx, keep * dy, keep * dz
    stored = stored_energy(1.0, depth, largest, 0.0) + 0.5 * ratio * (dx * dx + dy * dy + dz * dz)
    q, r, along = push_along(X, FIRST, SECOND, by_s * stored, by_t * stored)
    h0, h1 = gap * (q - kt * ds), gap * (r + kt * dt)
    ps, pt = s + ds, t + dt
    for m in range(3):
        n, Q = nx if m == 0 else (ny if m == 1 else nz), along[m]
        T = -kt * (dx if m == 0 else (dy if m == 1 else dz))
        F[0, m] = ((1.0 - s) * N - h0) * n + (1.0 - ps) * T + (1.0 - s) * Q
        F[1, m] = (s * N + h0) * n + ps * T + s * Q
        F[2, m] = -((1.0 - t) * N + h1) * n - (1.0 - pt) * T - (1.0 - t) * Q
        F[3, m] = -(t * N - h1) * n - pt * T - t * Q


@numba.njit(cache=True, error_model="numpy")
def edge_tangent(
    rows, columns, blocks, x, first, second, ends, closed, closed0, place, normal, gap, offset,
    recess, stiffness, stick_point, shear, slip, slip0, area, layer, share, compliance, ratio,
    friction, friction_row, largest_depth,
):  # fmt: skip
    """Minus the derivative of the forces of all closed crossings of edges, in turn, as blocks.

    Arguments as of :func:`pair_tangent` and of :func:`~.edges.add_edge_forces`; 16 blocks each.
    """
    X, F, G = np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((4, 3))
    at = np.empty(4, np.int32)
    count = 0
    for p in range(first.size):
        if not closed[p]:
            continue
        i, j = first[p], second[p]
        at[0], at[1], at[2], at[3] = ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1]
        size = 0.0
        for k in range(4):
            for m in range(3):
                X[k, m] = x[at[k], m] - x[at[0], m]
        ux, uy, uz = X[1, 0], X[1, 1], X[1, 2]
        vx, vy, vz = X[3, 0] - X[2, 0], X[3, 1] - X[2, 1], X[3, 2] - X[2, 2]
        side = normal[p, 0] * (uy * vz - uz * vy) + normal[p, 1] * (uz * vx - ux * vz)
        side = math.copysign(1.0, side + normal[p, 2] * (ux * vy - uy * vx))
        size = math.sqrt(min(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz))
        kn = stiffness[p]
        kt = kn * ratio[i] if closed0[p] else 0.0
        mu, scale, short, begin = -1.0, 1.0, math.inf, offset[p] - recess[p]
        slipped = slip[p] - slip0[p]
        if slipped > 0.0 and closed0[p]:
            mu = friction_of(friction, friction_row, p)[1]
            limit = mu * normal_force(kn, begin - gap[p], largest_depth[p])
            trial = limit + kt * slipped
            scale, short = trial / limit if limit > 0.0 else 0.0, trial / kt
        trial_s = place[p, 0] + scale * (stick_point[p, 0] - place[p, 0])
        trial_t = place[p, 1] + scale * (stick_point[p, 1] - place[p, 1])
        step = max(min(STEP * size, NEAR * short), LEAST * size)
        even, fade = at_place(i, j, place[p, 0], place[p, 1], area, layer, share)
        law = even, fade, compliance[i], compliance[j], ratio[i] if closed0[p] else 0.0
        state = mu, begin, largest_depth[p], trial_s, trial_t
        for c in range(4):
            for k in range(3):
                before = X[c, k]
                X[c, k] = before + step
                _of_edges(F, X, side, law, state)
                X[c, k] = before - step
                _of_edges(G, X, side, law, state)
                X[c, k] = before
                for r in range(4):
                    b = count + 4 * r + c
                    rows[b], columns[b] = at[r], at[c]
                    for m in range(3):
                        blocks[b, m, k] = (G[r, m] - F[r, m]) / (2.0 * step)
        count += 16


@numba.njit(cache=True, error_model="numpy")
def wall_tangent(
    rows, columns, blocks, num_before, corner, corner_weight, node, wall, closed, closed0, normal,
    curvature, axis, shear, slip, slip0, normal_force, sliding, layer, area, ratio,
    friction_kinetic, depth, softer, slope_left,
):  # fmt: skip
    """Minus the derivative of the forces of all closed pairs with walls, in turn, as blocks.

    Arguments as of :func:`pair_tangent` and of :class:`~.walls.WallForces`; 9 blocks each. On a
    curved wall the normal turns with the place, dn = -κ (I - a aᵀ - n nᵀ) dx; that friction turns
    with it is left out.

    Args:
        normal: Of the wall at each pair, shape (num_pairs, 3).
        curvature: κ of the wall there, negative where grains are outside [1/m], (num_pairs,).
        axis: Normals or axes of the walls, shape (num_walls, 3).
    """
    K, e, c = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    at, weight = np.empty(3, np.int32), np.zeros(3)
    count = 0
    for p in range(node.size):
        if not closed[p]:
            continue
        n, w = node[p], wall[p]
        _take_corners(at, weight, n, corner, corner_weight)
        kn = area[n] / layer[n]
        kt = kn * ratio[n] if closed0[p] else 0.0
        flat_kt, d, m = kt, depth[p], softer[p]
        kt *= share_of_stiffness(d, m)
        mu, left, spring = -1.0, 1.0, 0.0
        e[:], c[:] = 0.0, 0.0
        if sliding[p] and closed0[p]:
            mu = friction_kinetic[w]
            limit = mu * normal_force[p]
            left = left_by_slip(limit + kt * (slip[p] - slip0[p]), limit)
            if limit > 0.0:
                e[:] = shear[p] / limit
        elif closed0[p]:
            c[:] = -flat_kt * slope_of_share(d, m) / kt * shear[p]
            spring = math.sqrt(shear[p, 0] ** 2 + shear[p, 1] ** 2 + shear[p, 2] ** 2) / kt
        step = STEP * d
        more = pressing_force(kn, flat_kt, d + step, m, spring, mu)
        less = pressing_force(kn, flat_kt, d - step, m, spring, mu)
        slope = slope_left[p] * (more - less) / (2.0 * step)
        law_slope(K, normal[p], e, slope, kt, max(mu, 0.0), left, c)
        turning = normal_force[p] * curvature[p]
        if turning != 0.0:
            for m in range(3):
                K[m, m] += turning
                for k in range(3):
                    across = axis[w, m] * axis[w, k] + normal[p, m] * normal[p, k]
                    K[m, k] -= turning * across
        for i in range(3):
            for j in range(3):
                b = count + 3 * i + j
                rows[b], columns[b] = at[i] - num_before, at[j] - num_before
                for m in range(3):
                    for k in range(3):
                        blocks[b, m, k] = weight[i] * weight[j] * K[m, k]
        count += 9
