"""Motion of rigid bodies, and of the nodes that they carry.

Kick, drift, kick. The kicks change velocity and angular momentum, both in space. The
drift turns a body freely, angular momentum L unchanged, by the splitting of A.
Dullweber, B. Leimkuhler, R. McLachlan, J. Chem. Phys. 107, 1997, 5840-5851: rotations about
the principal axes 1, 2, 3, 2, 1 by dt/2, dt/2, dt, dt/2, dt/2 times the rate
L_k/J_k. It is symplectic, reversible and of second order; L is kept to the last bit, and the
energy of a free turn oscillates by a part of the order of (rate dt)² without drift.

Bodies' arrays: ``centre`` [m], ``velocity`` [m/s], ``momentum`` (angular, about the
centre) [N m s], ``force`` [N], ``torque`` [N m] in space, shape (n, 3); ``turn``, unit
quaternions (scalar first) from principal axes to space, shape (n, 4); ``axes``, the
same as matrices whose columns are the principal axes, shape (n, 3, 3); ``mass`` [kg], shape
(n,); ``inertia``, principal moments [kg m²], shape (n, 3); ``told``, whether the velocity along and
the rate of turning about x, y and z are told, so that no force changes them, shape (n, 6): a body
of which turns are told, or all but one, has equal moments. The nodes of body b are
``nodes[offset[b]:offset[b + 1]]``, and ``place`` their positions in its principal axes.
"""

import math

import numba

#: Axes of the splitting, and the parts of the step.
STAGES = ((0, 0.5), (1, 0.5), (2, 1.0), (1, 0.5), (0, 0.5))


@numba.njit(cache=True)
def set_axes(axes, turn):
    """Matrices ``axes`` of the unit quaternions ``turn``, in place."""
    for b in range(turn.shape[0]):
        w, x, y, z = turn[b, 0], turn[b, 1], turn[b, 2], turn[b, 3]
        axes[b, 0, 0] = 1.0 - 2.0 * (y * y + z * z)
        axes[b, 0, 1] = 2.0 * (x * y - w * z)
        axes[b, 0, 2] = 2.0 * (x * z + w * y)
        axes[b, 1, 0] = 2.0 * (x * y + w * z)
        axes[b, 1, 1] = 1.0 - 2.0 * (x * x + z * z)
        axes[b, 1, 2] = 2.0 * (y * z - w * x)
        axes[b, 2, 0] = 2.0 * (x * z - w * y)
        axes[b, 2, 1] = 2.0 * (y * z + w * x)
        axes[b, 2, 2] = 1.0 - 2.0 * (x * x + y * y)


@numba.njit(cache=True)
def kick_and_drift(
    centre, velocity, momentum, turn, axes, force, torque, mass, inertia, told, reach, dt, damping
):
    """First half of a step: half a kick with the known loads, then the free motion, in place.

    ``damping`` [1/s] takes damping·m·v and damping·L, as nodal forces -damping·m·v do.

    Returns:
        A bound of the distance that a node moved [m], no farther than ``reach`` [m] from
        the centre of its body, shape (n,): a turn by the angle a changes the quaternion
        by 2 sin(a/4) and the place by 2 sin(a/2) reach. Infinity where it is not finite.
    """
    half = 0.5 * dt
    largest = 0.0
    for b in range(mass.size):
        for i in range(3):
            if not told[b, i]:
                velocity[b, i] += half * (force[b, i] / mass[b] - damping * velocity[b, i])
            if not told[b, 3 + i]:
                momentum[b, i] += half * (torque[b, i] - damping * momentum[b, i])
            centre[b, i] += dt * velocity[b, i]
        w, i, j, k = turn[b, 0], turn[b, 1], turn[b, 2], turn[b, 3]
        _turn_freely(turn[b], momentum[b], axes[b], inertia[b], dt)
        change = (turn[b, 0] - w) ** 2 + (turn[b, 1] - i) ** 2
        change += (turn[b, 2] - j) ** 2 + (turn[b, 3] - k) ** 2
        speed = velocity[b, 0] ** 2 + velocity[b, 1] ** 2 + velocity[b, 2] ** 2
        move = dt * math.sqrt(speed) + 2.0 * reach[b] * math.sqrt(change)
        if not move < math.inf:
            largest = math.inf
        largest = max(largest, move)
    set_axes(axes, turn)
    return largest


@numba.njit(cache=True)
def _turn_freely(turn, momentum, axes, inertia, dt):
    """Advance one quaternion by ``dt`` at constant ``momentum``, in place."""
    m0 = axes[0, 0] * momentum[0] + axes[1, 0] * momentum[1] + axes[2, 0] * momentum[2]
    m1 = axes[0, 1] * momentum[0] + axes[1, 1] * momentum[1] + axes[2, 1] * momentum[2]
    m2 = axes[0, 2] * momentum[0] + axes[1, 2] * momentum[1] + axes[2, 2] * momentum[2]
    w, x, y, z = turn[0], turn[1], turn[2], turn[3]
    for axis, part in STAGES:
        # Turn the body about its axis by the angle; the momentum in its frame turns back.
        if axis == 0:
            angle = part * dt * m0 / inertia[0]
            c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
            w, x, y, z = w * c - x * s, x * c + w * s, y * c + z * s, z * c - y * s
            c, s = c * c - s * s, 2.0 * c * s
            m1, m2 = c * m1 + s * m2, c * m2 - s * m1
        elif axis == 1:
            angle = part * dt * m1 / inertia[1]
            c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
            w, x, y, z = w * c - y * s, x * c - z * s, y * c + w * s, z * c + x * s
            c, s = c * c - s * s, 2.0 * c * s
            m2, m0 = c * m2 + s * m0, c * m0 - s * m2
        else:
            angle = part * dt * m2 / inertia[2]
            c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
            w, x, y, z = w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s
            c, s = c * c - s * s, 2.0 * c * s
            m0, m1 = c * m0 + s * m1, c * m1 - s * m0
    # Only rounding to take out.
    length = math.sqrt(w * w + x * x + y * y + z * z)
    turn[0], turn[1], turn[2], turn[3] = w / length, x / length, y / length, z / length


@numba.njit(cache=True)
def place_nodes(x, u, x0, nodes, offset, place, centre, axes):
    """Positions and displacements of the nodes of the bodies, in place.

    Args:
        x, u: Positions and displacements of all nodes [m], shape (num_nodes, 3).
        x0: Their reference positions [m].
    """
    for b in range(centre.shape[0]):
        R = axes[b]
        for k in range(offset[b], offset[b + 1]):
            n = nodes[k]
            for i in range(3):
                x[n, i] = centre[b, i] + (
                    R[i, 0] * place[k, 0] + R[i, 1] * place[k, 1] + R[i, 2] * place[k, 2]
                )
                u[n, i] = x[n, i] - x0[n, i]


@numba.njit(cache=True)
def places_of(at, offset, place, centre, axes):
    """Positions of the nodes of the bodies [m], as of :func:`place_nodes`, into ``at``, (n, 3)."""
    for b in range(centre.shape[0]):
        R = axes[b]
        for k in range(offset[b], offset[b + 1]):
            for i in range(3):
                at[k, i] = centre[b, i] + (
                    R[i, 0] * place[k, 0] + R[i, 1] * place[k, 1] + R[i, 2] * place[k, 2]
                )


@numba.njit(cache=True)
def carry_nodes(x, u, v, x0, nodes, offset, place, centre, axes, before, velocity, dt):
    """Positions, displacements and mean velocities in a step of the nodes of bodies, in place.

    Args:
        v: Velocities of all nodes [m/s], shape (num_nodes, 3).
        before: Positions of those of the bodies before the step, and after it on return, (n, 3).
        velocity: Their mean velocities in it [m/s], in place, shape (n, 3).
        dt: Length of the step [s].
        others: As of :func:`place_nodes`.
    """
    for b in range(centre.shape[0]):
        R = axes[b]
        for k in range(offset[b], offset[b + 1]):
            n = nodes[k]
            for i in range(3):
                new = centre[b, i] + (
                    R[i, 0] * place[k, 0] + R[i, 1] * place[k, 1] + R[i, 2] * place[k, 2]
                )
                velocity[k, i] = v[n, i] = (new - before[k, i]) / dt
                x[n, i] = before[k, i] = new
                u[n, i] = new - x0[n, i]


@numba.njit(cache=True)
def clear(f, nodes):
    """Set the rows of ``f`` at ``nodes`` to zero."""
    for n in nodes:
        f[n, 0] = f[n, 1] = f[n, 2] = 0.0


@numba.njit(cache=True)
def gather_loads(force, torque, f, x, nodes, offset, centre):
    """Sum nodal forces ``f`` [N] to force and torque about the centre, in place."""
    for b in range(centre.shape[0]):
        fx = fy = fz = tx = ty = tz = 0.0
        for k in range(offset[b], offset[b + 1]):
            n = nodes[k]
            rx, ry, rz = x[n, 0] - centre[b, 0], x[n, 1] - centre[b, 1], x[n, 2] - centre[b, 2]
            fx += f[n, 0]
            fy += f[n, 1]
            fz += f[n, 2]
            tx += ry * f[n, 2] - rz * f[n, 1]
            ty += rz * f[n, 0] - rx * f[n, 2]
            tz += rx * f[n, 1] - ry * f[n, 0]
        force[b, 0], force[b, 1], force[b, 2] = fx, fy, fz
        torque[b, 0], torque[b, 1], torque[b, 2] = tx, ty, tz


@numba.njit(cache=True)
def kick(velocity, momentum, spin, force, torque, axes, mass, inertia, told, dt, damping):
    """Second half of a step, and the rate of turning ``spin`` [1/s] at its end, in place.

    Returns:
        Energy that the damping took in this step [J].
    """
    half = 0.5 * dt
    scale = 1.0 / (1.0 + half * damping)
    lost = 0.0
    for b in range(mass.size):
        for i in range(3):
            if not told[b, i]:
                velocity[b, i] = (velocity[b, i] + half * force[b, i] / mass[b]) * scale
            if not told[b, 3 + i]:
                momentum[b, i] = (momentum[b, i] + half * torque[b, i]) * scale
        set_spin(spin[b], momentum[b], axes[b], inertia[b])
        for i in range(3):
            if not told[b, i]:
                lost += mass[b] * velocity[b, i] ** 2
            if not told[b, 3 + i]:
                lost += spin[b, i] * momentum[b, i]
    return dt * damping * lost


@numba.njit(cache=True)
def set_spins(spin, momentum, axes, inertia):
    """Rates of turning of all bodies [1/s] from their angular momenta, in place."""
    for b in range(spin.shape[0]):
        set_spin(spin[b], momentum[b], axes[b], inertia[b])


@numba.njit(cache=True)
def set_spin(spin, momentum, axes, inertia):
    """Rate of turning of one body [1/s] from its angular momentum, in place."""
    spin[0] = spin[1] = spin[2] = 0.0
    for k in range(3):
        rate = 0.0
        for i in range(3):
            rate += axes[i, k] * momentum[i]
        rate /= inertia[k]
        for i in range(3):
            spin[i] += axes[i, k] * rate


@numba.njit(cache=True)
def node_velocities(v, x, nodes, offset, centre, velocity, spin):
    """Velocities of the nodes of the bodies [m/s], into ``v``, shape (num_nodes, 3)."""
    for b in range(centre.shape[0]):
        wx, wy, wz = spin[b, 0], spin[b, 1], spin[b, 2]
        for k in range(offset[b], offset[b + 1]):
            n = nodes[k]
            rx, ry, rz = x[n, 0] - centre[b, 0], x[n, 1] - centre[b, 1], x[n, 2] - centre[b, 2]
            v[n, 0] = velocity[b, 0] + wy * rz - wz * ry
            v[n, 1] = velocity[b, 1] + wz * rx - wx * rz
            v[n, 2] = velocity[b, 2] + wx * ry - wy * rx


@numba.njit(cache=True)
def kinetic_energies(
    energy, velocity, momentum, force, torque, axes, mass, inertia, told, dt, damping
):
    """Kinetic energy of each body at whole steps [J], in place, shape (n,).

    m/2 V₋·V₊ + L₋·J⁻¹L₊/2 with V, L half a kick of length dt/2 before and after: as
    :func:`~mufe_fenicsx.kernels.bulk.energy.kinetic_energy`. Motion that is told has none.
    """
    half = 0.5 * dt
    of_v = 1.0 + (half * damping) ** 2
    for b in range(mass.size):
        total = 0.0
        for i in range(3):
            if not told[b, i]:
                change = half * force[b, i] / mass[b]
                total += mass[b] * (of_v * velocity[b, i] ** 2 - change**2)
        for k in range(3):
            if told[b, 3] and told[b, 4] and told[b, 5]:
                break
            rate = change = 0.0
            for i in range(3):
                rate += axes[b, i, k] * momentum[b, i]
                change += axes[b, i, k] * torque[b, i]
            total += (of_v * rate**2 - (half * change) ** 2) / inertia[b, k]
        energy[b] = 0.5 * total


@numba.njit(cache=True)
def expand_motion(q, motion, x, nodes, offset, centre, axes):
    """Displacements ``q`` of nodes by infinitesimal motions of their bodies, in place.

    Args:
        q: Shape (num_nodes, 3).
        motion: Translation [m] and turns about the principal axes [rad] of the bodies, one
            row each, shape (2 n, 3).
    """
    for b in range(centre.shape[0]):
        m, t = motion[2 * b], motion[2 * b + 1]
        wx = axes[b, 0, 0] * t[0] + axes[b, 0, 1] * t[1] + axes[b, 0, 2] * t[2]
        wy = axes[b, 1, 0] * t[0] + axes[b, 1, 1] * t[1] + axes[b, 1, 2] * t[2]
        wz = axes[b, 2, 0] * t[0] + axes[b, 2, 1] * t[1] + axes[b, 2, 2] * t[2]
        for k in range(offset[b], offset[b + 1]):
            n = nodes[k]
            rx, ry, rz = x[n, 0] - centre[b, 0], x[n, 1] - centre[b, 1], x[n, 2] - centre[b, 2]
            q[n, 0] = m[0] + wy * rz - wz * ry
            q[n, 1] = m[1] + wz * rx - wx * rz
            q[n, 2] = m[2] + wx * ry - wy * rx


@numba.njit(cache=True)
def reduce_loads(load, torque, axes):
    """Add ``torque`` in space to rows 1, 3, … of ``load``, about the principal axes, in place.

    Args:
        load: Force and torque of the bodies in turn, shape (2 n, 3).
        torque: Shape (n, 3).
    """
    for b in range(axes.shape[0]):
        for k in range(3):
            for i in range(3):
                load[2 * b + 1, k] += axes[b, i, k] * torque[b, i]
