"""Weight of the grains."""

import numpy as np

from ..errors import finite_array
from ..kernels.bulk.motion import add_weights
from ..state import ForceTerm


class Gravity(ForceTerm):
    """Weight of all nodes: f = m g, with the potential -m g·u.

    Glued nodes have none: their mass belongs to the wall.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        mass: Nodal masses [kg], shape (num_nodes,), those of the materials: added mass has no
            weight.
        g: Acceleration [m/s²], shape (3,).
        rigid: :class:`~mufe_fenicsx.bulk.rigid.RigidGrains`.

    Raises:
        InputError: g has not three finite numbers.
    """

    name = "gravity"

    def __init__(self, mesh, mass, g, rigid):
        self.g = finite_array("gravity", g, (3,))
        self.mesh, self._mass, self._rigid = mesh, mass, rigid
        self._mass_of_grain = np.bincount(mesh.grain_of_node, mass, mesh.num_grains)

    def add_forces(self, f, state, dt):
        """Add the weights of grains that deform to ``f``. Local."""
        add_weights(f, self._mass, self.g, self._rigid.lists.runs)

    def act_on_rigid(self, rigid, state):
        """Add the weights of rigid grains. Local."""
        rigid.force += self._mass_of_grain[rigid.grains, None] * self.g

    def energy(self, state):
        """Potential energy since the start [J]. Local."""
        if self._rigid.num_grains:
            self._rigid.place_all(state.x, state.u)
        return -float(self._mass @ (state.u @ self.g))
