"""The updates of central differences, each one pass over the nodes; motion of nodes and planes.

``runs`` are ranges of nodes, shape (num_runs, 3), first and end of each and its grain: the nodes
of rigid grains are left out. ``field`` is a velocity linear in the place, shape (4, 3): that at the
origin [m/s], then its slopes along the axes [1/s]. ``moves``, shape (num_grains,), is set to the
largest distance that a node of each grain moved beside that field [m].
"""

import math

import numba
import numpy as np


@numba.njit(cache=True, inline="always")
def _beside(field, a, b, c, x, y, z):
    """Square of a velocity (a, b, c) at (x, y, z) less that of the field there."""
    a -= field[0, 0] + x * field[1, 0] + y * field[2, 0] + z * field[3, 0]
    b -= field[0, 1] + x * field[1, 1] + y * field[2, 1] + z * field[3, 1]
    c -= field[0, 2] + x * field[1, 2] + y * field[2, 2] + z * field[3, 2]
    return a * a + b * b + c * c


@numba.njit(cache=True)
def half_kick_and_drift(x, u, v, a, f, x0, runs, dt, damping, field, moves):
    """First half of a step: v += dt/2 (a - damping v), u += dt v, x = x0 + u, in place; f = 0.

    All arrays have the shape (num_nodes, 3); ``damping`` in 1/s.

    Returns:
        Largest distance that a node moved [m]; infinity where one is not finite.
    """
    half = 0.5 * dt
    largest = total = 0.0
    for r in range(runs.shape[0]):
        beside = 0.0
        for n in range(runs[r, 0], runs[r, 1]):
            square = 0.0
            for i in range(3):
                v[n, i] += half * (a[n, i] - damping * v[n, i])
                square += v[n, i] * v[n, i]
            other = _beside(field, v[n, 0], v[n, 1], v[n, 2], x[n, 0], x[n, 1], x[n, 2])
            beside = max(beside, other)
            for i in range(3):
                u[n, i] += dt * v[n, i]
                x[n, i] = x0[n, i] + u[n, i]
                f[n, i] = 0.0
            largest, total = max(largest, square), total + square
        moves[runs[r, 2]] = dt * math.sqrt(beside)
    return dt * math.sqrt(largest) if total < math.inf else math.inf


@numba.njit(cache=True)
def accelerate_and_half_kick(a, v, f, mass, runs, dt, damping):
    """Second half of a step: a = f/m, v = (v + dt/2 a)/(1 + dt/2 damping), in place.

    Returns:
        Energy that the damping took in this step [J]: dt damping sum m v².
    """
    half = 0.5 * dt
    scale = 1.0 / (1.0 + half * damping)
    for r in range(runs.shape[0]):
        for n in range(runs[r, 0], runs[r, 1]):
            inverse = 1.0 / mass[n]
            for i in range(3):
                a[n, i] = f[n, i] * inverse
                v[n, i] = (v[n, i] + half * a[n, i]) * scale
    lost = 0.0
    if damping > 0.0:
        for r in range(runs.shape[0]):
            for n in range(runs[r, 0], runs[r, 1]):
                for i in range(3):
                    lost += mass[n] * v[n, i] * v[n, i]
    return dt * damping * lost


@numba.njit(cache=True)
def predict(x_next, x, v, f, mass, dt):
    """Positions at the end of the next step under the forces known so far, into ``x_next``.

    Args:
        x_next, x, v, f: As above, ``v`` at the middle of this step, shape (num_nodes, 3).
        mass: Nodal masses [kg], shape (num_nodes,).
        dt: Length of the step [s].
    """
    for n in range(mass.size):
        for i in range(3):
            x_next[n, i] = x[n, i] + dt * (v[n, i] + dt * f[n, i] / mass[n])


@numba.njit(cache=True)
def largest_move(previous, x):
    """Largest distance [m] that a node moved since the last call; ``previous`` becomes ``x``.

    Both of shape (num_nodes, 3). Infinity where a position is not finite.
    """
    largest = 0.0
    for n in range(x.shape[0]):
        dx, dy, dz = x[n, 0] - previous[n, 0], x[n, 1] - previous[n, 1], x[n, 2] - previous[n, 2]
        square = dx * dx + dy * dy + dz * dz
        if not square < math.inf:
            return math.inf
        largest = max(largest, square)
        previous[n, 0], previous[n, 1], previous[n, 2] = x[n, 0], x[n, 1], x[n, 2]
    return math.sqrt(largest)


@numba.njit(cache=True)
def advance(point, displacement, velocity, turn, angular_velocity, dt):
    """Planes move by ``displacement`` = dt velocity, in place; ``turn`` = dt angular_velocity.

    All of shape (num_walls, 3).

    Returns:
        Largest displacement [m], and whether a plane turns.
    """
    largest, turns = 0.0, False
    for w in range(point.shape[0]):
        square = 0.0
        for i in range(3):
            displacement[w, i] = dt * velocity[w, i]
            point[w, i] += displacement[w, i]
            square += displacement[w, i] * displacement[w, i]
            turn[w, i] = dt * angular_velocity[w, i]
            turns |= turn[w, i] != 0.0
        largest = max(largest, square)
    return math.sqrt(largest), turns


@numba.njit(cache=True)
def work_of(force, displacement, torque, turn):
    """Work of forces along ``displacement``, torques along ``turn`` [J]; shapes are (n, 3)."""
    work = 0.0
    for w in range(force.shape[0]):
        for i in range(3):
            work += force[w, i] * displacement[w, i] + torque[w, i] * turn[w, i]
    return work


@numba.njit(cache=True, fastmath={"contract", "reassoc"})
def moments(sums, x, v):
    """Add (1, x) (1, x, v) of all nodes to ``sums``, shape (4, 7), in place."""
    total = np.zeros((4, 7))
    for n in range(len(x)):
        for i in range(3):
            total[0, 1 + i] += x[n, i]
            total[0, 4 + i] += v[n, i]
            for j in range(3):
                total[1 + i, 1 + j] += x[n, i] * x[n, j]
                total[1 + i, 4 + j] += x[n, i] * v[n, j]
    total[0, 0] = len(x)
    for i in range(3):
        total[1 + i, 0] = total[0, 1 + i]
    sums += total


@numba.njit(cache=True)
def add_weights(f, mass, g, runs):
    """Add the weights m g of the nodes of ``runs`` to their forces ``f``, in place.

    Args:
        f: Forces [N], shape (num_nodes, 3).
        mass: Masses [kg], shape (num_nodes,).
        g: Acceleration [m/s²], shape (3,).
        runs: First node and end of ranges of nodes, shape (num_runs, 3).
    """
    for r in range(runs.shape[0]):
        for n in range(runs[r, 0], runs[r, 1]):
            for i in range(3):
                f[n, i] += mass[n] * g[i]
