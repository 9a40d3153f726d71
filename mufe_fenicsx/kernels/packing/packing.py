"""Contacts of rigid grains while they are packed: springs, dashpots and Coulomb friction.

A contact of depth d, normal n (towards body a) and relative velocity v = v_a - v_b has

    N = max(0, k d - c v·n),    T = -k_t s - c_t v_t,  |T| <= mu N,

with the slip s, the integral of the tangential velocity v_t, which is shortened where Coulomb's
limit is reached and turned into the present tangent plane (P. A. Cundall & O. D. L. Strack,
Géotechnique 29, 1979, 47-65); c_t/c = k_t/k.

Lengths are in mean diameters, masses in those of a cube of it, forces in the modulus times its
square. Arrays of all bodies: ``centre``, ``velocity``, ``spin``, ``force`` and ``torque`` in space,
shape (n, 3); ``axes``, columns are the bodies' axes, shape (n, 3, 3); ``size``, the diameter of the
sphere of equal volume, ``reach``, the largest distance of the surface from the centre, ``mass`` and
``least``, the smallest moment of inertia, shape (n,); ``stiff``, the sum of stiffnesses by which
the body is held, shape (n,). ``stress`` is the sum of force times branch vector, shape (3, 3):
divided by the volume it is the mean stress, compression positive. ``law`` is (ratio of k_t to k,
mu, time of the dashpots c/k over that of a unit body). ``edge`` are the lengths of a periodic cell,
zero along axes that are not periodic, shape (3,).
"""

import math

import numba


@numba.njit(cache=True, inline="always")
def nearest_image(d, edge):
    """Difference of a coordinate, to the nearest image in a periodic cell."""
    return d - edge * round(d / edge) if edge > 0.0 else d


@numba.njit(cache=True, inline="always")
def contact_force(slip, v0, v1, v2, n0, n1, n2, depth, k, c, ratio, mu, dt):
    """Normal force and total force on body a; ``slip`` goes on, in place."""
    v_n = v0 * n0 + v1 * n1 + v2 * n2
    push = max(0.0, k * depth - c * v_n)
    v0, v1, v2 = v0 - v_n * n0, v1 - v_n * n1, v2 - v_n * n2
    s0, s1, s2 = slip[0] + v0 * dt, slip[1] + v1 * dt, slip[2] + v2 * dt
    s_n = s0 * n0 + s1 * n1 + s2 * n2
    s0, s1, s2 = s0 - s_n * n0, s1 - s_n * n1, s2 - s_n * n2
    k_t, c_t = ratio * k, ratio * c
    f0, f1, f2 = k_t * s0 + c_t * v0, k_t * s1 + c_t * v1, k_t * s2 + c_t * v2
    pull = math.sqrt(f0 * f0 + f1 * f1 + f2 * f2)
    if pull > mu * push:
        part = mu * push / pull
        f0, f1, f2 = f0 * part, f1 * part, f2 * part
        s0, s1, s2 = (f0 - c_t * v0) / k_t, (f1 - c_t * v1) / k_t, (f2 - c_t * v2) / k_t
    slip[0], slip[1], slip[2] = s0, s1, s2
    return push, push * n0 - f0, push * n1 - f1, push * n2 - f2


@numba.njit(cache=True, inline="always")
def add_load(force, torque, b, r0, r1, r2, f0, f1, f2):
    """Add a force at the arm r to the loads of body b, in place."""
    force[b, 0] += f0
    force[b, 1] += f1
    force[b, 2] += f2
    torque[b, 0] += r1 * f2 - r2 * f1
    torque[b, 1] += r2 * f0 - r0 * f2
    torque[b, 2] += r0 * f1 - r1 * f0


@numba.njit(cache=True, inline="always")
def velocity_at(velocity, spin, b, r0, r1, r2):
    """Velocity of the point of body b at the arm r."""
    w0, w1, w2 = spin[b, 0], spin[b, 1], spin[b, 2]
    return (
        velocity[b, 0] + w1 * r2 - w2 * r1,
        velocity[b, 1] + w2 * r0 - w0 * r2,
        velocity[b, 2] + w0 * r1 - w1 * r0,
    )


@numba.njit(cache=True, inline="always")
def add_branch(stress, f0, f1, f2, d0, d1, d2):
    """Add a force times its branch vector, in place."""
    stress[0, 0] += f0 * d0
    stress[0, 1] += f0 * d1
    stress[0, 2] += f0 * d2
    stress[1, 0] += f1 * d0
    stress[1, 1] += f1 * d1
    stress[1, 2] += f1 * d2
    stress[2, 0] += f2 * d0
    stress[2, 1] += f2 * d1
    stress[2, 2] += f2 * d2


@numba.njit(cache=True, inline="always")
def wall_gap(x0, x1, x2, point, normal, radius):
    """Gap of a place from a wall and the normal that points inside: a plane, or a cylinder."""
    d0, d1, d2 = x0 - point[0], x1 - point[1], x2 - point[2]
    if radius > 0.0:
        away = max(math.sqrt(d0 * d0 + d1 * d1), 1e-300)
        return radius - away, -d0 / away, -d1 / away, 0.0
    return (
        d0 * normal[0] + d1 * normal[1] + d2 * normal[2],
        normal[0], normal[1], normal[2],
    )  # fmt: skip
