"""The yield stress that plastic strain has brought the surface of the grains to."""

import numpy as np

from ..kernels.hardening import plastic_increment
from ..kernels.topology import FACETS


def surface_strength(solid, own, plastic_strain):
    """Yield stress of J σ reached in the elements under facets [Pa], shape (num_facets,). Local.

    inf where grains do not yield, or by a law of one's own whose yield stress is not known.

    Args:
        solid: :class:`~mufe_fenicsx.bulk.solid.Solid`.
        own: :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        plastic_strain: Of the cells, shape (num_cells,).
    """
    mesh, num_nodes = solid.mesh, own.nodes.size
    found = np.full(len(own.facets), np.inf)
    yields = np.array(
        [m.plastic_increment is plastic_increment and np.isfinite(m.parameters()[0])
         for m in solid.materials], dtype=bool,
    )  # fmt: skip
    row = np.full(mesh.num_nodes, -1, dtype=np.int64)
    row[own.nodes] = np.arange(num_nodes)
    cell = np.flatnonzero(((row[mesh.cells] >= 0).sum(axis=1) >= 3) & yields[mesh.grain_of_cell])
    side = row[mesh.cells[cell]][:, FACETS].reshape(-1, 3)
    on_surface = (side >= 0).all(axis=1)
    key, cell = _key(side[on_surface], num_nodes), np.repeat(cell, 4)[on_surface]
    _, facet, place = np.intersect1d(_key(own.facets, num_nodes), key, return_indices=True)
    cell = cell[place]
    grain = mesh.grain_of_cell[cell]
    for k in np.unique(grain):
        of_grain = grain == k
        strain, stress = np.asarray(solid.materials[k].parameters())[2:].reshape(2, -1)
        found[facet[of_grain]] = np.interp(plastic_strain[cell[of_grain]], strain, stress)
    return found


def _key(triangles, num_nodes):
    """One number for three nodes in any order."""
    a, b, c = np.sort(triangles, axis=1).astype(np.int64).T
    return (a * num_nodes + b) * num_nodes + c
