"""Surfaces of all grains as one list of nodes and triangles, the same through all states."""

from dataclasses import dataclass

import numpy as np
import pyvista

from mufe_fenicsx.analysis.by_grain import index_grains
from mufe_fenicsx.geometry.measure import tet_volumes
from mufe_fenicsx.report.sample import boundary_faces


@dataclass(frozen=True)
class Surfaces:
    """Surfaces of the grains; the nodes of a grain follow each other."""

    labels: np.ndarray  #: of the grains, increasing, shape (num_grains,)
    nodes: np.ndarray  #: of the mesh, shape (num_nodes,)
    grain: np.ndarray  #: index of the grain of each node, increasing, shape (num_nodes,)
    faces: np.ndarray  #: outward triangles of these nodes, the smallest first, (num_faces, 3)

    @property
    def num_of_grain(self):
        """Number of nodes of each grain, shape (num_grains,)."""
        return np.bincount(self.grain, minlength=self.labels.size)


def grain_surfaces(cells, grain_of_cell, boundary=None):
    """Surfaces of the grains of a mesh.

    A node that two grains share is there twice, once in the surface of each.

    Args:
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
        grain_of_cell: Label of each cell's grain, shape (num_cells,).
        boundary: What :func:`~mufe_fenicsx.report.sample.boundary_faces` gave for these cells.

    Returns:
        :class:`Surfaces`.
    """
    faces, cell = boundary_faces(cells) if boundary is None else boundary
    labels, grain = index_grains(grain_of_cell)
    num_nodes = int(cells.max()) + 1
    key = grain[cell][:, None].astype(np.int64) * num_nodes + faces
    key, faces = np.unique(key, return_inverse=True)
    return Surfaces(labels, key % num_nodes, key // num_nodes, in_order(faces.reshape(-1, 3)))


def in_order(faces):
    """Triangles turned so that the smallest node comes first, sorted by it."""
    turn = (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3
    faces = np.take_along_axis(faces, turn, axis=1)
    return faces[np.lexsort((faces[:, 1], faces[:, 0]))]


def thinned(surfaces, points, most):
    """Surfaces of about ``most`` nodes, a part of those that there are, by edge collapse.

    Args:
        surfaces: :class:`Surfaces`.
        points: Nodes of the mesh [m], shape (num_mesh_nodes, 3).
        most: Number of nodes.

    Returns:
        :class:`Surfaces`; the same if they are few enough.
    """
    share = 1 - most / surfaces.nodes.size
    if share <= 0:
        return surfaces
    nodes, grain, faces, at = [], [], [], 0
    of_face = surfaces.grain[surfaces.faces[:, 0]]
    ends = np.append(0, np.cumsum(surfaces.num_of_grain))
    for g in range(surfaces.labels.size):
        mine = np.arange(ends[g], ends[g + 1])
        mesh = pyvista.PolyData.from_regular_faces(
            points[surfaces.nodes[mine]], surfaces.faces[of_face == g] - ends[g]
        )
        mesh.point_data["node"] = mine
        thin = mesh.decimate_pro(share, splitting=False, preserve_topology=True)
        kept, used = np.unique(thin.regular_faces, return_inverse=True)
        nodes.append(surfaces.nodes[thin.point_data["node"][kept]])
        grain.append(np.full(kept.size, g))
        faces.append(used.reshape(-1, 3) + at)
        at += kept.size
    return Surfaces(
        surfaces.labels,
        np.concatenate(nodes),
        np.concatenate(grain),
        in_order(np.concatenate(faces)),
    )


class NodeMeans:
    """Means of the cells around nodes, by their volumes.

    Args:
        points: Nodes now [m], shape (num_nodes, 3).
        cells: Nodes of the tetrahedra, shape (num_cells, 4).
    """

    def __init__(self, points, cells):
        self._cells, self._num_nodes = cells.ravel(), len(points)
        self._volume = np.abs(tet_volumes(points, cells))
        self._total = self._sum(self._volume)

    def __call__(self, values):
        """Means at the nodes of values of the cells, shape (num_nodes,); 0 where no cell is."""
        found = self._sum(values * self._volume)
        return np.divide(found, self._total, out=np.zeros_like(found), where=self._total > 0)

    def _sum(self, values):
        return np.bincount(self._cells, np.repeat(values, 4), self._num_nodes)
