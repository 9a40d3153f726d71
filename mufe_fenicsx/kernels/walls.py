"""Contact of nodes with rigid planes."""

import math

import numba
import numpy as np

from .points import add_force, place_point


@numba.njit(cache=True)
def find_wall_candidates(x, bonded, point, normal, reach):
    """Nodes within ``reach`` of each plane, or behind it, but for those glued to it.

    Args:
        x: Positions [m], shape (num_nodes, 3).
        bonded: Wall that each node is glued to, -1 for none, shape (num_nodes,).
        point, normal: A point of each plane [m] and its normal into the sample, (num_walls, 3).
        reach: Largest gap [m].

    Returns:
        node and wall of each pair; pairs increase in node, then in wall.
    """
    count = 0
    for fill in range(2):
        if fill:
            node, wall = np.empty(count, np.int32), np.empty(count, np.int32)
            count = 0
        for n in range(bonded.size):
            for w in range(normal.shape[0]):
                if bonded[n] == w:
                    continue
                g = 0.0
                for i in range(3):
                    g += (x[n, i] - point[w, i]) * normal[w, i]
                if g <= reach:
                    if fill:
                        node[count], wall[count] = n, w
                    count += 1
    return node, wall


@numba.njit(cache=True, error_model="numpy")
def add_wall_forces(
    f,
    wall_force,
    wall_torque,
    due,
    gap,
    offset,
    closed,
    anchor,
    shear,
    slip,
    push,
    work,
    sliding,
    clock,
    x,
    corner,
    corner_weight,
    node,
    wall,
    point,
    normal,
    layer,
    area,
    recess,
    ratio,
    friction,
    friction_kinetic,
    adopt,
):
    """Add the forces of closed node-wall pairs to ``f`` and ``wall_force``, in place.

    The law is that of :func:`~mufe_fenicsx.kernels.pairs.add_pair_forces`, on the
    whole nodal area since one side only carries nodes; anchors move with the wall.

    Args:
        f: Forces on nodes [N], shape (num_nodes, 3).
        wall_force: Forces on walls [N], shape (num_walls, 3).
        wall_torque: Their torques about ``point`` [N m], shape (num_walls, 3).
        due, gap, offset, closed, slip, sliding: State of the pairs, shape (num_pairs,).
        anchor: Anchors relative to ``point`` [m], shape (num_pairs, 3).
        shear: Friction on the node [N], shape (num_pairs, 3).
        push: Normal force on the node [N], shape (num_pairs,).
        work: Energy dissipated by friction since the last search [J], shape (num_pairs,).
        clock: Bound of all relative motion so far [m].
        x: Positions [m], shape (num_nodes, 3).
        corner, corner_weight: As in :func:`~mufe_fenicsx.kernels.pairs.add_pair_forces`.
        node, wall: The pairs, shape (num_pairs,).
        point, normal: Planes, shape (num_walls, 3).
        layer: Compliance c h/E* of the nodes [m/Pa], shape (num_nodes,).
        area: Areas that the nodes stand for [m²], shape (num_nodes,).
        recess: How far the nodes lie behind the surface that carries contact [m], (num_nodes,).
        ratio: Tangential over normal stiffness, shape (num_nodes,).
        friction: Coefficients of friction that a pair has to overcome, shape (num_walls,).
        friction_kinetic: Coefficients while it slips; until a step in which it sticks.
        adopt: True to adopt every node behind its wall (start of a test).

    Returns:
        Energy dissipated by friction [J]; number of adopted pairs.
    """
    dissipated, num_adopted = 0.0, 0
    for p in range(node.size):
        if due[p] > clock:
            continue
        n, w = node[p], wall[p]
        if corner.shape[0]:
            place_point(x, n, corner, corner_weight)
        nx, ny, nz = normal[w, 0], normal[w, 1], normal[w, 2]
        rx, ry, rz = x[n, 0] - point[w, 0], x[n, 1] - point[w, 1], x[n, 2] - point[w, 2]
        g = rx * nx + ry * ny + rz * nz + recess[n]
        gap[p] = g
        if not closed[p]:
            if offset[p] < 0.0:
                offset[p] = min(max(offset[p], g), 0.0)
            if adopt and g < offset[p]:
                num_adopted += 1
                offset[p] = g
        depth = offset[p] - g
        kn = area[n] / layer[n]
        kt = kn * ratio[n]
        if depth <= 0.0:
            if closed[p]:
                t2 = shear[p, 0] ** 2 + shear[p, 1] ** 2 + shear[p, 2] ** 2
                lost = t2 / (2.0 * kt)
                dissipated += lost
                work[p] += lost
                closed[p] = sliding[p] = False
                push[p] = 0.0
                shear[p, 0] = shear[p, 1] = shear[p, 2] = 0.0
            due[p] = clock + max(g, 0.0)
            continue
        due[p] = clock
        if not closed[p]:
            closed[p] = True
            anchor[p, 0], anchor[p, 1], anchor[p, 2] = rx, ry, rz
        N = kn * depth
        push[p] = N
        sx, sy, sz = rx - anchor[p, 0], ry - anchor[p, 1], rz - anchor[p, 2]
        along = sx * nx + sy * ny + sz * nz
        sx, sy, sz = sx - along * nx, sy - along * ny, sz - along * nz
        T = kt * math.sqrt(sx * sx + sy * sy + sz * sz)
        sliding[p] = T > (friction_kinetic[w] if sliding[p] else friction[w]) * N
        if sliding[p]:
            limit = friction_kinetic[w] * N
            keep = limit / T
            # Work of the mean friction of the step: exact for the trapezoidal rule.
            before2 = shear[p, 0] ** 2 + shear[p, 1] ** 2 + shear[p, 2] ** 2
            slipped = (T - limit) / kt
            lost = 0.5 * (math.sqrt(before2) + limit) * slipped
            dissipated += lost
            work[p] += lost
            slip[p] += slipped
            sx, sy, sz = keep * sx, keep * sy, keep * sz
            anchor[p, 0], anchor[p, 1], anchor[p, 2] = rx - sx, ry - sy, rz - sz
        shear[p, 0], shear[p, 1], shear[p, 2] = -kt * sx, -kt * sy, -kt * sz
        fx, fy, fz = N * nx - kt * sx, N * ny - kt * sy, N * nz - kt * sz
        add_force(f, n, corner, corner_weight, fx, fy, fz)
        wall_force[w, 0] -= fx
        wall_force[w, 1] -= fy
        wall_force[w, 2] -= fz
        wall_torque[w, 0] -= ry * fz - rz * fy
        wall_torque[w, 1] -= rz * fx - rx * fz
        wall_torque[w, 2] -= rx * fy - ry * fx
    return dissipated, num_adopted


@numba.njit(cache=True)
def wall_energy(gap, offset, closed, shear, node, layer, area, ratio):
    """Energy stored in the springs of closed node-wall pairs [J], and their number."""
    energy, count = 0.0, 0
    for p in range(node.size):
        if closed[p]:
            count += 1
            kn = area[node[p]] / layer[node[p]]
            t2 = shear[p, 0] ** 2 + shear[p, 1] ** 2 + shear[p, 2] ** 2
            depth = offset[p] - gap[p]
            energy += 0.5 * kn * depth * depth + 0.5 * t2 / (kn * ratio[node[p]])
    return energy, count


@numba.njit(cache=True)
def add_wall_stiffness(y, q, margin, due, clock, node, wall, closed, normal, layer, area, ratio):
    """Add the springs of node-wall pairs nearer than ``margin`` [m] times ``q`` to ``y``."""
    for p in range(node.size):
        if not (closed[p] or due[p] - clock < margin):
            continue
        n, w = node[p], wall[p]
        kn = area[n] / layer[n]
        kt = kn * ratio[n]
        along = q[n, 0] * normal[w, 0] + q[n, 1] * normal[w, 1] + q[n, 2] * normal[w, 2]
        for i in range(3):
            y[n, i] += kt * q[n, i] + (kn - kt) * along * normal[w, i]


@numba.njit(cache=True)
def gather_rows(out, values, rows):
    """out[i] = values[rows[i]] for rows of three, in place."""
    for i in range(rows.size):
        for k in range(3):
            out[i, k] = values[rows[i], k]


@numba.njit(cache=True)
def gather_some(out, values, rows, some):
    """:func:`gather_rows` for the rows ``some`` of ``out`` alone."""
    for i in some:
        for k in range(3):
            out[i, k] = values[rows[i], k]


@numba.njit(cache=True)
def add_some(values, rows, out, some):
    """:func:`add_rows` for the rows ``some`` of ``out`` alone."""
    for i in some:
        for k in range(3):
            values[rows[i], k] += out[i, k]


@numba.njit(cache=True)
def add_rows(values, rows, out):
    """values[rows[i]] += out[i] for rows of three, in place."""
    for i in range(rows.size):
        for k in range(3):
            values[rows[i], k] += out[i, k]
