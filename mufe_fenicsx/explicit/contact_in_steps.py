"""Contact as a force of time steps, in which pairs are searched anew when grains have moved."""

import numpy as np

from ..contact.surface.active_nodes import near_nodes
from ..kernels.bulk.motion import predict
from ..state import ForceTerm


class ContactInSteps(ForceTerm):
    """Contact between grains and with walls, at the end of each step. Collective.

    Positions travel to other ranks while the bulk is computed. The kinematic law is the exception:
    it acts at the positions that all other forces would lead to.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`.
        motion: :class:`~mufe_fenicsx.explicit.motion.Motion` of the nodes in the step.
    """

    STATE = {"common": ("followed_search",)}

    def __init__(self, specimen, motion):
        self._specimen, self._motion = specimen, motion
        self._contact, self._rigid = specimen.contact, specimen.rigid
        self._kinematic = specimen.contact.layers.kinematic
        self._any_rigid = specimen.any_rigid
        self.followed_search = 0  #: the search that the following nodes were chosen after
        if self._kinematic:
            self._predicted = specimen.mesh.x.copy()
            # Glued nodes go where their wall goes, whatever acts on them.
            self._inertia = np.where(specimen.free_mass > 0, specimen.solid.mass, np.inf)

    def begin_forces(self, f, state, dt):
        """Send positions."""
        if not self._kinematic:
            known = self._motion.beside_field(dt)
            self._contact.begin_step(state.x, self._motion.largest, known)

    def add_forces(self, f, state, dt):
        """Search if it is time, and add the forces.

        Raises:
            FloatingPointError: A position is not finite, on all ranks.
        """
        positions = state.x
        if self._kinematic:
            positions = self._predicted
            predict(positions, state.x, state.v, f, self._inertia, dt)
            self._contact.begin_step(positions, self._motion.largest)
        self._contact.add_forces(f, positions)
        if self._any_rigid and self._contact.num_searches != self.followed_search:
            self._follow()

    def _follow(self):
        """Of rigid grains, only nodes that contact reads until its next search follow them."""
        contact, rigid = self._contact, self._rigid
        self.followed_search = contact.num_searches
        near = np.zeros(self._specimen.mesh.num_nodes, dtype=bool)
        near[contact.own.nodes[near_nodes(contact)]] = True
        rigid.follow(near)
        near[rigid.lists.soft] = True
        contact.ghosts.moving = np.flatnonzero(near[contact.own.nodes])
