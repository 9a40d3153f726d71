"""Vectors at some rows of an array, to and from arrays of their own; longer copies of arrays."""

import numba
import numpy as np


@numba.njit(cache=True)
def resized(values, size):
    """Copy of an array with ``size`` entries: fewer, or room for more.

    A loop, for numba compiles a slice on the left of "=" for two seconds: it may have to say in
    words that shapes differ.
    """
    out = np.empty(size, values.dtype)
    for k in range(min(values.size, size)):
        out[k] = values[k]
    return out


@numba.njit(cache=True)
def gather_rows(out, values, rows):
    """out[i] = values[rows[i]] for rows of three, in place."""
    for i in range(rows.size):
        for k in range(3):
            out[i, k] = values[rows[i], k]


@numba.njit(cache=True)
def gather_some(out, values, rows, some):
    """:func:`gather_rows` for the rows ``some`` of ``out`` alone."""
    for i in some:
        for k in range(3):
            out[i, k] = values[rows[i], k]


@numba.njit(cache=True)
def hand_rows(values, rows, out):
    """values[rows[i]] += out[i] and out[i] = 0 for rows of three, in place."""
    for i in range(rows.size):
        for k in range(3):
            values[rows[i], k] += out[i, k]
            out[i, k] = 0.0


@numba.njit(cache=True)
def hand_some(values, rows, out, some):
    """:func:`hand_rows` for the rows ``some`` of ``out`` alone."""
    for i in some:
        for k in range(3):
            values[rows[i], k] += out[i, k]
            out[i, k] = 0.0


@numba.njit(cache=True)
def add_rows(values, rows, out):
    """values[rows[i]] += out[i] for rows of three, in place."""
    for i in range(rows.size):
        for k in range(3):
            values[rows[i], k] += out[i, k]


@numba.njit(cache=True)
def put_rows(values, rows, out):
    """values[rows[i]] = out[i] for rows of three, in place."""
    for i in range(rows.size):
        for k in range(3):
            values[rows[i], k] = out[i, k]


@numba.njit(cache=True)
def take_rows(out, values, rows):
    """out[i] = values[rows[i]] and values[rows[i]] = 0 for rows of three, in place."""
    for i in range(rows.size):
        for k in range(3):
            out[i, k] = values[rows[i], k]
            values[rows[i], k] = 0.0


def aligned(size):
    """So many doubles, all zero, the first at the start of a cache line."""
    raw = np.zeros(size + 8)
    return raw[-raw.ctypes.data // 8 % 8 :][:size]
