"""Contacts of bodies of any shape while they are packed, and the voxels in them.

Bodies meet in points of their surfaces, each of which carries a part of the area; their depth in
the other body is read from its signed distance on a grid (R. Kawamoto et al., J. Mech. Phys. Solids
91, 2016, 1-13). Names are those of :mod:`.packing`.

Shapes, by number: ``shape`` of each body, shape (n,); ``place``, surface points in the frame of a
body of size 1, shape (num_points, 3), and ``weight``, their part of the surface's area, shape
(num_points,), those of shape t from ``first[t]`` to ``first[t + 1]``; ``grid``, signed distances,
shape (num_shapes, m, m, m), at ``low[t] + step[t] * (i, j, k)``. Rows of ``slip`` (num_rows, 3),
``partner`` and ``seen`` (num_rows,) belong to the points of bodies, of body b from ``row[b]``.
"""

import math

import numba
import numpy as np

from .packing import add_branch, add_load, contact_force, nearest_image, velocity_at, wall_gap

#: Points whose partner is nobody; partners are bodies, and walls after them.
FREE = -1
#: Stiffness by depth and area of a surface point, over modulus and size.
AREA_STIFFNESS = 50.0


@numba.njit(cache=True, inline="always")
def _distance(grid, low, step, q0, q1, q2):
    """Signed distance in a grid and its gradient, trilinear; infinity outside."""
    m = grid.shape[0] - 1
    u, v, w = (q0 - low[0]) / step, (q1 - low[1]) / step, (q2 - low[2]) / step
    if u < 0.0 or v < 0.0 or w < 0.0 or u >= m or v >= m or w >= m:
        return math.inf, 0.0, 0.0, 0.0
    i, j, k = int(u), int(v), int(w)
    u, v, w = u - i, v - j, w - k
    a00 = grid[i, j, k] + u * (grid[i + 1, j, k] - grid[i, j, k])
    a10 = grid[i, j + 1, k] + u * (grid[i + 1, j + 1, k] - grid[i, j + 1, k])
    a01 = grid[i, j, k + 1] + u * (grid[i + 1, j, k + 1] - grid[i, j, k + 1])
    a11 = grid[i, j + 1, k + 1] + u * (grid[i + 1, j + 1, k + 1] - grid[i, j + 1, k + 1])
    b00 = grid[i + 1, j, k] - grid[i, j, k]
    b10 = grid[i + 1, j + 1, k] - grid[i, j + 1, k]
    b01 = grid[i + 1, j, k + 1] - grid[i, j, k + 1]
    b11 = grid[i + 1, j + 1, k + 1] - grid[i, j + 1, k + 1]
    g0 = (1 - w) * ((1 - v) * b00 + v * b10) + w * ((1 - v) * b01 + v * b11)
    g1 = (1 - w) * (a10 - a00) + w * (a11 - a01)
    c0, c1 = a00 + v * (a10 - a00), a01 + v * (a11 - a01)
    return c0 + w * (c1 - c0), g0 / step, g1 / step, (c1 - c0) / step


@numba.njit(cache=True, inline="always")
def _rub(slip, partner, seen, row, other):
    """Whether the point of a row has friction with ``other``: with one partner at a time."""
    if partner[row] == FREE:
        partner[row] = other
    if partner[row] != other:
        return False
    seen[row] = True
    return True


@numba.njit(cache=True)
def forget_open(slip, partner, seen):
    """Points that did not touch their partner in this step have none, in place."""
    for r in range(partner.size):
        if partner[r] != FREE and not seen[r]:
            partner[r] = FREE
            slip[r, 0] = slip[r, 1] = slip[r, 2] = 0.0
        seen[r] = False


@numba.njit(cache=True)
def add_surface_pairs(
    force, torque, stress, stiff, slip, partner, seen, push, normals, pairs, centre, velocity, spin,
    axes, size, reach, mass, least, shape, row, place, weight, first, grid, low, step, law, edge,
    dt,
):  # fmt: skip
    """Forces between bodies of any shape, added in place.

    A surface point that carries the area w, at the depth d in another body, has the stiffness
    k = 50 w E/D with the mean size D of both, and half of that since the points of either side
    count.

    Args:
        push: Sum of normal forces of each pair, to be filled, shape (num_pairs,).
        normals: Sum of forces along normals, towards the first body, shape (num_pairs, 3).
        pairs: Bodies that may touch, shape (num_pairs, 2).

    Returns:
        Number of pairs that touch, sum over them of the largest depth, largest depth.
    """
    ratio, mu, time = law
    touching, total, deepest = 0, 0.0, 0.0
    no_slip = np.zeros(3)
    for p in range(pairs.shape[0]):
        largest = push[p] = 0.0
        normals[p, 0] = normals[p, 1] = normals[p, 2] = 0.0
        for side in range(2):
            a, b = pairs[p, side], pairs[p, 1 - side]
            e0 = nearest_image(centre[b, 0] - centre[a, 0], edge[0])
            e1 = nearest_image(centre[b, 1] - centre[a, 1], edge[1])
            e2 = nearest_image(centre[b, 2] - centre[a, 2], edge[2])
            distance = math.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
            if distance >= reach[a] + reach[b]:
                break
            A, B = axes[a], axes[b]
            # The other centre in the axes of a, and points of a in the axes of b: M x + t.
            h0 = A[0, 0] * e0 + A[1, 0] * e1 + A[2, 0] * e2
            h1 = A[0, 1] * e0 + A[1, 1] * e1 + A[2, 1] * e2
            h2 = A[0, 2] * e0 + A[1, 2] * e1 + A[2, 2] * e2
            m00 = B[0, 0] * A[0, 0] + B[1, 0] * A[1, 0] + B[2, 0] * A[2, 0]
            m01 = B[0, 0] * A[0, 1] + B[1, 0] * A[1, 1] + B[2, 0] * A[2, 1]
            m02 = B[0, 0] * A[0, 2] + B[1, 0] * A[1, 2] + B[2, 0] * A[2, 2]
            m10 = B[0, 1] * A[0, 0] + B[1, 1] * A[1, 0] + B[2, 1] * A[2, 0]
            m11 = B[0, 1] * A[0, 1] + B[1, 1] * A[1, 1] + B[2, 1] * A[2, 1]
            m12 = B[0, 1] * A[0, 2] + B[1, 1] * A[1, 2] + B[2, 1] * A[2, 2]
            m20 = B[0, 2] * A[0, 0] + B[1, 2] * A[1, 0] + B[2, 2] * A[2, 0]
            m21 = B[0, 2] * A[0, 1] + B[1, 2] * A[1, 1] + B[2, 2] * A[2, 1]
            m22 = B[0, 2] * A[0, 2] + B[1, 2] * A[1, 2] + B[2, 2] * A[2, 2]
            t0 = B[0, 0] * e0 + B[1, 0] * e1 + B[2, 0] * e2
            t1 = B[0, 1] * e0 + B[1, 1] * e1 + B[2, 1] * e2
            t2 = B[0, 2] * e0 + B[1, 2] * e1 + B[2, 2] * e2
            # Points of a nearer to b's centre than b's reach lie beyond this plane.
            sa, sb, sh = size[a], size[b], shape[b]
            plane = (distance - reach[b]) * distance / sa
            mean = 0.5 * (sa + sb)
            reduced = mass[a] * mass[b] / (mass[a] + mass[b])
            per_k = time * math.sqrt(reduced / mean)
            base = row[a] - first[shape[a]]
            for k in range(first[shape[a]], first[shape[a] + 1]):
                x0, x1, x2 = place[k, 0], place[k, 1], place[k, 2]
                if x0 * h0 + x1 * h1 + x2 * h2 < plane:
                    continue
                x0, x1, x2 = sa * x0, sa * x1, sa * x2
                d, g0, g1, g2 = _distance(
                    grid[sh], low[sh], step[sh],
                    (m00 * x0 + m01 * x1 + m02 * x2 - t0) / sb,
                    (m10 * x0 + m11 * x1 + m12 * x2 - t1) / sb,
                    (m20 * x0 + m21 * x1 + m22 * x2 - t2) / sb,
                )  # fmt: skip
                if d >= 0.0:
                    continue
                depth = -d * sb
                largest = max(largest, depth)
                slope = 1.0 / max(math.sqrt(g0 * g0 + g1 * g1 + g2 * g2), 1e-300)
                n0 = (B[0, 0] * g0 + B[0, 1] * g1 + B[0, 2] * g2) * slope
                n1 = (B[1, 0] * g0 + B[1, 1] * g1 + B[1, 2] * g2) * slope
                n2 = (B[2, 0] * g0 + B[2, 1] * g1 + B[2, 2] * g2) * slope
                r0 = A[0, 0] * x0 + A[0, 1] * x1 + A[0, 2] * x2
                r1 = A[1, 0] * x0 + A[1, 1] * x1 + A[1, 2] * x2
                r2 = A[2, 0] * x0 + A[2, 1] * x1 + A[2, 2] * x2
                q0, q1, q2 = r0 - e0, r1 - e1, r2 - e2
                u0, u1, u2 = velocity_at(velocity, spin, a, r0, r1, r2)
                v0, v1, v2 = velocity_at(velocity, spin, b, q0, q1, q2)
                stiffness = 0.5 * AREA_STIFFNESS * weight[k] * sa * sa / mean
                held = _rub(slip, partner, seen, base + k, b)
                if not held:
                    no_slip[0] = no_slip[1] = no_slip[2] = 0.0
                N, f0, f1, f2 = contact_force(
                    slip[base + k] if held else no_slip, u0 - v0, u1 - v1, u2 - v2, n0, n1, n2,
                    depth, stiffness, per_k * stiffness, ratio, mu if held else 0.0, dt,
                )  # fmt: skip
                add_load(force, torque, a, r0, r1, r2, f0, f1, f2)
                add_load(force, torque, b, q0, q1, q2, -f0, -f1, -f2)
                add_branch(stress, f0, f1, f2, -e0, -e1, -e2)
                square = r0 * r0 + r1 * r1 + r2 * r2
                stiff[a] += stiffness * (1.0 + 0.5 * square * mass[a] / least[a])
                square = q0 * q0 + q1 * q1 + q2 * q2
                stiff[b] += stiffness * (1.0 + 0.5 * square * mass[b] / least[b])
                push[p] += N
                N = N if side == 0 else -N
                normals[p, 0] += N * n0
                normals[p, 1] += N * n1
                normals[p, 2] += N * n2
        if largest > 0.0:
            touching += 1
            total += largest
            deepest = max(deepest, largest)
    return touching, total, deepest


@numba.njit(cache=True)
def add_surface_walls(
    force, torque, stress, stiff, slip, partner, seen, push, point, normal, radius, centre,
    velocity, spin, axes, size, reach, mass, least, shape, row, place, weight, first, law, dt,
):  # fmt: skip
    """Forces of walls on bodies of any shape, added in place; arguments as above.

    Args:
        push: Normal force on each body, to be filled, shape (n, num_walls).
        point, normal, radius: Walls, as of :func:`add_sphere_walls`.

    Returns:
        Largest depth.
    """
    ratio, mu, time = law
    deepest = 0.0
    no_slip = np.zeros(3)
    for b in range(centre.shape[0]):
        B, s = axes[b], size[b]
        base = row[b] - first[shape[b]]
        per_k = time * math.sqrt(mass[b] / s)
        for w in range(point.shape[0]):
            push[b, w] = 0.0
            gap, n0, n1, n2 = wall_gap(
                centre[b, 0], centre[b, 1], centre[b, 2], point[w], normal[w], radius[w]
            )
            if gap >= reach[b]:
                continue
            for k in range(first[shape[b]], first[shape[b] + 1]):
                x0, x1, x2 = s * place[k, 0], s * place[k, 1], s * place[k, 2]
                r0 = B[0, 0] * x0 + B[0, 1] * x1 + B[0, 2] * x2
                r1 = B[1, 0] * x0 + B[1, 1] * x1 + B[1, 2] * x2
                r2 = B[2, 0] * x0 + B[2, 1] * x1 + B[2, 2] * x2
                gap, n0, n1, n2 = wall_gap(
                    centre[b, 0] + r0, centre[b, 1] + r1, centre[b, 2] + r2, point[w], normal[w],
                    radius[w],
                )  # fmt: skip
                if gap >= 0.0:
                    continue
                deepest = max(deepest, -gap)
                v0, v1, v2 = velocity_at(velocity, spin, b, r0, r1, r2)
                stiffness = AREA_STIFFNESS * weight[k] * s
                held = _rub(slip, partner, seen, base + k, centre.shape[0] + w)
                if not held:
                    no_slip[0] = no_slip[1] = no_slip[2] = 0.0
                N, f0, f1, f2 = contact_force(
                    slip[base + k] if held else no_slip, v0, v1, v2, n0, n1, n2, -gap, stiffness,
                    per_k * stiffness, ratio, mu if held else 0.0, dt,
                )  # fmt: skip
                add_load(force, torque, b, r0, r1, r2, f0, f1, f2)
                add_branch(stress, f0, f1, f2, -r0, -r1, -r2)
                square = r0 * r0 + r1 * r1 + r2 * r2
                stiff[b] += stiffness * (1.0 + 0.5 * square * mass[b] / least[b])
                push[b, w] += N
    return deepest


@numba.njit(cache=True)
def label_voxels(
    labels, depth, origin, voxel, spheres, centre, axes, size, reach, shape, grid, low, step
):
    """Body + 1 in which the middle of each voxel lies deepest, in place.

    Args:
        labels: Zeros at first, shape (z, y, x).
        depth: Zeros at first; how deep it lies, shape (z, y, x).
        origin: Corner of the voxels, x, y, z.
        voxel: Their edge.
        spheres: Whether bodies are spheres, which are taken as such.
    """
    begin, end = np.empty(3, np.int64), np.empty(3, np.int64)
    for b in range(centre.shape[0]):
        B, s, t = axes[b], size[b], shape[b]
        for i in range(3):
            n = labels.shape[2 - i]
            begin[i] = max(0, math.floor((centre[b, i] - reach[b] - origin[i]) / voxel))
            end[i] = min(n, math.ceil((centre[b, i] + reach[b] - origin[i]) / voxel))
        for kz in range(begin[2], end[2]):
            d2 = origin[2] + (kz + 0.5) * voxel - centre[b, 2]
            for ky in range(begin[1], end[1]):
                d1 = origin[1] + (ky + 0.5) * voxel - centre[b, 1]
                for kx in range(begin[0], end[0]):
                    d0 = origin[0] + (kx + 0.5) * voxel - centre[b, 0]
                    if spheres:
                        inside = 0.5 * s - math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
                    else:
                        d, _, _, _ = _distance(
                            grid[t], low[t], step[t],
                            (B[0, 0] * d0 + B[1, 0] * d1 + B[2, 0] * d2) / s,
                            (B[0, 1] * d0 + B[1, 1] * d1 + B[2, 1] * d2) / s,
                            (B[0, 2] * d0 + B[1, 2] * d1 + B[2, 2] * d2) / s,
                        )  # fmt: skip
                        inside = -d * s
                    if inside > depth[kz, ky, kx]:
                        depth[kz, ky, kx] = inside
                        labels[kz, ky, kx] = b + 1
