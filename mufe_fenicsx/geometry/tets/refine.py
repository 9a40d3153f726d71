"""Tetrahedra split into eight, for composite elements and for finer meshes of the same body."""

import numpy as np

#: Parts of a tetrahedron.
PARTS = 8

#: Edges of a tetrahedron; number k has the opposite edge 5 - k.
EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])

#: The parts at the corners: a corner and middles of edges, 4 + number of the edge.
CORNERS = ((0, 4, 5, 6), (4, 1, 7, 8), (5, 7, 2, 9), (6, 8, 9, 3))

#: The octahedron between the middles: for each of its diagonals, from the middle of edge k to
#: that of 5 - k, the ring of the four others around it.
RINGS = ((5, 6, 8, 7), (4, 7, 9, 6), (4, 5, 9, 8))


def split(points, cells):
    """Split every tetrahedron into eight at the middles of its edges.

    Four parts are at the corners; the octahedron that is left is cut along its shortest diagonal
    (M. Bey, Computing 55, 1995, 355-378, on the choice). Faces are split into four in one way
    only, so that neighbours fit. Surfaces keep their place: middles stay on flat facets.

    Args:
        points: Nodes [m], shape (num_nodes, 3).
        cells: Positively oriented tetrahedra, shape (num_cells, 4).

    Returns:
        Points, the given ones first, and cells, shape (8 num_cells, 4), the eight parts of each
        tetrahedron in turn, as positively oriented as it.
    """
    points, cells = np.asarray(points, dtype=float), np.asarray(cells)
    ends = np.sort(cells[:, EDGES].reshape(-1, 2), axis=1)
    edges, number = np.unique(ends, axis=0, return_inverse=True)
    middles = 0.5 * (points[edges[:, 0]] + points[edges[:, 1]])
    nodes = np.column_stack([cells, len(points) + number.reshape(-1, 6)])
    new_points = np.concatenate([points, middles])

    x = new_points[nodes[:, 4:]]
    shortest = np.argmin([((x[:, k] - x[:, 5 - k]) ** 2).sum(axis=1) for k in range(3)], axis=0)
    parts = np.empty((len(cells), PARTS, 4), dtype=cells.dtype)
    for k, corner in enumerate(CORNERS):
        parts[:, k] = nodes[:, corner]
    for diagonal, ring in enumerate(RINGS):
        these = shortest == diagonal
        for k in range(4):
            part = (4 + diagonal, 9 - diagonal, ring[k], ring[(k + 1) % 4])
            parts[these, 4 + k] = nodes[np.ix_(these, part)]
    return new_points, parts.reshape(-1, 4)
