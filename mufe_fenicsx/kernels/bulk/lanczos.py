"""Steps of a Lanczos iteration on M⁻¹K, each one pass over its vectors.

Vectors are of shape (num_rows, 3); masses of shape (num_rows, 1), or (num_rows, 3) where they
differ from one component to another. Products of vectors are those of the masses, aᵀM b.
"""

import math

import numba

#: Sums in any order.
FAST = {"contract", "reassoc"}


@numba.njit(cache=True)
def begin(v, mass, noise):
    """v = M^(-1/2) noise, in place."""
    last = mass.shape[1] - 1
    for i in range(len(v)):
        part = 1.0 / math.sqrt(mass[i, 0])
        for c in range(3):
            if c and last:
                part = 1.0 / math.sqrt(mass[i, c])
            v[i, c] = part * noise[i, c]


@numba.njit(cache=True, fastmath=FAST)
def square(v, mass):
    """v·v."""
    last, found = mass.shape[1] - 1, 0.0
    for i in range(len(v)):
        for c in range(3):
            found += mass[i, min(c, last)] * v[i, c] * v[i, c]
    return found


@numba.njit(cache=True, fastmath=FAST)
def weigh(w, mass, v, before, off):
    """w = M⁻¹w - off before, in place; returns w·v and w·w."""
    last, along, size = mass.shape[1] - 1, 0.0, 0.0
    if last:
        for i in range(len(w)):
            for c in range(3):
                w[i, c] = w[i, c] / mass[i, c] - off * before[i, c]
                along += mass[i, c] * w[i, c] * v[i, c]
                size += mass[i, c] * w[i, c] * w[i, c]
        return along, size
    # Written out, which compilers turn into vector instructions.
    for i in range(len(w)):
        inverse = 1.0 / mass[i, 0]
        w0 = w[i, 0] * inverse - off * before[i, 0]
        w1 = w[i, 1] * inverse - off * before[i, 1]
        w2 = w[i, 2] * inverse - off * before[i, 2]
        w[i, 0], w[i, 1], w[i, 2] = w0, w1, w2
        along += mass[i, 0] * (w0 * v[i, 0] + w1 * v[i, 1] + w2 * v[i, 2])
        size += mass[i, 0] * (w0 * w0 + w1 * w1 + w2 * w2)
    return along, size


@numba.njit(cache=True, fastmath=FAST)
def products(w, mass, v, before):
    """w·v, w·before and w·w."""
    last = mass.shape[1] - 1
    to_v = to_before = size = 0.0
    for i in range(len(w)):
        for c in range(3):
            part = mass[i, min(c, last)] * w[i, c]
            to_v += part * v[i, c]
            to_before += part * before[i, c]
            size += part * w[i, c]
    return to_v, to_before, size


@numba.njit(cache=True)
def subtract(w, along, v, scale):
    """w = (w - along v) scale, in place."""
    w, v = w.ravel(), v.ravel()
    for i in range(w.size):
        w[i] = (w[i] - along * v[i]) * scale


@numba.njit(cache=True)
def add(v, share, other):
    """v += share other, in place."""
    v, other = v.ravel(), other.ravel()
    for i in range(v.size):
        v[i] += share * other[i]


@numba.njit(cache=True)
def take_known(out, rows, values, of):
    """Rows of a vector that is known at the rows ``of``, zero elsewhere, in place.

    Args:
        out: Shape (num_rows, 3).
        rows: Which, ascending, shape (num_rows,).
        values: Shape (num_known, 3).
        of: The rows of ``values``, ascending.
    """
    k = 0
    for i in range(rows.size):
        while k < of.size and of[k] < rows[i]:
            k += 1
        known = k < of.size and of[k] == rows[i]
        for c in range(3):
            out[i, c] = values[k, c] if known else 0.0
