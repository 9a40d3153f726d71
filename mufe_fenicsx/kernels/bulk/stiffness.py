"""Stiffness of linear tetrahedra, as blocks of two nodes."""

import numba
import numpy as np


@numba.njit(cache=True)
def gradients(g, e, x, cells, c):
    """Gradients of the four shape functions of the tetrahedron c, in place; six times its volume.

    Args:
        g: The gradients times six volumes [m²], shape (4, 3).
        e: Room for three edges, shape (3, 3).
        x, cells: As of :func:`add_tetrahedra`.
    """
    for m in range(3):
        for k in range(3):
            e[m, k] = x[cells[c, m + 1], k] - x[cells[c, 0], k]
    for m in range(3):
        q, r = e[(m + 1) % 3], e[(m + 2) % 3]
        g[m + 1, 0] = q[1] * r[2] - q[2] * r[1]
        g[m + 1, 1] = q[2] * r[0] - q[0] * r[2]
        g[m + 1, 2] = q[0] * r[1] - q[1] * r[0]
    for k in range(3):
        g[0, k] = -g[1, k] - g[2, k] - g[3, k]
    return e[0, 0] * g[1, 0] + e[0, 1] * g[1, 1] + e[0, 2] * g[1, 2]


@numba.njit(cache=True)
def add_tetrahedra(blocks, offset, columns, x, cells, lame, shear):
    """Add V (λ a ⊗ b + G (b ⊗ a + a·b I)) to the block of each two nodes, in place.

    a and b are the gradients of the shape functions of row and column, V the volume. Row by row,
    so that places are looked up once a row.

    Args:
        blocks: Shape (num_blocks, 3, 3), in the pattern ``offset``, ``columns``.
        offset, columns: Compressed rows that hold all pairs of nodes of each cell.
        x: Reference positions [m], shape (num_nodes, 3).
        cells: Shape (num_cells, 4).
        lame, shear: λ and G of each cell [Pa], shape (num_cells,).
    """
    num = offset.size - 1
    end = np.zeros(num + 1, np.int64)
    for c in range(cells.shape[0]):
        for a in range(4):
            end[cells[c, a] + 1] += 1
    end = np.cumsum(end)
    fill, corner_of = end[:-1].copy(), np.empty(4 * cells.shape[0], np.int64)
    for c in range(cells.shape[0]):
        for a in range(4):
            corner_of[fill[cells[c, a]]] = 4 * c + a
            fill[cells[c, a]] += 1
    place, g, e = np.empty(num, np.int64), np.empty((4, 3)), np.empty((3, 3))
    for n in range(num):
        for s in range(offset[n], offset[n + 1]):
            place[columns[s]] = s
        for i in range(end[n], end[n + 1]):
            c, a = divmod(corner_of[i], 4)
            six = gradients(g, e, x, cells, c)
            first, second = lame[c] / (6.0 * six), shear[c] / (6.0 * six)
            for b in range(4):
                s = place[cells[c, b]]
                along = second * (g[a, 0] * g[b, 0] + g[a, 1] * g[b, 1] + g[a, 2] * g[b, 2])
                for k in range(3):
                    for m in range(3):
                        blocks[s, k, m] += first * g[a, k] * g[b, m] + second * g[b, k] * g[a, m]
                    blocks[s, k, k] += along
