"""What hangs together: rows by links, and tetrahedra by nodes and by what holds them beside."""

import numba
import numpy as np


@numba.njit(cache=True)
def first_of(link, i):
    """The row that stands for what row i hangs together with; links are shortened on the way."""
    while link[i] != i:
        link[i] = link[link[i]]
        i = link[i]
    return i


@numba.njit(cache=True)
def first_of_pieces(cells, rows, holding, num_nodes):
    """The first of the given tetrahedra that each of them hangs together with.

    Args:
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        rows: Some of them, in any order, shape (num,).
        holding: Pairs of these that hang together beside, shape (n, 2).
        num_nodes: Number of nodes.

    Returns:
        Places in ``rows``, shape (num,).
    """
    link, place = np.arange(rows.size), np.empty(cells.shape[0], np.int64)
    at_node = np.full(num_nodes, -1)
    for i in range(rows.size):
        place[rows[i]] = i
        for k in range(4):
            node = cells[rows[i], k]
            if at_node[node] < 0:
                at_node[node] = i
            one, other = first_of(link, i), first_of(link, at_node[node])
            link[max(one, other)] = min(one, other)
    for h in range(holding.shape[0]):
        one, other = first_of(link, place[holding[h, 0]]), first_of(link, place[holding[h, 1]])
        link[max(one, other)] = min(one, other)
    for i in range(rows.size):
        link[i] = first_of(link, i)
    return link
