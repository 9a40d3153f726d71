"""Pairs of a new search that an old one knew."""

import numba


@numba.njit(cache=True)
def transfer_pairs(old_node, old_grain, new_node, new_grain):
    """For each new pair the old pair of the same node and grain, or -1.

    Both lists increase in node, then in grain.
    """
    source = new_node.copy()
    o = 0
    for p in range(new_node.size):
        while o < old_node.size and (
            old_node[o] < new_node[p]
            or (old_node[o] == new_node[p] and old_grain[o] < new_grain[p])
        ):
            o += 1
        same = o < old_node.size and old_node[o] == new_node[p] and old_grain[o] == new_grain[p]
        source[p] = o if same else -1
    return source


@numba.njit(cache=True)
def find_again(closest, pairs, facets, first, candidate):
    """Set ``closest`` of ``pairs`` to the candidate that is the given facet, in place."""
    for i in range(pairs.size):
        for k in range(first[pairs[i]], first[pairs[i] + 1]):
            if candidate[k] == facets[i]:
                closest[pairs[i]] = k


@numba.njit(cache=True)
def copy_rows(to, rows, of, source):
    """Set ``rows`` of ``to`` to the rows ``source`` of another array, without a copy between."""
    for i in range(rows.size):
        for k in range(to.shape[1]):
            to[rows[i], k] = of[source[i], k]
