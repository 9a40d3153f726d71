"""Flat tetrahedra made thicker by moving their nodes, those of the surface along it."""

import numpy as np

from ..kernels.relocate import EDGE, FIXED, INTERIOR, SURFACE, relocate
from .measure import boundary_triangles

#: Sweeps over the nodes at most.
ROUNDS = 12


def thickened(
    points,
    cells,
    size,
    *,
    target=0.5,
    surface_target=0.42,
    tolerance=0.02,
    fixed=None,
    along=None,
):
    """Nodes moved so that the smallest altitudes rise where they are below ``target * size``.

    First the nodes inside move; nodes of the surface only around altitudes that are still below
    ``surface_target * size``.

    Args:
        points, cells: Positively oriented tetrahedra.
        size: Wanted length of edges: a number, or one a cell.
        target, surface_target: Altitudes over size that are good enough.
        tolerance: What a node of the surface may leave it by [length].
        fixed: Nodes that may not move, or None.
        along: Neighbours along an edge of the body, for the first nodes; they move along it only.
            Shape (n, 2), -1 for nodes on no edge; or None.

    Returns:
        Points in their new places.
    """
    points, cells = points.copy(), np.ascontiguousarray(cells, dtype=np.int64)
    size = np.broadcast_to(np.asarray(size, dtype=float), len(cells)).copy()
    facets = boundary_triangles(cells)
    kind = np.full(len(points), INTERIOR, dtype=np.int8)
    kind[facets] = FIXED
    drift = np.zeros(len(points))
    around = (cells, size, *_rows(cells, len(points)), facets, *_rows(facets, len(points)))
    edges = np.full((len(points), 2), -1, dtype=np.int64)
    relocate(points, drift, *around, kind, edges, target, tolerance, ROUNDS)
    kind[facets] = SURFACE
    if along is not None:
        edges[: len(along)] = along
        kind[edges[:, 0] >= 0] = EDGE
    if fixed is not None:
        kind[fixed] = FIXED
    relocate(points, drift, *around, kind, edges, surface_target, tolerance, ROUNDS)
    return points


def _rows(elements, num_nodes):
    """Elements around each node: offsets and elements, compressed rows."""
    order = np.argsort(elements.ravel(), kind="stable")
    offset = np.concatenate([[0], np.cumsum(np.bincount(elements.ravel(), minlength=num_nodes))])
    return offset, order // elements.shape[1]
