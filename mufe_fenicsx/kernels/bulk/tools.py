"""Loads on tools and their work. Arrays of bodies as in kernels.bulk.rigid, ``rows`` of tools.

Loads have six numbers: the force along x, y, z [N] and the torque about them [N m].
"""

import math

import numba

from .rigid import set_spin


@numba.njit(cache=True)
def keep_loads(loads, rows, force, torque):
    """Loads on the tools now, in place, shape (num_tools, 6)."""
    for k in range(rows.size):
        for i in range(3):
            loads[k, i], loads[k, 3 + i] = force[rows[k], i], torque[rows[k], i]


@numba.njit(cache=True)
def apply_loads(force, torque, rows, applied):
    """Add what is applied to tools to the loads on them, in place; ``applied``: (num_tools, 6)."""
    for k in range(rows.size):
        for i in range(3):
            force[rows[k], i] += applied[k, i]
            torque[rows[k], i] += applied[k, 3 + i]


@numba.njit(cache=True)
def work_of_motion(loads, rows, applied, told, velocity, momentum, spin, axes, inertia, dt):
    """Work of what moves the tools over a step, by loads that stay as they are [J].

    Told motion works against the loads of the sample, applied loads along the free one. ``spin`` is
    that of the step, in place.
    """
    work = 0.0
    for k in range(rows.size):
        b = rows[k]
        set_spin(spin[k], momentum[b], axes[b], inertia[b])
        for i in range(3):
            along = -loads[k, i] if told[b, i] else applied[k, i]
            about = -loads[k, 3 + i] if told[b, 3 + i] else applied[k, 3 + i]
            work += dt * (along * velocity[b, i] + about * spin[k, i])
    return work


@numba.njit(cache=True)
def tell_motion(velocity, momentum, rows, told, rates, inertia, reach):
    """Give bodies the told part of their motion, in place.

    Args:
        rates: Velocities [m/s] and rates of turning [rad/s] of the tools, shape (num_tools, 6).
        reach: Of the farthest node of each body from its centre [m].

    Returns:
        Largest |V| + |ω| reach of what is told [m/s].
    """
    largest = 0.0
    for k in range(rows.size):
        b = rows[k]
        along, about = 0.0, 0.0
        for i in range(3):
            if told[b, i]:
                velocity[b, i] = rates[k, i]
                along += rates[k, i] ** 2
            if told[b, 3 + i]:
                momentum[b, i] = inertia[b, 0] * rates[k, 3 + i]
                about += rates[k, 3 + i] ** 2
        largest = max(largest, math.sqrt(along) + math.sqrt(about) * reach[b])
    return largest
