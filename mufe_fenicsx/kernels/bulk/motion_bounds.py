"""How far grains moved relative to each other."""

import math

import numba


@numba.njit(cache=True)
def advance_bounds(bounds, until, first, second, moves, more, step):
    """Bounds for pairs of grains advance by what both moved, but by no more than ``step`` [m].

    Args:
        bounds: Of relative motion so far [m], shape (num_bounds,), in place.
        until: Bounds that they are not expected to pass [m].
        first, second: Rows of ``moves`` that are theirs.
        moves: Largest distance that a node of each grain moved beside a common field [m].
        more: What the field itself adds between points that are near each other [m].
        step: Bound of all relative motion [m].

    Returns:
        By how much one passes that in the next two steps, if these go on as this one [m].
    """
    largest = -math.inf
    for i in range(bounds.size):
        moved = min(step, moves[first[i]] + moves[second[i]] + more)
        bounds[i] += moved
        largest = max(largest, bounds[i] + 2.0 * moved - until[i])
    return largest
