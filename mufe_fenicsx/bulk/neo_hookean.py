"""Grains of rubber: forces and energy of those whose deviator follows from their stretch."""

import numpy as np

from ..kernels.neo_hooke import (
    add_neo_hookean_energy,
    reference_gradients,
    subtract_neo_hookean,
)


class NeoHookeanGrains:
    """Grains of one rank whose deviator follows from their deformation. Local.

    Args:
        solid: :class:`~.solid.Solid`.
        which: Whether each grain of this rank is one.
        element: Kind of element, of kernels.solid.

    Attributes:
        grains: Their local numbers, shape (n,).
        quadratic_shear: Shear moduli of all grains for energies t:t/4G [Pa], inf of these, which
            store energy in another way, shape (num_grains,).
    """

    def __init__(self, solid, which, element):
        mesh = self._mesh = solid.mesh
        self._solid, self._element = solid, element
        which = np.asarray(which, dtype=bool)
        self.grains = np.flatnonzero(which)
        self.quadratic_shear = np.where(which, np.inf, solid.shear)
        rows = [np.arange(*mesh.cell_offset[g : g + 2]) for g in self.grains]
        cells = mesh.cells[np.concatenate(rows)] if rows else mesh.cells[:0]
        self._gradients = reference_gradients(mesh.x, cells)
        self._first = np.cumsum([0, *map(len, rows)])[:-1]
        self._around = np.empty(mesh.num_nodes if rows else 0)

    def others(self, grains):
        """Those of ``grains`` that are none of these."""
        return grains[~np.isin(grains, self.grains)]

    def add_forces(self, f, state):
        """Subtract the internal forces at the positions of ``state``, whose stress follows.

        Returns:
            An inverted element, or -1.
        """
        m, solid = self._mesh, self._solid
        return subtract_neo_hookean(
            f, state.deviator, solid.pressure, self._around, state.x, m.cells, solid.volume0,
            self._gradients, self._first, self.grains, m.cell_offset, m.nodes, m.node_offset,
            solid.kernel.node_volume0, solid.bulk, solid.shear, self._element,
        )  # fmt: skip

    def add_energy(self, energy, x):
        """Add the energy of the deviators at ``x`` [J] to ``energy``, shape (num_grains,)."""
        m, solid = self._mesh, self._solid
        add_neo_hookean_energy(
            energy, x, m.cells, solid.volume0, self._gradients, self._first, self.grains,
            m.cell_offset, solid.shear,
        )  # fmt: skip
