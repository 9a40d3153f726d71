"""Connected pieces of triangles or tetrahedra."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def piece_of_cell(cells):
    """Number from 0 of the piece of each cell, in the order of their lowest nodes.

    Pieces have no node in common.

    Args:
        cells: Nodes of the cells, shape (num_cells, nodes a cell).

    Returns:
        Shape (num_cells,).
    """
    nodes, local = np.unique(cells, return_inverse=True)
    local = local.reshape(np.shape(cells))
    start, end = np.repeat(local[:, 0], local.shape[1] - 1), local[:, 1:].ravel()
    graph = coo_array((np.ones(start.size), (start, end)), shape=(nodes.size, nodes.size))
    return connected_components(graph, directed=False)[1][local[:, 0]]
