"""Springs of crossing edges: their stiffness, their energy, and their part in the time step."""

import numba
import numpy as np

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
def find_edge_springs(margin, size, due, outside, gap, clock, place, closed, stiffness, first,
                      second, area, layer, share):  # fmt: skip
    """Pairs that are closed or can close by a motion of ``margin`` [m], and their stiffness.

    Crossings that come between edges and facets by such a motion count too: an upper bound.

    Args:
        others: As in :func:`~.edges.add_edge_forces`.

    Returns:
        Pairs, shape (n,); stiffness [N/m], shape (n,).
    """
    found, k = np.empty(first.size, np.int64), np.empty(first.size)
    n = 0
    for p in range(first.size):
        if not (closed[p] or _can_close(outside[p], gap[p], due[p] - clock, margin, size)):
            continue
        s, t = min(max(place[p, 0], 0.0), 1.0), min(max(place[p, 1], 0.0), 1.0)
        found[n], k[n] = p, stiffness[p]
        if not closed[p]:
            k[n] = crossing_stiffness(first[p], second[p], s, t, area, layer, share)
        n += 1
    return found[:n], k[:n]
