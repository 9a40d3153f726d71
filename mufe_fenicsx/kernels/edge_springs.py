"""Springs of crossing edges: their stiffness, their energy, and their part in the time step."""

import numba
import numpy as np

from .crossing import END
from .springs import stored_energy

#: Crossings up to this part of their edges, or this angle [rad], outside can carry soon.
BEYOND = 0.1


@numba.njit(cache=True)
def _parts(place, share):
    """Parts of the stiffness of a crossing by its place on an edge: at corners, and beside edges.

    Toward a corner of k edges it falls to a k-th over a quarter of the edge, for several of them
    can cross there at once. Toward an end where the edge goes on, ``share`` 1, it fades out while
    that of the next edge fades in: the two of a straight ridge add up to one.
    """
    inside = place if place < 0.5 else 1.0 - place
    end = share[0] if place < 0.5 else share[1]
    if end == 1.0:
        return 1.0, min(max(0.5 + 0.5 * inside / END, 0.0), 1.0)
    return end + (1.0 - end) * min(max(4.0 * inside, 0.0), 1.0), 1.0


@numba.njit(cache=True)
def crossing_stiffness(i, j, s, t, area, layer, share):
    """Stiffness of a crossing [N/m]: A/2 of a node of the finer edge, over both layers."""
    corner, fade = _parts(s, share[i])
    other_corner, other_fade = _parts(t, share[j])
    part = min(corner, other_corner) * fade * other_fade
    return 0.5 * part * min(area[i], area[j]) / (layer[i] + layer[j])


@numba.njit(cache=True)
def spring_energy(force, stiffness):
    """Energy of a spring that carries a force [J]; none where it fades out."""
    square = force[0] ** 2 + force[1] ** 2 + force[2] ** 2
    return 0.5 * square / stiffness if square > 0.0 else 0.0


@numba.njit(cache=True)
def edge_energy(gap, offset, recess, closed, stiffness, shear, first, ratio, largest_depth):
    """Energy stored in the springs of closed pairs [J], and their number."""
    energy, count = 0.0, 0
    for p in range(first.size):
        if closed[p]:
            count += 1
            depth = offset[p] - gap[p] - recess[p]
            energy += stored_energy(stiffness[p], depth, largest_depth[p])
            energy += spring_energy(shear[p], stiffness[p] * ratio[first[p]])
    return energy, count


@numba.njit(cache=True)
def _can_close(outside, gap, wait, margin, size):
    """Whether a crossing can come between edges and facets, and close, by such a motion."""
    nearest = wait if wait > 0.0 else gap  # not looked at since: the gap is of then
    return nearest < margin and outside <= BEYOND + 2.0 * margin / size


@numba.njit(cache=True)
def find_edge_springs(margin, size, due, outside, gap, clock, place, closed, stiffness, first,
                      second, area, layer, share):  # fmt: skip
    """Pairs that are closed or can close by a motion of ``margin`` [m], and their stiffness.

    Crossings that come between edges and facets by such a motion count too, an upper bound.

    Args:
        others: As in :func:`~.edges.add_edge_forces`.

    Returns:
        Pairs, shape (n,); stiffness [N/m], shape (n,).
    """
    found, k = np.empty(first.size, np.int64), np.empty(first.size)
    n = 0
    for p in range(first.size):
        if not (closed[p] or _can_close(outside[p], gap[p], due[p] - clock, margin, size[p])):
            continue
        # Where one edge goes on as the next, as if it did not fade out.
        s, t = min(max(place[p, 0], END), 1.0 - END), min(max(place[p, 1], END), 1.0 - END)
        found[n] = p
        k[n] = crossing_stiffness(first[p], second[p], s, t, area, layer, share)
        n += 1
    return found[:n], k[:n]
