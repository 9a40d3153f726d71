"""Flat tetrahedra made thicker by moving their nodes, those of the surface along it."""

import numpy as np

from ...kernels.geometry.relocate import EDGE, FIXED, INTERIOR, SURFACE, may_move, relocate
from ..measure import boundary_triangles

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
    points = points.copy()
    relocation = Relocation(cells, boundary_triangles(cells), size, len(points))
    relocation.inside(points, target)
    relocation.surface(points, surface_target, tolerance, fixed, along)
    return points


class Relocation:
    """Tetrahedra whose nodes move to make them thicker.

    Args:
        cells: Positively oriented tetrahedra.
        facets: Their surfaces; facets that two bodies share are there twice.
        size: Wanted length of edges: a number, or one a cell.
        num_nodes: How many nodes.
    """

    def __init__(self, cells, facets, size, num_nodes):
        self.cells = np.ascontiguousarray(cells, dtype=np.int64)
        self.facets = np.ascontiguousarray(facets, dtype=np.int64)
        self.size = np.broadcast_to(np.asarray(size, dtype=float), len(cells)).copy()
        self.star = _rows(self.cells, num_nodes)
        self.around = (self.cells, self.size, *self.star)
        self.around += (self.facets, *_rows(self.facets, num_nodes))
        self.drift = np.zeros(num_nodes)
        self._nowhere = np.full((num_nodes, 2), -1, dtype=np.int64)

    def inside(self, x, target=0.5):
        """Move nodes inside, in place, around altitudes below ``target`` times the size."""
        kind = np.full(len(x), INTERIOR, dtype=np.int8)
        kind[self.facets] = FIXED
        relocate(x, self.drift, *self.around, kind, self._nowhere, target, 0.0, ROUNDS)

    def surface(self, x, target, tolerance, fixed=None, along=None):
        """Move all nodes but those fixed, in place; those of the surface leave it by no more.

        ``along`` as of :func:`thickened`.
        """
        kind = np.full(len(x), INTERIOR, dtype=np.int8)
        kind[self.facets] = SURFACE
        edges = self._nowhere
        if along is not None:
            edges = edges.copy()
            edges[: len(along)] = along
            kind[edges[:, 0] >= 0] = EDGE
        if fixed is not None:
            kind[fixed] = FIXED
        relocate(x, self.drift, *self.around, kind, edges, target, tolerance, ROUNDS)

    def allowed(self, x, new, least=0.2):
        """Whether each node may go to a new place, shape (num_nodes,).

        No altitude may fall below ``least`` times the size that was above, and none that was
        below may fall.
        """
        moved = np.flatnonzero((x != new).any(axis=1))
        good = np.ones(len(x), dtype=bool)
        if moved.size:
            good[moved] = may_move(x, new, moved, *self.around[:4], least)
        return good


def _rows(elements, num_nodes):
    """Elements around each node: offsets and elements, compressed rows."""
    order = np.argsort(elements.ravel(), kind="stable")
    offset = np.concatenate([[0], np.cumsum(np.bincount(elements.ravel(), minlength=num_nodes))])
    return offset, order // elements.shape[1]
