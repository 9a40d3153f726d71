"""Star-shaped bodies given by a radius over directions: where a point lies, contact, voxels.

A body is the image of |v| < r(v/|v|) under a linear map: a point x of space has
v = B Rᵀ (x - c) + o, with the body's place c and axes R. Its level function

    f(x) = |v| - r(v/|v|)

is negative inside, and f/|grad f| is the distance from the surface to first order. The
radius is tabulated on the faces of a cube, bilinear in the two quotients s, t of the smaller
components of v by the largest.

Arrays of all bodies: ``centre`` (n, 3); ``axes`` (n, 3, 3), columns are the body's axes;
``inverse`` B (n, 3, 3); ``offset`` o (n, 3); ``table`` (n, 6, m + 1, m + 1), faces in the order
+0, -0, +1, -1, +2, -2 and s, t along the next two axes in turn; ``reach``, the largest distance
of the surface from the centre [m], and ``bound``, the largest r, shape (n,).
"""

import math

import numba
import numpy as np


@numba.njit(cache=True, inline="always")
def radius_and_slope(table, v0, v1, v2):
    """Radius in the direction of v and its gradient by v: (r, g0, g1, g2)."""
    m = table.shape[1] - 1
    a0, a1, a2 = abs(v0), abs(v1), abs(v2)
    if a0 >= a1 and a0 >= a2:
        axis, main, p, q = 0, v0, v1, v2
    elif a1 >= a2:
        axis, main, p, q = 1, v1, v2, v0
    else:
        axis, main, p, q = 2, v2, v0, v1
    if main == 0.0:
        return table[0, 0, 0], 0.0, 0.0, 0.0
    face = 2 * axis + (1 if main < 0.0 else 0)
    s, t = p / main, q / main
    u, w = 0.5 * m * (s + 1.0), 0.5 * m * (t + 1.0)
    i, j = min(int(u), m - 1), min(int(w), m - 1)
    u, w = u - i, w - j
    r00, r10 = table[face, i, j], table[face, i + 1, j]
    r01, r11 = table[face, i, j + 1], table[face, i + 1, j + 1]
    low, high = r00 + u * (r10 - r00), r01 + u * (r11 - r01)
    r = low + w * (high - low)
    by_s = 0.5 * m * ((1.0 - w) * (r10 - r00) + w * (r11 - r01))
    by_t = 0.5 * m * (high - low)
    gp, gq = by_s / main, by_t / main
    gm = -(by_s * s + by_t * t) / main
    if axis == 0:
        return r, gm, gp, gq
    if axis == 1:
        return r, gq, gm, gp
    return r, gp, gq, gm


@numba.njit(cache=True, inline="always")
def shape_place(x0, x1, x2, centre, axes, inverse, offset):
    """The vector v of a point of space."""
    d0, d1, d2 = x0 - centre[0], x1 - centre[1], x2 - centre[2]
    b0 = axes[0, 0] * d0 + axes[1, 0] * d1 + axes[2, 0] * d2
    b1 = axes[0, 1] * d0 + axes[1, 1] * d1 + axes[2, 1] * d2
    b2 = axes[0, 2] * d0 + axes[1, 2] * d1 + axes[2, 2] * d2
    return (
        inverse[0, 0] * b0 + inverse[0, 1] * b1 + inverse[0, 2] * b2 + offset[0],
        inverse[1, 0] * b0 + inverse[1, 1] * b1 + inverse[1, 2] * b2 + offset[1],
        inverse[2, 0] * b0 + inverse[2, 1] * b1 + inverse[2, 2] * b2 + offset[2],
    )


@numba.njit(cache=True, inline="always")
def level(v0, v1, v2, axes, inverse, table):
    """Level function f at v and its gradient in space: (f, g0, g1, g2)."""
    length = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    r, g0, g1, g2 = radius_and_slope(table, v0, v1, v2)
    unit = 1.0 / max(length, 1e-300)
    g0, g1, g2 = v0 * unit - g0, v1 * unit - g1, v2 * unit - g2
    b0 = inverse[0, 0] * g0 + inverse[1, 0] * g1 + inverse[2, 0] * g2
    b1 = inverse[0, 1] * g0 + inverse[1, 1] * g1 + inverse[2, 1] * g2
    b2 = inverse[0, 2] * g0 + inverse[1, 2] * g1 + inverse[2, 2] * g2
    return (
        length - r,
        axes[0, 0] * b0 + axes[0, 1] * b1 + axes[0, 2] * b2,
        axes[1, 0] * b0 + axes[1, 1] * b1 + axes[1, 2] * b2,
        axes[2, 0] * b0 + axes[2, 1] * b1 + axes[2, 2] * b2,
    )


@numba.njit(cache=True)
def fill_radii(radius, table, directions):
    """Radii of one body along vectors v, shape (m, 3), into ``radius``, shape (m,)."""
    for k in range(radius.size):
        radius[k] = radius_and_slope(table, directions[k, 0], directions[k, 1], directions[k, 2])[0]


@numba.njit(cache=True)
def surface_points(x, place, centre, axes):
    """Points on the surfaces in space, in place.

    Args:
        x: Shape (n, num_points, 3).
        place: The same in the bodies' axes, about their centres, shape (n, num_points, 3).
        centre, axes: As above.
    """
    for b in range(centre.shape[0]):
        R = axes[b]
        for k in range(place.shape[1]):
            p = place[b, k]
            for i in range(3):
                x[b, k, i] = centre[b, i] + R[i, 0] * p[0] + R[i, 1] * p[1] + R[i, 2] * p[2]


@numba.njit(cache=True)
def add_contact_forces(
    force, torque, x, weight, pairs, centre, axes, inverse, offset, table, reach, bound
):
    """Penalty forces between overlapping bodies, added in place.

    A surface point of area w at depth d in another body is pushed out along the gradient by
    w d/2, and the body by the opposite; the points of either body count one half, so that the
    energy is half of the sum of w d²/2 over the points of both.

    Args:
        force, torque: Loads per stiffness [m³, m⁴], shape (n, 3).
        x: Surface points, shape (n, num_points, 3).
        weight: Their areas [m²], shape (n, num_points).
        pairs: Bodies that may touch, shape (num_pairs, 2).
        centre, axes, inverse, offset, table, reach, bound: As above.

    Returns:
        Number of pairs that touch, sum over them of the largest depth [m], largest depth [m].
    """
    touching, sum_depth, deepest = 0, 0.0, 0.0
    for p in range(pairs.shape[0]):
        largest = 0.0
        for side in range(2):
            a, b = pairs[p, side], pairs[p, 1 - side]
            e0 = centre[b, 0] - centre[a, 0]
            e1 = centre[b, 1] - centre[a, 1]
            e2 = centre[b, 2] - centre[a, 2]
            distance = math.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
            if distance >= reach[a] + reach[b]:
                break
            # Points of a nearer to b's centre than b's reach lie beyond this plane.
            least = (distance - reach[b]) * distance
            for k in range(x.shape[1]):
                r0 = x[a, k, 0] - centre[a, 0]
                r1 = x[a, k, 1] - centre[a, 1]
                r2 = x[a, k, 2] - centre[a, 2]
                if r0 * e0 + r1 * e1 + r2 * e2 < least:
                    continue
                v0, v1, v2 = shape_place(
                    x[a, k, 0], x[a, k, 1], x[a, k, 2], centre[b], axes[b], inverse[b], offset[b]
                )
                if v0 * v0 + v1 * v1 + v2 * v2 > bound[b] ** 2:
                    continue
                f, g0, g1, g2 = level(v0, v1, v2, axes[b], inverse[b], table[b])
                if f >= 0.0:
                    continue
                slope = math.sqrt(g0 * g0 + g1 * g1 + g2 * g2)
                depth = -f / slope
                largest = max(largest, depth)
                size = 0.5 * weight[a, k] * depth / slope
                g0, g1, g2 = size * g0, size * g1, size * g2
                force[a, 0] += g0
                force[a, 1] += g1
                force[a, 2] += g2
                torque[a, 0] += r1 * g2 - r2 * g1
                torque[a, 1] += r2 * g0 - r0 * g2
                torque[a, 2] += r0 * g1 - r1 * g0
                r0, r1, r2 = r0 - e0, r1 - e1, r2 - e2
                force[b, 0] -= g0
                force[b, 1] -= g1
                force[b, 2] -= g2
                torque[b, 0] -= r1 * g2 - r2 * g1
                torque[b, 1] -= r2 * g0 - r0 * g2
                torque[b, 2] -= r0 * g1 - r1 * g0
        if largest > 0.0:
            touching += 1
            sum_depth += largest
            deepest = max(deepest, largest)
    return touching, sum_depth, deepest


@numba.njit(cache=True)
def add_wall_forces(force, torque, load, x, weight, low, high, centre, reach):
    """Penalty forces of the six planes of a box, and their sums ``load`` on the walls, in place.

    Args:
        load: On x_min, x_max, y_min, …, per stiffness [m³], shape (6,).
        low, high: Corners of the box [m], shape (3,).
    """
    load[:] = 0.0
    for b in range(centre.shape[0]):
        for i in range(3):
            for side in range(2):
                plane = low[i] if side == 0 else high[i]
                if abs(centre[b, i] - plane) >= reach[b]:
                    continue
                sign = 1.0 if side == 0 else -1.0
                j, m = (i + 1) % 3, (i + 2) % 3
                for k in range(x.shape[1]):
                    depth = sign * (plane - x[b, k, i])
                    if depth <= 0.0:
                        continue
                    push = weight[b, k] * depth
                    load[2 * i + side] += push
                    push *= sign
                    force[b, i] += push
                    torque[b, j] += (x[b, k, m] - centre[b, m]) * push
                    torque[b, m] -= (x[b, k, j] - centre[b, j]) * push


@numba.njit(cache=True)
def find_gaps(gap, place, pairs, low, high, x, centre, axes, inverse, offset, table, reach, bound):
    """Smallest distance of the surfaces of each pair within a box, in place.

    Args:
        gap: [m], negative where they overlap; inf where they are not near, shape (num_pairs,).
        place: Where it is [m], shape (num_pairs, 3).
        low, high: Corners of the box [m]; points elsewhere do not count.
        pairs, x, centre, axes, inverse, offset, table, reach, bound: As above.
    """
    for p in range(pairs.shape[0]):
        gap[p] = np.inf
        for side in range(2):
            a, b = pairs[p, side], pairs[p, 1 - side]
            near = (1.1 * reach[b]) ** 2
            for k in range(x.shape[1]):
                p0, p1, p2 = x[a, k, 0], x[a, k, 1], x[a, k, 2]
                d0, d1, d2 = p0 - centre[b, 0], p1 - centre[b, 1], p2 - centre[b, 2]
                if d0 * d0 + d1 * d1 + d2 * d2 > near:
                    continue
                if p0 < low[0] or p1 < low[1] or p2 < low[2]:
                    continue
                if p0 > high[0] or p1 > high[1] or p2 > high[2]:
                    continue
                v0, v1, v2 = shape_place(p0, p1, p2, centre[b], axes[b], inverse[b], offset[b])
                f, g0, g1, g2 = level(v0, v1, v2, axes[b], inverse[b], table[b])
                distance = f / math.sqrt(g0 * g0 + g1 * g1 + g2 * g2)
                if distance < gap[p]:
                    gap[p] = distance
                    place[p, 0], place[p, 1], place[p, 2] = p0, p1, p2


@numba.njit(cache=True)
def voxelise(
    labels, distance, filled, volume, moment, origin, voxel, parts,
    centre, axes, inverse, offset, table, reach, bound,
):  # fmt: skip
    """Labels of voxels and the part of each voxel that is solid, in place.

    A voxel whose middle lies in several bodies goes to the one in which it lies deepest, so
    labels never overlap. Voxels near a surface are divided into ``parts`` cubed points.

    Args:
        labels: Body + 1 at the voxel's middle, zeros at first, shape (z, y, x).
        distance: From the nearest surface [m], inf at first, shape (z, y, x).
        filled: Solid part of the voxel, summed over bodies, zeros at first, shape (z, y, x).
        volume: Of each body within the image [m³], shape (n,).
        moment: Integral of the position over that [m⁴], x, y, z, shape (n, 3).
        origin: Corner of the image [m], x, y, z.
        voxel: Edge of a voxel [m].
        centre, axes, inverse, offset, table, reach, bound: As above.
    """
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    cube, share = voxel**3, 1.0 / parts**3
    for b in range(centre.shape[0]):
        c, R, B, o, r = centre[b], axes[b], inverse[b], offset[b], table[b]
        volume[b] = 0.0
        moment[b] = 0.0
        for i in range(3):
            n = labels.shape[2 - i]
            first[i] = max(0, math.floor((c[i] - reach[b] - origin[i]) / voxel))
            last[i] = min(n, math.ceil((c[i] + reach[b] - origin[i]) / voxel))
        for kz in range(first[2], last[2]):
            z = origin[2] + (kz + 0.5) * voxel
            for ky in range(first[1], last[1]):
                y = origin[1] + (ky + 0.5) * voxel
                for kx in range(first[0], last[0]):
                    x = origin[0] + (kx + 0.5) * voxel
                    d0, d1, d2 = x - c[0], y - c[1], z - c[2]
                    if d0 * d0 + d1 * d1 + d2 * d2 > (reach[b] + voxel) ** 2:
                        continue
                    v0, v1, v2 = shape_place(x, y, z, c, R, B, o)
                    f, g0, g1, g2 = level(v0, v1, v2, R, B, r)
                    d = f / math.sqrt(g0 * g0 + g1 * g1 + g2 * g2)
                    if d < distance[kz, ky, kx]:
                        distance[kz, ky, kx] = d
                        if d < 0.0:
                            labels[kz, ky, kx] = b + 1
                    # Half the diagonal is 0.87 of the edge; d is exact to first order only.
                    if d > voxel:
                        continue
                    inside = 0
                    mx, my, mz = 0.0, 0.0, 0.0  # first moments about the voxel's middle
                    if d < -voxel:
                        inside = parts**3
                    else:
                        for k in range(parts**3):
                            qx = ((k % parts + 0.5) / parts - 0.5) * voxel
                            qy = ((k // parts % parts + 0.5) / parts - 0.5) * voxel
                            qz = ((k // parts**2 + 0.5) / parts - 0.5) * voxel
                            v0, v1, v2 = shape_place(x + qx, y + qy, z + qz, c, R, B, o)
                            length = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
                            if length < radius_and_slope(r, v0, v1, v2)[0]:
                                inside += 1
                                mx, my, mz = mx + qx, my + qy, mz + qz
                    part = inside * share
                    filled[kz, ky, kx] += part
                    volume[b] += part * cube
                    moment[b, 0] += cube * (part * x + share * mx)
                    moment[b, 1] += cube * (part * y + share * my)
                    moment[b, 2] += cube * (part * z + share * mz)
