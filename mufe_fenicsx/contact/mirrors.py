"""Mirror walls: planes of symmetry that grains are cut by, of which one side is modelled.

Nodes that lie on a mirror at the start stay on it, pushed or pulled, and move freely along it. What
holds them is the force of the other half. Where the grains of this half come up to the plane
elsewhere they meet their own images: each has half of the gap and one of two like layers, so that
they press as on a smooth wall, and as such other nodes meet the mirror.

The faces in which grains are cut are no surface: they carry no contact, and areas, layers and
sharp vertices around them are those of the whole body. Where two mirrors meet in a grain they stand
at right angles. Crossings of sharp edges that end on a mirror have the area of the half alone.
"""

import numpy as np
from mpi4py import MPI

from ..errors import InputError
from ..kernels.bulk.glued import take_normal
from ..state import Constraint
from .glued import on_wall


def nodes_on_mirrors(x, walls):
    """Which nodes lie on which mirror. Local.

    Args:
        x: Positions of nodes at the start [m], shape (num_nodes, 3).
        walls: List of :class:`~mufe_fenicsx.contact.walls.Wall`.

    Returns:
        Shape (num_nodes, num_walls), False for walls that are no mirrors.
    """
    found = np.zeros((len(x), len(walls)), dtype=bool)
    for w, wall in enumerate(walls):
        if wall.mirror:
            found[:, w] = on_wall(x, wall)
    return found


def check_mirrors(comm, walls, x):
    """Grains are cut by each mirror, and by two of them at right angles. Collective.

    Args:
        comm: MPI communicator.
        walls: List of :class:`~mufe_fenicsx.contact.walls.Wall`.
        x: Positions of this rank's nodes at the start [m], shape (num_nodes, 3).

    Raises:
        InputError: Fewer than three nodes on a mirror, or a node on two that are not at right
            angles; on all ranks together.
    """
    mirrors = [w for w, wall in enumerate(walls) if wall.mirror]
    on = nodes_on_mirrors(x, walls)
    common = comm.allreduce(on.T.astype(np.int64) @ on.astype(np.int64), op=MPI.SUM)
    for w in mirrors:
        if common[w, w] < 3:
            raise InputError(
                f"nodes on the mirror {walls[w].name} = {common[w, w]}, expected at least 3: "
                "grains that are cut by its plane"
            )
        for v in mirrors[: mirrors.index(w)]:
            slant = abs(float(np.dot(walls[v].normal, walls[w].normal)))
            if common[v, w] and slant > 1e-9:
                raise InputError(
                    f"mirrors {walls[v].name} and {walls[w].name} meet at "
                    f"{np.degrees(np.arccos(min(slant, 1.0))):.4g} degrees, expected right angles"
                )


class Mirrors(Constraint):
    """The nodes of this rank that lie on mirrors. Collective when made.

    Glued nodes are left to the wall that they are glued to.

    Args:
        comm: MPI communicator.
        walls: :class:`~mufe_fenicsx.contact.walls.Walls`.
        x: Reference positions of the mesh nodes [m], shape (num_nodes, 3).
        glued: Mesh nodes that are glued to a wall.
        rigid: Mesh nodes of grains that do not deform.
        kinematic: Whether the normal law of contact is the kinematic one.

    Raises:
        InputError: As of :func:`check_mirrors`; rigid grains on a mirror; the kinematic law.
    """

    def __init__(self, comm, walls, x, glued, rigid, kinematic):
        self.walls = walls
        self.any = any(wall.mirror for wall in walls.walls)
        self.node = self.wall = np.empty(0, dtype=np.int32)
        if not self.any:
            return
        if kinematic:
            raise InputError('normal law of contact = kinematic, expected "matched" with a mirror')
        check_mirrors(comm, walls.walls, x)
        on = nodes_on_mirrors(x, walls.walls)
        num_rigid = comm.allreduce(int(on[rigid].any(axis=1).sum()))
        if num_rigid:
            raise InputError(
                f"nodes of rigid grains on mirrors = {num_rigid}, expected none: deformable grains"
            )
        on[glued] = False
        # Wall after wall: where two hold a node, one after the other takes its part.
        wall, node = np.nonzero(on.T)
        self.node, self.wall = node.astype(np.int32), wall.astype(np.int32)

    def held(self):
        """Pairs (nodes, unit normal) of what may not move, for each mirror."""
        return [
            (self.node[self.wall == w], self.walls.normal[w].copy()) for w in np.unique(self.wall)
        ]

    def project(self, values):
        """Take the parts along the normals away from nodal vectors, (num_nodes, 3), in place."""
        if self.node.size:
            away = np.zeros_like(self.walls.force)
            take_normal(
                values, away, away, values, self.node, self.wall, self.walls.point,
                self.walls.normal,
            )  # fmt: skip

    def add_forces(self, f, state, dt):
        """Pass what the forces ``f`` on held nodes have along the normals on to their mirrors.

        Velocities that start along the mirror stay there: masses and time step do not change.

        Args:
            f: Forces on nodes [N], shape (num_nodes, 3), changed in place.
            state: :class:`~mufe_fenicsx.state.State`.
            dt: Not used.

        Raises:
            InputError: A mirror is made to move.
        """
        if not self.any:
            return
        walls = self.walls
        for w, wall in enumerate(walls.walls):
            if wall.mirror and (walls.velocity[w].any() or walls.angular_velocity[w].any()):
                raise InputError(
                    f"velocity of the mirror {wall.name} = {walls.velocity[w].tolist()} m/s, "
                    "expected a mirror at rest"
                )
        take_normal(
            f, walls.force, walls.torque, state.x, self.node, self.wall, walls.point, walls.normal
        )
