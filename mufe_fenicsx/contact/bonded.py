"""Nodes that are glued to a wall: an exact constraint on their motion, without any spring."""

import numpy as np

from ..errors import InputError
from ..kernels.bulk.bonded import (
    give_rows,
    largest_of_bonded,
    place_bonded,
    squares_of_bonded,
    take_bonded,
)
from ..state import ForceTerm

#: A node lies on a plane within this part of the width of a rank's grains.
TOLERANCE = 1e-9


def find_bonded(x, label, walls):
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
    """Whether a wall glues nodes, arguments as of :func:`find_bonded`. Local."""
    if not wall.bonded:
        return np.zeros(len(x), dtype=bool)
    on = on_wall(x, wall)
    return on if wall.bonded is True else on & np.isin(label, list(wall.bonded))


def on_wall(x, wall):
    """Whether nodes at ``x`` [m] lie on the surface of a wall, to rounding. Local."""
    width = np.ptp(x, axis=0).max() if len(x) else 0.0
    return np.abs(wall.gap(x)) <= TOLERANCE * width


class Bonded(ForceTerm):
    """The glued nodes of this rank.

    Their motion is that of the wall, in tension, compression and shear; what the
    grains exert on them goes to the wall. Their mass belongs to the wall: it is left
    out of the kinetic energy, of the damping and of the wall's force.

    Args:
        comm: MPI communicator.
        walls: :class:`~mufe_fenicsx.contact.walls.Walls`.
        nodes: Mesh nodes on the surface, shape (num_surface_nodes,).
        label: Labels of their grains, shape (num_surface_nodes,).
        x: Reference positions of the mesh nodes [m], shape (num_nodes, 3).

    Attributes:
        force: Of the glued nodes of this rank on each wall [N], shape (num_walls, 3); what is in
            contact with it is not in there.

    Raises:
        InputError: Fewer than three nodes on a bonded wall, or a node on two of them; on
            all ranks together.
    """

    STATE = {"sum": ("force",)}

    def __init__(self, comm, walls, nodes, label, x):
        self.walls, wall_of_node = walls, walls.bonded
        on = np.flatnonzero(wall_of_node >= 0)
        self.nodes, self.wall = nodes[on], wall_of_node[on]
        self.place = x[self.nodes] - walls.point[self.wall]
        self.before, self._num_nodes = x[self.nodes].copy(), len(x)
        self.velocity = np.zeros_like(self.place)
        self.force = np.zeros_like(walls.force)
        glued = [wall for wall in walls.walls if wall.bonded]
        self.any = bool(glued)  #: whether any rank may have glued nodes
        lying = [glued_to(x[nodes], label, wall) for wall in glued]
        count = np.array([on.sum() for on in lying] + [(np.sum(lying, axis=0) > 1).sum()])
        *counts, num_twice = comm.allreduce(count)
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
        before = np.zeros((self._num_nodes, 3))
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

    def move(self, x, u, v, x0, dt):
        """Positions, displacements and mid-step velocities of glued nodes after the walls moved.

        Arrays as in :class:`~mufe_fenicsx.state.State`; ``x0`` are the reference positions.
        """
        if self.nodes.size == 0:
            return
        place_bonded(
            x, u, v, self.velocity, self.before, x0, self.nodes, self.wall, self.place,
            self.walls.point, self.walls.rotation, dt,
        )  # fmt: skip

    def add_forces(self, f, state, dt):
        """Pass the forces ``f`` on glued nodes on to their walls. Local.

        Force and velocity of these nodes are zero afterwards, so that kick and damping
        pass them by; :meth:`give_velocity` brings the velocity back.
        """
        if self.nodes.size:
            self.force[:] = self.walls.force
            take_bonded(
                f, state.v, self.walls.force, self.walls.torque, state.x, self.nodes, self.wall,
                self.walls.point,
            )  # fmt: skip
            np.subtract(self.walls.force, self.force, out=self.force)

    def give_velocity(self, v):
        """Velocity of the glued nodes in the last step, into ``v``. Local."""
        if self.nodes.size:
            give_rows(v, self.velocity, self.nodes)

    def take_velocity(self, v):
        """None of the glued nodes, in ``v``: kick and damping pass them by. Local."""
        if self.nodes.size:
            v[self.nodes] = 0.0

    def damped(self, mass, dt, damping):
        """What damping would take of the glued nodes, at their velocity, in a step [J]. Local."""
        if not self.nodes.size or damping == 0.0:
            return 0.0
        scale = 1.0 / (1.0 + 0.5 * dt * damping)
        return dt * damping * scale**2 * squares_of_bonded(mass, self.velocity, self.nodes)

    def largest_motion(self, moves, x, grain_of_node, field, dt):
        """Largest motion of a glued node in the step to ``x`` [m]. Local.

        That of each grain beside a field goes into ``moves``; arguments as of kernels.bulk.motion.
        """
        if not self.nodes.size:
            return 0.0
        return largest_of_bonded(moves, x, self.velocity, self.nodes, grain_of_node, field, dt)
