"""Sparse rows of 3 × 3 blocks: patterns, places in them, and sums of dyads."""

import numba
import numpy as np


@numba.njit(cache=True)
def joined_pattern(first, node, offset, columns, num_nodes):
    """Compressed rows that hold given rows and all pairs of nodes within groups.

    Args:
        first, node: Groups of nodes in compressed form; each node once in a group.
        offset, columns: Compressed rows that the pattern has to hold too.
        num_nodes: Number of rows.

    Returns:
        Offsets, int64, shape (num_nodes + 1,), and columns, increasing in each row, int32.
    """
    # Groups of each node.
    start = np.zeros(num_nodes + 1, np.int64)
    for n in node:
        start[n + 1] += 1
    start = np.cumsum(start)
    fill, group_of = start[:-1].copy(), np.empty(node.size, np.int32)
    for g in range(first.size - 1):
        for i in range(first[g], first[g + 1]):
            group_of[fill[node[i]]] = g
            fill[node[i]] += 1
    seen = np.full(num_nodes, -1, np.int64)
    found = np.empty(1, np.int32)
    result = np.zeros(num_nodes + 1, np.int64)
    for sweep in range(2):
        if sweep:
            result = np.cumsum(result)
            found = np.empty(result[-1], np.int32)
            seen[:] = -1
        for n in range(num_nodes):
            count = 0
            for i in range(offset[n], offset[n + 1]):
                m = columns[i]
                if seen[m] != n:
                    seen[m] = n
                    if sweep:
                        found[result[n] + count] = m
                    count += 1
            for k in range(start[n], start[n + 1]):
                for i in range(first[group_of[k]], first[group_of[k] + 1]):
                    m = node[i]
                    if seen[m] != n:
                        seen[m] = n
                        if sweep:
                            found[result[n] + count] = m
                        count += 1
            if sweep:
                found[result[n] : result[n + 1]].sort()
            else:
                result[n + 1] = count
    return result, found


@numba.njit(cache=True)
def slot_of(offset, columns, row, column):
    """Place of ``column`` in the sorted columns of a row, by bisection."""
    low, high = offset[row], offset[row + 1]
    while low < high:
        middle = (low + high) // 2
        if columns[middle] < column:
            low = middle + 1
        else:
            high = middle
    return low


@numba.njit(cache=True)
def find_slots(offset, columns, row, column):
    """Places of the entries (row, column) in compressed rows that hold them all."""
    slots = np.empty(row.size, np.int64)
    for i in range(row.size):
        slots[i] = slot_of(offset, columns, row[i], column[i])
    return slots


@numba.njit(cache=True)
def add_products(blocks, first, node, left, right, factor, offset, columns):
    """Add factor · left ⊗ right over all pairs of entries of each group to ``blocks``, in place.

    Args:
        blocks: Shape (num_blocks, 3, 3), in the pattern ``offset``, ``columns``.
        first, node: Groups in compressed form.
        left, right: Vectors of the entries, shape (num_entries, 3).
        factor: Of the groups, shape (num_groups,).
        offset, columns: Compressed rows that hold all pairs.
    """
    for g in range(first.size - 1):
        for i in range(first[g], first[g + 1]):
            ax, ay, az = factor[g] * left[i, 0], factor[g] * left[i, 1], factor[g] * left[i, 2]
            for j in range(first[g], first[g + 1]):
                s = slot_of(offset, columns, node[i], node[j])
                for k in range(3):
                    b = right[j, k]
                    blocks[s, 0, k] += ax * b
                    blocks[s, 1, k] += ay * b
                    blocks[s, 2, k] += az * b


@numba.njit(cache=True)
def add_blocks(values, slots, blocks):
    """values[slots[i]] += blocks[i], in place."""
    for i in range(slots.size):
        for m in range(3):
            for k in range(3):
                values[slots[i], m, k] += blocks[i, m, k]


@numba.njit(cache=True)
def project_blocks(blocks, offset, columns, projector, held):
    """Blocks P_row K P_column of compressed rows, in place, where either node is held.

    Args:
        blocks: Shape (num_blocks, 3, 3).
        offset, columns: The rows.
        projector: Of each node, shape (num_nodes, 3, 3).
        held: Whether it differs from one, shape (num_nodes,).
    """
    for n in range(offset.size - 1):
        for s in range(offset[n], offset[n + 1]):
            if held[n] or held[columns[s]]:
                blocks[s] = projector[n] @ (blocks[s] @ projector[columns[s]])


@numba.njit(cache=True)
def project_pairs(blocks, rows, columns, projector, held):
    """:func:`project_blocks` of blocks with their nodes."""
    for s in range(rows.size):
        if held[rows[s]] or held[columns[s]]:
            blocks[s] = projector[rows[s]] @ (blocks[s] @ projector[columns[s]])
