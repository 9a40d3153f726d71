"""Springs of crossing edges: their stiffness, their energy, and their part in the time step."""

import numba

from .springs import stored_energy

#: A crossing that carries may leave its edges by this part of them, and the normals of their
#: facets by this angle more [rad], before it is let go.
OVERRUN = 0.1


@numba.njit(cache=True)
def crossing_stiffness(i, j, s, t, area, layer, share):
    """Stiffness of a crossing [N/m]: A/2 of a node of the finer edge, over both layers.

    Near an end the share of the end: several edges of a corner can cross there at once.
    """
    part = 1.0
    for e, place in ((i, s), (j, t)):
        end = share[e, 0] if place < 0.5 else share[e, 1]
        inner = min(max(4.0 * min(place, 1.0 - place), 0.0), 1.0)
        part = min(part, end + (1.0 - end) * inner)
    return 0.5 * part * min(area[i], area[j]) / (layer[i] + layer[j])


@numba.njit(cache=True)
def edge_energy(gap, offset, closed, stiffness, shear, first, ratio, largest_depth):
    """Energy stored in the springs of closed pairs [J], and their number."""
    energy, count = 0.0, 0
    for p in range(first.size):
        if closed[p]:
            count += 1
            t2 = shear[p, 0] ** 2 + shear[p, 1] ** 2 + shear[p, 2] ** 2
            energy += stored_energy(stiffness[p], offset[p] - gap[p], largest_depth)
            energy += 0.5 * t2 / (stiffness[p] * ratio[first[p]])
    return energy, count


@numba.njit(cache=True)
def _can_close(outside, gap, wait, margin, size):
    """Whether a crossing can come between edges and facets, and close, by such a motion."""
    if wait > 0.0:  # not looked at since: the gap is of then
        return wait < margin and outside <= OVERRUN + 2.0 * margin / size
    return gap < margin and outside <= OVERRUN + 2.0 * margin / size


@numba.njit(cache=True)
def add_edge_stiffness(y, q, margin, size, due, outside, gap, clock, place, normal, closed,
                       stiffness, first, second, ends, area, layer, share, ratio):  # fmt: skip
    """Add the springs of all pairs nearer than ``margin`` [m] times ``q`` to ``y``, in place.

    Pairs that slide count with their tangential spring, and crossings that come between
    edges and facets by such a motion count too: an upper bound. ``y`` and ``q`` have the
    shape (num_nodes, 3); others as in :func:`add_edge_forces`.
    """
    for p in range(first.size):
        if not (closed[p] or _can_close(outside[p], gap[p], due[p] - clock, margin, size)):
            continue
        i, j = first[p], second[p]
        a, b, c, d = ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1]
        s, t = min(max(place[p, 0], 0.0), 1.0), min(max(place[p, 1], 0.0), 1.0)
        kn = stiffness[p] if closed[p] else crossing_stiffness(i, j, s, t, area, layer, share)
        kt = kn * ratio[i]
        along = 0.0
        for m in range(3):
            move = (1.0 - s) * q[a, m] + s * q[b, m] - (1.0 - t) * q[c, m] - t * q[d, m]
            along += normal[p, m] * move
        for m in range(3):
            move = (1.0 - s) * q[a, m] + s * q[b, m] - (1.0 - t) * q[c, m] - t * q[d, m]
            force = kt * move + (kn - kt) * along * normal[p, m]
            y[a, m] += (1.0 - s) * force
            y[b, m] += s * force
            y[c, m] -= (1.0 - t) * force
            y[d, m] -= t * force


@numba.njit(cache=True)
def add_edge_bounds(y, margin, size, due, outside, gap, clock, place, closed, stiffness, first,
                    second, ends, area, layer, share):  # fmt: skip
    """Add to ``y`` the row sums of the springs of :func:`add_edge_stiffness`, in place [N/m].

    By Gershgorin they bound what the springs add to the eigenvalues. ``y`` has the
    shape (num_nodes, 3).
    """
    for p in range(first.size):
        if not (closed[p] or _can_close(outside[p], gap[p], due[p] - clock, margin, size)):
            continue
        i, j = first[p], second[p]
        s, t = min(max(place[p, 0], 0.0), 1.0), min(max(place[p, 1], 0.0), 1.0)
        k = stiffness[p] if closed[p] else crossing_stiffness(i, j, s, t, area, layer, share)
        for m in range(3):
            y[ends[i, 0], m] += 2.0 * k * (1.0 - s)
            y[ends[i, 1], m] += 2.0 * k * s
            y[ends[j, 0], m] += 2.0 * k * (1.0 - t)
            y[ends[j, 1], m] += 2.0 * k * t
