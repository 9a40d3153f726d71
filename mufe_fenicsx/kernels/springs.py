"""The energy of a normal spring."""

import numba


@numba.njit(cache=True)
def stored_energy(stiffness, depth, largest_depth):
    """Energy of a normal spring whose force grows no more beyond the largest depth [J].

    k d²/2 up to the largest depth D, then k D (d - D/2): the work of the force.
    """
    within = min(depth, largest_depth)
    return stiffness * within * (depth - 0.5 * within)
