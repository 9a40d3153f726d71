"""Nodes glued to rigid planes or held on them, and stick points that turn with their plane."""

import math

import numba


@numba.njit(cache=True)
def place_glued(x, u, v, velocity, before, x0, node, wall, place, point, rotation, dt):
    """Carry the glued nodes along with their walls, in place.

        x = p + R X

    with X their place relative to the wall's point at the start.

    Args:
        x, u, v: Positions and displacements [m], and velocities [m/s], shape (num_nodes, 3).
        velocity: Mean velocities of the step [m/s], shape (num_glued, 3).
        before: Positions before the step, and after it on return [m], shape (num_glued, 3).
        x0: Reference positions [m], shape (num_nodes, 3).
        node, wall: The glued nodes and their walls, shape (num_glued,).
        place: X [m], shape (num_glued, 3).
        point: p [m], shape (num_walls, 3).
        rotation: R, shape (num_walls, 3, 3).
        dt: Time step [s].
    """
    for k in range(node.size):
        n, w = node[k], wall[k]
        for i in range(3):
            new = point[w, i]
            for j in range(3):
                new += rotation[w, i, j] * place[k, j]
            velocity[k, i] = v[n, i] = (new - before[k, i]) / dt
            x[n, i] = before[k, i] = new
            u[n, i] = new - x0[n, i]


@numba.njit(cache=True)
def give_rows(v, values, node):
    """Set the rows ``node`` of ``v``, shape (num_nodes, 3), to ``values``, in place."""
    for k in range(node.size):
        for i in range(3):
            v[node[k], i] = values[k, i]


@numba.njit(cache=True)
def take_glued(f, wall_force, wall_torque, x, node, wall, point):
    """Pass the forces ``f`` on glued nodes on to their walls, and clear them.

    Args:
        f: Forces on nodes [N], shape (num_nodes, 3).
        wall_force: Forces on walls [N], shape (num_walls, 3).
        wall_torque: Their torques about ``point`` [N m], shape (num_walls, 3).
        x, node, wall, point: As in :func:`place_glued`.
    """
    for k in range(node.size):
        n, w = node[k], wall[k]
        rx, ry, rz = x[n, 0] - point[w, 0], x[n, 1] - point[w, 1], x[n, 2] - point[w, 2]
        fx, fy, fz = f[n, 0], f[n, 1], f[n, 2]
        wall_force[w, 0] += fx
        wall_force[w, 1] += fy
        wall_force[w, 2] += fz
        wall_torque[w, 0] += ry * fz - rz * fy
        wall_torque[w, 1] += rz * fx - rx * fz
        wall_torque[w, 2] += rx * fy - ry * fx
        f[n, 0] = f[n, 1] = f[n, 2] = 0.0


@numba.njit(cache=True)
def squares_of_glued(mass, velocity, node):
    """Sum of m v² of glued nodes [J].

    Args:
        mass: Of all nodes [kg], shape (num_nodes,).
        velocity: Of the glued nodes [m/s], shape (num_glued, 3).
        node: These, shape (num_glued,).
    """
    total = 0.0
    for k in range(node.size):
        a, b, c = velocity[k, 0], velocity[k, 1], velocity[k, 2]
        total += mass[node[k]] * (a * a + b * b + c * c)
    return total


@numba.njit(cache=True)
def largest_of_glued(moves, x, velocity, node, grain_of_node, field, dt):
    """How far glued nodes move in a step beside a field, into the largest of their grains.

    Args:
        moves, field: As of kernels.bulk.motion.
        x: Positions after the step [m], shape (num_nodes, 3).
        velocity: Of the glued nodes in it [m/s], shape (num_glued, 3).
        node: The glued nodes, shape (num_glued,).
        grain_of_node: Of all nodes, shape (num_nodes,).
        dt: Length of the step [s].

    Returns:
        Largest distance that one moved [m].
    """
    largest = 0.0
    for k in range(node.size):
        n, square, other = node[k], 0.0, 0.0
        for i in range(3):
            beside = velocity[k, i] - field[0, i]
            for j in range(3):
                beside -= (x[n, j] - dt * velocity[k, j]) * field[1 + j, i]
            square += velocity[k, i] * velocity[k, i]
            other += beside * beside
        grain = grain_of_node[n]
        moves[grain] = max(moves[grain], dt * math.sqrt(other))
        largest = max(largest, square)
    return dt * math.sqrt(largest)


@numba.njit(cache=True)
def take_normal(f, wall_force, wall_torque, x, node, wall, point, normal):
    """Pass what the forces ``f`` on nodes have along the normal of a wall on to it, in place.

    Arguments as of :func:`take_glued`; a node may be there for several walls, whose normals
    are at right angles.

    Args:
        normal: Unit normals of the walls, shape (num_walls, 3).
    """
    for k in range(node.size):
        n, w = node[k], wall[k]
        push = f[n, 0] * normal[w, 0] + f[n, 1] * normal[w, 1] + f[n, 2] * normal[w, 2]
        rx, ry, rz = x[n, 0] - point[w, 0], x[n, 1] - point[w, 1], x[n, 2] - point[w, 2]
        fx, fy, fz = push * normal[w, 0], push * normal[w, 1], push * normal[w, 2]
        wall_force[w, 0] += fx
        wall_force[w, 1] += fy
        wall_force[w, 2] += fz
        wall_torque[w, 0] += ry * fz - rz * fy
        wall_torque[w, 1] += rz * fx - rx * fz
        wall_torque[w, 2] += rx * fy - ry * fx
        f[n, 0] -= fx
        f[n, 1] -= fy
        f[n, 2] -= fz


@numba.njit(cache=True)
def turn_rows(rows, wall, which, turn):
    """Rotate those ``rows`` that belong to the wall ``which`` by ``turn``, in place.

    Args:
        rows: Vectors, shape (n, 3).
        wall: Their walls, shape (n,).
        which: A wall.
        turn: Rotation, shape (3, 3).
    """
    for k in range(wall.size):
        if wall[k] == which:
            a, b, c = rows[k, 0], rows[k, 1], rows[k, 2]
            for i in range(3):
                rows[k, i] = turn[i, 0] * a + turn[i, 1] * b + turn[i, 2] * c
