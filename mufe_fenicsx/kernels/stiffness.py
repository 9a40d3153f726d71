"""Stiffness of linear tetrahedra, as blocks of two nodes."""

import numba
import numpy as np

from .blocks import slot_of


@numba.njit(cache=True)
def add_tetrahedra(blocks, offset, columns, x, cells, lame, shear):
    """Add V (λ a ⊗ b + G (b ⊗ a + a·b I)) to the block of each two nodes, in place.

    a and b are the gradients of the shape functions of row and column, V the volume.

    Args:
        blocks: Shape (num_blocks, 3, 3), in the pattern ``offset``, ``columns``.
        offset, columns: Compressed rows that hold all pairs of nodes of each cell.
        x: Reference positions [m], shape (num_nodes, 3).
        cells: Shape (num_cells, 4).
        lame, shear: λ and G of each cell [Pa], shape (num_cells,).
    """
    g = np.empty((4, 3))
    for c in range(cells.shape[0]):
        o = x[cells[c, 0]]
        p, q, r = x[cells[c, 1]] - o, x[cells[c, 2]] - o, x[cells[c, 3]] - o
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            g[1, k] = q[i] * r[j] - q[j] * r[i]
            g[2, k] = r[i] * p[j] - r[j] * p[i]
            g[3, k] = p[i] * q[j] - p[j] * q[i]
            g[0, k] = -g[1, k] - g[2, k] - g[3, k]
        # Six times the volume; gradients are g over it.
        six = p[0] * g[1, 0] + p[1] * g[1, 1] + p[2] * g[1, 2]
        first, second = lame[c] / (6.0 * six), shear[c] / (6.0 * six)
        for a in range(4):
            for b in range(4):
                s = slot_of(offset, columns, cells[c, a], cells[c, b])
                along = second * (g[a, 0] * g[b, 0] + g[a, 1] * g[b, 1] + g[a, 2] * g[b, 2])
                for i in range(3):
                    for j in range(3):
                        blocks[s, i, j] += first * g[a, i] * g[b, j] + second * g[b, i] * g[a, j]
                    blocks[s, i, i] += along
