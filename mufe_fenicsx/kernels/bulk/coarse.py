"""Galerkin products of a matrix of 3 × 3 blocks with motions of pieces of its nodes."""

import numba
import numpy as np


@numba.njit(cache=True)
def galerkin(offset, columns, blocks, nodes, first, piece, modes):
    """P^T K P in compressed rows of 6 × 6 blocks.

    Args:
        offset, columns, blocks: K in compressed rows, blocks of shape (num_blocks, 3, 3).
        nodes, first: Nodes of each piece in compressed form.
        piece: Of each node, shape (num_nodes,).
        modes: P: motion of each node by those of its piece, shape (num_nodes, 3, 6).

    Returns:
        Offsets, int64, shape (num_pieces + 1,), pieces, int32, increasing in each row, and blocks.
    """
    num = first.size - 1
    place = np.full(num, -1, np.int64)
    end = np.zeros(num + 1, np.int64)
    found = np.empty(8 * num, np.int32)
    for p in range(num):
        count = end[p]
        for i in range(first[p], first[p + 1]):
            for s in range(offset[nodes[i]], offset[nodes[i] + 1]):
                q = piece[columns[s]]
                if place[q] < end[p]:
                    if count == found.size:
                        found = np.concatenate((found, found))
                    place[q], found[count] = count, q
                    count += 1
        found[end[p] : count].sort()
        end[p + 1] = count
    result = np.zeros((end[num], 6, 6))
    pushed = np.empty((3, 6))
    for p in range(num):
        for k in range(end[p], end[p + 1]):
            place[found[k]] = k
        for i in range(first[p], first[p + 1]):
            n = nodes[i]
            for s in range(offset[n], offset[n + 1]):
                m = columns[s]
                target = result[place[piece[m]]]
                for a in range(3):
                    for b in range(6):
                        pushed[a, b] = (
                            blocks[s, a, 0] * modes[m, 0, b]
                            + blocks[s, a, 1] * modes[m, 1, b]
                            + blocks[s, a, 2] * modes[m, 2, b]
                        )
                for a in range(6):
                    for b in range(6):
                        target[a, b] += (
                            modes[n, 0, a] * pushed[0, b]
                            + modes[n, 1, a] * pushed[1, b]
                            + modes[n, 2, a] * pushed[2, b]
                        )
    return end, found[: end[num]].copy(), result
