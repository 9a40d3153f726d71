"""Nodes that are glued to a wall: an exact constraint on their motion, without any spring."""

import numpy as np

from ..errors import InputError
from ..kernels.bulk.glued import (
    give_rows,
    largest_of_glued,
    place_glued,
    squares_of_glued,
    take_glued,
)
from ..state import Constraint

#: A node lies on a plane within this part of the width of a rank's grains.
TOLERANCE = 1e-9


def find_glued(x, label, walls):
    """The wall that each node is glued to, -1 for none. Local.

    Args:
        x: Positions of the surface nodes at the start [m], shape (num_nodes, 3).
        label: Labels of their grains, shape (num_nodes,).
        walls: List of :class:`~mufe_fenicsx.contact.walls.Wall`.
    """
    wall_of_node = np.full(len(x), -1, dtype=np.int32)
    for w, wall in enumerate(walls):
        wall_of_node[glued_to(x, label, wall)] = w
    return wall_of_node


def glued_to(x, label, wall):
    """Whether a wall glues nodes, arguments as of :func:`find_glued`. Local."""
    if not wall.bonded:
        return np.zeros(len(x), dtype=bool)
    on = on_wall(x, wall)
    return on if wall.bonded is True else on & np.isin(label, list(wall.bonded))


def on_wall(x, wall):
    """Whether nodes at ``x`` [m] lie on the surface of a wall, to rounding. Local."""
    width = np.ptp(x, axis=0).max() if len(x) else 0.0
    return np.abs(wall.gap(x)) <= TOLERANCE * width


class Glued(Constraint):
    """The glued nodes of this rank.

    Their motion is that of the wall, in tension, compression and shear; what the
    grains exert on them goes to the wall. Their mass belongs to the wall: it is left
    out of the kinetic energy, of the damping and of the wall's force.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        walls: :class:`~mufe_fenicsx.contact.walls.Walls`.
        nodes: Mesh nodes on the surface, shape (num_surface_nodes,).

    Attributes:
        force: Of the glued nodes of this rank on each wall [N], shape (num_walls, 3); what is in
            contact with it is not in there.

    Raises:
        InputError: Fewer than three nodes on a bonded wall, or a node on two of them; on
            all ranks together.
    """

    STATE = {"sum": ("force",)}

    def __init__(self, mesh, walls, nodes):
        self.mesh, self.walls, wall_of_node = mesh, walls, walls.glued
        on = np.flatnonzero(wall_of_node >= 0)
        self.nodes, self.wall = nodes[on], wall_of_node[on]
        self.before = mesh.x[self.nodes]
        self.place = self.before - walls.point[self.wall]
        self.velocity = np.zeros_like(self.place)
        self.force = np.zeros_like(walls.force)
        glued = [wall for wall in walls.walls if wall.bonded]
        self.any = bool(glued)  #: whether any rank may have glued nodes
        label = mesh.labels[mesh.grains[mesh.grain_of_node[nodes]]]
        lying = [glued_to(mesh.x[nodes], label, wall) for wall in glued]
        count = np.array([on.sum() for on in lying] + [(np.sum(lying, axis=0) > 1).sum()])
        *counts, num_twice = mesh.comm.allreduce(count)
        for wall, number in zip(glued, counts, strict=True):
            if number < 3:
                raise InputError(
                    f"nodes on the plane of the bonded wall {wall.name} = {number}, "
                    "expected at least 3"
                )
        if num_twice:
            raise InputError(
                f"nodes glued to two bonded walls = {num_twice}, expected bonded walls that "
                "share no node"
            )

    def state_dict(self):
        """Forces on walls, and where glued nodes were, as rows of all nodes. Local."""
        if not self.any:
            return {}
        before = np.zeros((self.mesh.num_nodes, 3))
        before[self.nodes] = self.before
        return super().state_dict() | {"nodes": {"before": before}}

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told. Local."""
        kept = dict(kept)
        if "nodes" in kept:
            self.before[:] = kept.pop("nodes")["before"][self.nodes]
        super().load_state_dict(kept)

    def free_mass(self, mass):
        """Nodal masses [kg] with those of the glued nodes left out, shape (num_nodes,)."""
        free = mass.copy()
        free[self.nodes] = 0.0
        return free

    def drift(self, state, dt, damping, moves, field):
        """Carry the nodes along with their walls; their velocity is that of the step. Local."""
        if not self.nodes.size:
            return 0.0
        place_glued(
            state.x, state.u, state.v, self.velocity, self.before, self.mesh.x, self.nodes,
            self.wall, self.place, self.walls.point, self.walls.rotation, dt,
        )  # fmt: skip
        return largest_of_glued(
            moves, state.x, self.velocity, self.nodes, self.mesh.grain_of_node, field, dt
        )

    def add_forces(self, f, state, dt):
        """Pass the forces ``f`` on the nodes on to their walls: the kick passes them by. Local."""
        if self.nodes.size:
            self.force[:] = self.walls.force
            take_glued(
                f, self.walls.force, self.walls.torque, state.x, self.nodes, self.wall,
                self.walls.point,
            )  # fmt: skip
            np.subtract(self.walls.force, self.force, out=self.force)

    def kick(self, mass, dt, damping):
        """Nothing is damped; what other nodes count of it, at the velocity of the step. Local."""
        if not self.nodes.size or damping == 0.0:
            return 0.0
        scale = 1.0 / (1.0 + 0.5 * dt * damping)
        return -dt * damping * scale**2 * squares_of_glued(mass, self.velocity, self.nodes)

    def complete(self, state):
        """Velocity of the nodes in the last step. Local."""
        if self.nodes.size:
            give_rows(state.v, self.velocity, self.nodes)
