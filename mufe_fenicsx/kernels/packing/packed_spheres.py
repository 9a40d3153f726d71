"""Motion and contacts of spheres while they are packed, which touch in one point.

Names are those of :mod:`.packing`.
"""

import math

import numba

from .packing import add_branch, add_load, contact_force, nearest_image, velocity_at, wall_gap


@numba.njit(cache=True)
def kick_and_drift_spheres(
    centre, velocity, momentum, spin, force, torque, mass, inertia, dt, damping
):
    """As :func:`~mufe_fenicsx.kernels.bulk.rigid.kick_and_drift` of spheres, which need not turn.

    Args:
        spin: Filled with the rate of turning between both places, which slips are made of.

    Returns:
        The largest distance that a body moved.
    """
    half, largest = 0.5 * dt, 0.0
    for b in range(mass.size):
        square = 0.0
        for i in range(3):
            velocity[b, i] += half * (force[b, i] / mass[b] - damping * velocity[b, i])
            momentum[b, i] += half * (torque[b, i] - damping * momentum[b, i])
            spin[b, i] = momentum[b, i] / inertia[b, i]
            centre[b, i] += dt * velocity[b, i]
            square += velocity[b, i] ** 2
        if not square < math.inf:
            largest = math.inf
        largest = max(largest, dt * math.sqrt(square))
    return largest


@numba.njit(cache=True)
def add_sphere_pairs(
    force, torque, stress, stiff, slip, push, pairs, centre, velocity, spin, size, mass, law, edge,
    dt,
):  # fmt: skip
    """Forces between spheres, added in place; k is the harmonic mean of both sizes.

    Args:
        slip: Of each pair, shape (num_pairs, 3); zero again where it is open.
        push: Normal force of each pair, to be filled, shape (num_pairs,).
        pairs: Bodies that may touch, shape (num_pairs, 2).

    Returns:
        Number of pairs that touch, sum of their depths, largest depth.
    """
    ratio, mu, time = law
    touching, total, deepest = 0, 0.0, 0.0
    for p in range(pairs.shape[0]):
        a, b = pairs[p, 0], pairs[p, 1]
        d0 = nearest_image(centre[a, 0] - centre[b, 0], edge[0])
        d1 = nearest_image(centre[a, 1] - centre[b, 1], edge[1])
        d2 = nearest_image(centre[a, 2] - centre[b, 2], edge[2])
        square = d0 * d0 + d1 * d1 + d2 * d2
        push[p] = 0.0
        if square >= 0.25 * (size[a] + size[b]) ** 2:
            slip[p, 0] = slip[p, 1] = slip[p, 2] = 0.0
            continue
        distance = math.sqrt(square)
        n0, n1, n2 = d0 / distance, d1 / distance, d2 / distance
        depth = 0.5 * (size[a] + size[b]) - distance
        k = 2.0 * size[a] * size[b] / (size[a] + size[b])
        c = time * math.sqrt(k * mass[a] * mass[b] / (mass[a] + mass[b]))
        arm_a, arm_b = 0.5 * (size[a] - depth), 0.5 * (size[b] - depth)
        r0, r1, r2 = -arm_a * n0, -arm_a * n1, -arm_a * n2
        q0, q1, q2 = arm_b * n0, arm_b * n1, arm_b * n2
        u0, u1, u2 = velocity_at(velocity, spin, a, r0, r1, r2)
        v0, v1, v2 = velocity_at(velocity, spin, b, q0, q1, q2)
        push[p], f0, f1, f2 = contact_force(
            slip[p], u0 - v0, u1 - v1, u2 - v2, n0, n1, n2, depth, k, c, ratio, mu, dt
        )
        add_load(force, torque, a, r0, r1, r2, f0, f1, f2)
        add_load(force, torque, b, q0, q1, q2, -f0, -f1, -f2)
        add_branch(stress, f0, f1, f2, d0, d1, d2)
        stiff[a] += k
        stiff[b] += k
        touching += 1
        total += depth
        deepest = max(deepest, depth)
    return touching, total, deepest


@numba.njit(cache=True)
def add_sphere_walls(
    force, torque, stress, stiff, slip, push, point, normal, radius, centre, velocity, spin, size,
    mass, law, dt,
):  # fmt: skip
    """Forces of walls on spheres, added in place; k is that of a pair with a very large sphere.

    Args:
        slip: Of each body and wall, shape (n, num_walls, 3).
        push: Normal force, to be filled, shape (n, num_walls).
        point: Of each wall, shape (num_walls, 3).
        normal: Into the container, shape (num_walls, 3).
        radius: Of a cylinder about the z axis through the point; 0: a plane, shape (num_walls,).

    Returns:
        Sum of the depths, largest depth.
    """
    ratio, mu, time = law
    total, deepest = 0.0, 0.0
    for b in range(centre.shape[0]):
        for w in range(point.shape[0]):
            gap, n0, n1, n2 = wall_gap(
                centre[b, 0], centre[b, 1], centre[b, 2], point[w], normal[w], radius[w]
            )
            depth = 0.5 * size[b] - gap
            push[b, w] = 0.0
            if depth <= 0.0:
                slip[b, w, 0] = slip[b, w, 1] = slip[b, w, 2] = 0.0
                continue
            k = 2.0 * size[b]
            r0, r1, r2 = -gap * n0, -gap * n1, -gap * n2
            v0, v1, v2 = velocity_at(velocity, spin, b, r0, r1, r2)
            c = time * math.sqrt(k * mass[b])
            push[b, w], f0, f1, f2 = contact_force(
                slip[b, w], v0, v1, v2, n0, n1, n2, depth, k, c, ratio, mu, dt
            )
            add_load(force, torque, b, r0, r1, r2, f0, f1, f2)
            add_branch(stress, f0, f1, f2, -r0, -r1, -r2)
            stiff[b] += k
            total += depth
            deepest = max(deepest, depth)
    return total, deepest
