"""Grains of rubber: forces and energy of those whose deviator follows from their stretch."""

import numpy as np

from ..kernels.bulk.neo_hooke import add_neo_hookean_energy


class NeoHookeanGrains:
    """Grains of one rank whose deviator follows from their deformation. Local.

    Args:
        solid: :class:`~.solid.Solid`.
        which: Whether each grain of this rank is one.

    Attributes:
        grains: Their local numbers, shape (n,).
        quadratic_shear: Shear moduli of all grains for energies t:t/4G [Pa], inf of these, which
            store energy in another way, shape (num_grains,).
    """

    def __init__(self, solid, which):
        # Not the solid itself, which would then be freed late: growths make many.
        self._mesh, self._kernel, self._volume0 = solid.mesh, solid.kernel, solid.volume0
        self._shear = solid.shear
        which = np.asarray(which, dtype=bool)
        self.grains = np.flatnonzero(which)
        self.quadratic_shear = np.where(which, np.inf, solid.shear)

    def others(self, grains):
        """Those of ``grains`` that are none of these."""
        return grains[~np.isin(grains, self.grains)]

    def add_forces(self, f, state, grains):
        """Subtract the internal forces of some ``grains`` at the positions of ``state``.

        Its stress follows.

        Returns:
            An inverted element, or -1.
        """
        return self._kernel(
            f, state.deviator, state.plastic_strain, state.plastic_work, state.x, state.v, 0.0,
            grains, stretch=True,
        )  # fmt: skip

    def add_energy(self, energy, x):
        """Add the energy of the deviators at ``x`` [J] to ``energy``, shape (num_grains,)."""
        m = self._mesh
        add_neo_hookean_energy(
            energy, x, m.x, m.cells, self._volume0, self.grains, m.cell_offset, self._shear
        )
