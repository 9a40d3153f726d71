"""Facets between the cells of grains, by names that know no ranks."""

import numpy as np

from ...kernels.cracks.cracks import FacetSearch, least_beside
from ...kernels.geometry.boxes import with_marked_vertex
from ...kernels.geometry.topology import FACETS, inner_facets


class Facets:
    """Facets inside this rank's grains that may open, in the order of their names. Local.

    A facet is named by its grain and the numbers of both cells there, as they were given. The first
    of these is its first side, from which its corners are seen from outside, the one with the
    lowest name first.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        volume: First volumes of the cells [m³], shape (num_cells,).

    Attributes:
        grain: Local grains, shape (num_facets,).
        name: Numbers of both cells in their grain, shape (num_facets, 2).
        across: Rows of both cells, int32, shape (num_facets, 2).
        corners: Corners of both cells, the same nodes of the start, uint8, (num_facets, 2, 3).
        area: [m²], shape (num_facets,).
        height: Mean of those of both cells over it [m], shape (num_facets,).
        volume: A quarter of both cells [m³], shape (num_facets,).
    """

    def __init__(self, mesh, volume):
        first = mesh.cells if mesh.origin is None else mesh.origin[mesh.cells]
        number = np.empty(mesh.num_cells, dtype=np.int64)
        number[mesh.named_cells] = np.arange(mesh.num_cells)
        number -= mesh.cell_offset[mesh.grain_of_cell]
        _, across = inner_facets(first)
        across = across[mesh.is_of_sample[mesh.grain_of_cell[across[:, 0]]]]
        across = np.take_along_axis(across, np.argsort(number[across], axis=1), axis=1)
        grain, names = mesh.grain_of_cell[across[:, 0]], number[across]
        order = np.lexsort((names[:, 1], names[:, 0], grain))
        self.grain, self.name = grain[order], names[order]
        self.across = across[order].astype(np.int32)
        one, other = first[self.across].transpose(1, 0, 2)
        beyond = np.argmin((one[:, :, None] == other[:, None, :]).any(axis=2), axis=1)
        corners = _lowest_first(FACETS[beyond], one, _names_of_first_nodes(mesh))
        nodes = np.take_along_axis(one, corners, axis=1)
        there = (nodes[:, :, None] == other[:, None, :]).argmax(axis=2)
        self.corners = np.stack([corners, there], axis=1).astype(np.uint8)
        self._first_nodes = nodes.astype(np.int32)
        x = mesh.x[self.nodes(mesh)[:, :3]]
        self.area = 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
        both = volume[self.across].sum(axis=1)
        self.height, self.volume = 1.5 * both / self.area, 0.25 * both

    def nodes(self, mesh, which=slice(None)):
        """Nodes of the corners on the first side, then on the other, int32, shape (n, 6)."""
        corners, across = self.corners[which], self.across[which]
        pair = [
            np.take_along_axis(mesh.cells[across[:, k]], corners[:, k].astype(int), axis=1)
            for k in (0, 1)
        ]
        return np.concatenate(pair, axis=1).astype(np.int32)

    def touch(self, which):
        """Whether each facet has a node, as of the start, with some of them in common."""
        marked = np.zeros(self._first_nodes.max(initial=-1) + 1, dtype=bool)
        marked[self._first_nodes[which]] = True
        return with_marked_vertex(self._first_nodes, marked)

    def rows_of(self, grain, name):
        """Rows of facets by their local grains and names, all of which there are."""
        key = self._key(self.grain, self.name)
        return np.searchsorted(key, self._key(grain, name))

    def _key(self, grain, name):
        most = int(self.name.max(initial=0)) + 1
        return (grain.astype(np.int64) * most + name[:, 0]) * most + name[:, 1]

    def search(self, mesh, volume, strength, friction, near, softens, shear, averaged):
        """Search of facets to open, arrays as of :class:`.FacetSearch`."""
        weakest = np.full(mesh.num_cells, np.inf)
        least_beside(weakest, self.across, strength)
        corner = np.ascontiguousarray(self.corners[:, 0])
        return FacetSearch(
            mesh.cells, volume, weakest, self.across, corner, strength, friction, near, softens,
            shear, averaged,
        )  # fmt: skip


def _names_of_first_nodes(mesh):
    """Numbers of the nodes of the start, in an order that knows no ranks within a grain."""
    name = np.empty(mesh.num_nodes, dtype=np.int64)
    name[mesh.named_nodes] = np.arange(mesh.num_nodes)
    if mesh.origin is None:
        return name
    first = np.full(mesh.origin.max() + 1, mesh.num_nodes)
    np.minimum.at(first, mesh.origin, name)  # parts are named after it
    return first


def _lowest_first(corners, nodes, name):
    """The same corners turned so that their node of the lowest name comes first, (n, 3)."""
    lowest = np.argmin(name[np.take_along_axis(nodes, corners, axis=1)], axis=1)
    return np.take_along_axis(corners, (lowest[:, None] + np.arange(3)) % 3, axis=1)
