"""Pairs that can have closed, and early loads of what their evaluation reads.

Between two steps the tetrahedra stream through the caches, so that what pairs read, scattered
over many arrays, comes from memory; what is asked for some pairs ahead comes together.
"""

import numba

from .prefetch import prefetch

#: Pairs ahead of the present one whose facets are asked for; twice as many for the pairs.
AHEAD = 8


@numba.njit(cache=True)
def find_due(pairs, due, clock):
    """List the pairs whose ``due`` the ``clock`` has reached, in place; how many there are."""
    count = 0
    for p in range(due.size):
        if due[p] <= clock:
            pairs[count] = p
            count += 1
    return count


@numba.njit(cache=True)
def fetch_ahead(i, num_due, pairs, weights, shear, work, closest, node, first, candidate,
                candidate_due, facets, corner, corner_weight, x, f):  # fmt: skip
    """Ask for what the pairs after the ``i``-th of the list need; from ``i = -2 AHEAD`` on.

    Twice ``AHEAD`` before its turn for what a pair keeps (its row, of which ``weights``, ``shear``
    and ``work`` are the first, middle and last columns), ``AHEAD`` before for its candidates,
    half of that before for their nodes. Arrays as in kernels.pairs.
    """
    k = i + 2 * AHEAD
    if k < num_due:
        p = pairs[k]
        prefetch(weights, p)
        prefetch(shear, p)
        prefetch(work, p)
        prefetch(closest, p)
        prefetch(candidate, first[p])
        prefetch(candidate_due, first[p])
    k = i + AHEAD
    if 0 <= k < num_due:
        p = pairs[k]
        if corner.shape[0]:
            prefetch(corner, node[p])
            prefetch(corner_weight, node[p])
        for c in range(first[p], first[p + 1]):
            prefetch(facets, candidate[c])
    k = i + AHEAD // 2
    if 0 <= k < num_due:
        p = pairs[k]
        prefetch(x, node[p])
        if corner.shape[0]:
            for m in range(3):
                prefetch(x, corner[node[p], m])
                prefetch(f, corner[node[p], m])
        for c in range(first[p], first[p + 1]):
            for m in range(3):
                prefetch(x, facets[candidate[c], m])
