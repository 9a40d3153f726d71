"""The yield stress that plastic strain has brought the surface of the grains to."""

import numpy as np


def surface_strength(solid, own, plastic_strain):
    """Yield stress of J σ reached in the elements under facets [Pa], shape (num_facets,). Local.

    inf where grains do not yield, or by a law of one's own whose yield stress is not known.

    Args:
        solid: :class:`~mufe_fenicsx.bulk.solid.Solid`.
        own: :class:`~mufe_fenicsx.contact.surface.surface.OwnSurface`.
        plastic_strain: Of the cells, shape (num_cells,).
    """
    found = np.full(len(own.facets), np.inf)
    for k in np.unique(own.local_grain_of_facet):
        law = solid.materials[k]
        if law.plastic_increment is None and np.isfinite(law.parameters()[0]):
            of_grain = own.local_grain_of_facet == k
            strain, stress = np.asarray(law.parameters())[2:].reshape(2, -1)
            cell = own.cell_of_facet[of_grain]
            found[of_grain] = np.interp(plastic_strain[cell], strain, stress)
    return found
