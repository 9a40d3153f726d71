"""How far grains moved relative to each other."""

import math

import numba


@numba.njit(cache=True)
def advance_clocks(readings, until, first, second, moves, more, step):
    """Clocks of pairs of grains advance by what both moved, but by no more than ``step`` [m].

    Args:
        readings: Of the clocks [m], shape (num_clocks,), in place.
        until: Readings that they are not expected to pass [m].
        first, second: Rows of ``moves`` that are theirs.
        moves: Largest distance that a node of each grain moved beside a common field [m].
        more: What the field itself adds between points that are near each other [m].
        step: Bound of all relative motion [m].

    Returns:
        By how much one passes that in the next two steps, if these go on as this one [m].
    """
    largest = -math.inf
    for i in range(readings.size):
        moved = min(step, moves[first[i]] + moves[second[i]] + more)
        readings[i] += moved
        largest = max(largest, readings[i] + 2.0 * moved - until[i])
    return largest


@numba.njit(cache=True)
def measure_moves(moves, previous, x, row, field, dt):
    """Largest distance that nodes moved beside a field since the last call, in place.

    Args:
        moves: Set for all grains that have nodes here [m].
        previous, x: Positions then, which become those now, and now [m], shape (num_nodes, 3).
        row: Row of ``moves`` of each node.
        field: Velocity linear in the place, as in kernels.motion.
        dt: Time since then [s].
    """
    for n in range(row.size):
        moves[row[n]] = 0.0
    for n in range(row.size):
        square = 0.0
        for i in range(3):
            d = x[n, i] - previous[n, i] - dt * field[0, i]
            for k in range(3):
                d -= dt * field[1 + k, i] * previous[n, k]
            square += d * d
        # Not finite: all that may be.
        moves[row[n]] = max(moves[row[n]], math.sqrt(square)) if square < math.inf else math.inf
        for i in range(3):
            previous[n, i] = x[n, i]
