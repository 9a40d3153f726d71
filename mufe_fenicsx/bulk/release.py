"""When a grain of the material `Auto` begins to deform."""

import numpy as np

from ..materials.auto import Auto


class LoadWatch:
    """Loads on the rigid grains of one rank that may deform later.

    Args:
        rigid: :class:`~mufe_fenicsx.bulk.rigid.RigidGrains` at the start.
        solid: :class:`~mufe_fenicsx.bulk.solid.Solid` of all grains of this rank.
    """

    def __init__(self, rigid, solid):
        self.rigid, self.solid = rigid, solid
        #: sum of the force magnitudes up to which each rigid grain stays so [N]
        self.largest = np.array(
            [
                largest_push(solid.materials[g], R)
                for g, R in zip(rigid.grains, rigid.radius, strict=True)
            ]
        )

    @property
    def num_waiting(self):
        """Rigid grains that may deform later."""
        return self.largest.size - self.rigid.num_always

    def loaded(self, f):
        """Which rigid grains have to deform, shape (num_rigid_grains,). Local.

        Args:
            f: Contact forces on the nodes of rigid grains [N], shape (num_nodes, 3).
        """
        return self.rigid.pushes(f) > self.largest

    def release(self, which):
        """Let the rigid grains ``which`` deform from now on, shape (num_rigid_grains,). Local."""
        self.rigid.release(which)
        self.largest = self.largest[~which]
        grains = np.arange(self.solid.mesh.num_grains)
        self.solid.set_deforming(grains[~np.isin(grains, self.rigid.grains)])

    def release_all_but(self, still_rigid):
        """Let those deform that are not among ``still_rigid``, global indices. Local."""
        which = ~np.isin(self.solid.mesh.grains[self.rigid.grains], still_rigid)
        if which.any():
            self.release(which)


def largest_push(material, radius):
    """Sum of the force magnitudes up to which a grain stays rigid [N], inf if it always does.

    That of two opposite forces on a grain of that ``radius`` [m], see `Auto`.
    """
    if not isinstance(material, Auto):
        return np.inf
    return 2.0 * np.pi * radius**2 * material.margin * material.yield_stress[0][1]
