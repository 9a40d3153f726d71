"""Steps of a Lanczos iteration, each one pass over its vectors, all of shape (n,)."""

import numba

#: Sums in any order.
FAST = {"contract", "reassoc"}


@numba.njit(cache=True)
def scale(moved, y, q, root):
    """moved = root q and y = 0, in place."""
    for i in range(q.size):
        moved[i] = root[i] * q[i]
        y[i] = 0.0


@numba.njit(cache=True, fastmath=FAST)
def weigh(w, root, q, before, off):
    """w = root w - off before, in place; returns w·q."""
    along = 0.0
    for i in range(w.size):
        w[i] = root[i] * w[i] - off * before[i]
        along += w[i] * q[i]
    return along


@numba.njit(cache=True, fastmath=FAST)
def subtract(w, q, along, before, back):
    """w -= along q + back before, in place; returns w·q, w·before and w·w."""
    to_q = to_before = square = 0.0
    for i in range(w.size):
        w[i] -= along * q[i] + back * before[i]
        to_q += w[i] * q[i]
        to_before += w[i] * before[i]
        square += w[i] * w[i]
    return to_q, to_before, square
