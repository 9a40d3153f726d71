"""Rigid planes: at rest, moved, turned, or pressed by a servo."""

import math
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from ..errors import InputError, finite_array, nearest_name, shown
from ..kernels.bonded import turn_rows
from ..kernels.boxes import boxes_of_groups
from ..kernels.motion import advance, work_of
from ..kernels.pairs import column, rows
from ..kernels.transfer import transfer_pairs
from ..kernels.walls import (
    COLUMNS,
    ROW,
    WallForces,
    closed_stiffness,
    farthest,
    find_wall_candidates,
    motion_to_walls,
    wall_energy,
)
from ..state import Stateful
from .bonded import find_bonded
from .laws import kinetic_of
from .mirrors import nodes_on_mirrors
from .pairs.motion_bounds import WALLS, MotionBounds

#: Part α of the force that a servo lacks which one step may change: stable below 1 at the longest
#: step that contacts allow, and below 2 at short ones (theory.servo).
SERVO_GAIN = 0.5
#: What a pair keeps when the pairs are searched anew.
REMEMBERED = ("gap", "offset", "closed", "stick_point", "shear", "slip", "normal_force", "sliding")


@dataclass
class Wall:
    """One plane. Its normal points into the sample.

    With ``target`` force F0 the wall moves along its normal at g (F0 - F), within ± ``speed``:
    fast while it is free, and at rest when F = F0. The gain g is ``speed``/F0, or the largest that
    is stable with the contacts that the wall has (``SERVO_GAIN``) where this is less.

    Nodes that lie on the plane of a ``bonded`` wall at the start are glued to it for
    good, like those of a glued platen; other nodes meet it as any wall.

    Raises:
        InputError: The normal is not of unit length, the friction negative, or the kinetic
            friction larger; a mirror that moves, presses, glues or rubs.
    """

    name: str
    point: np.ndarray  #: a point of the plane [m], shape (3,)
    normal: np.ndarray  #: unit normal, shape (3,)
    friction: float = 0.0  #: coefficient of friction [-]
    velocity: np.ndarray | None = None  #: [m/s], shape (3,); rest if None
    target: float | None = None  #: normal force to hold [N]
    speed: float = 0.0  #: largest speed of the servo [m/s]
    bonded: bool = False  #: glue the nodes that lie on the plane at the start
    friction_kinetic: float | None = None  #: coefficient while a node slips [-]; None: friction
    angular_velocity: np.ndarray | None = None  #: about ``point`` [rad/s], shape (3,)
    mirror: bool = False  #: a plane of symmetry that grains are cut by: contact.mirrors

    def __post_init__(self):
        for name in ("point", "normal", "velocity", "angular_velocity"):
            value = getattr(self, name)
            if value is not None:
                finite_array(f"{name} of wall {self.name}", value, (3,))
        length = float(np.linalg.norm(self.normal))
        if not abs(length - 1) < 1e-9:
            raise InputError(f"length of the normal of wall {self.name} = {length}, expected 1")
        kinetic_of(self.friction, self.friction_kinetic, f"of wall {self.name}")
        if self.mirror:
            for name, value in (("friction", self.friction), ("velocity", self.velocity),
                                ("angular_velocity", self.angular_velocity),
                                ("target", self.target), ("bonded", self.bonded)):  # fmt: skip
                if value is not None and np.any(value):
                    raise InputError(
                        f"{name} of the mirror {self.name} = {value}, expected none: a plane of "
                        "symmetry is smooth and at rest"
                    )

    def servo_velocity(self, normal_force, stiffness, dt):
        """Velocity [m/s] that brings ``normal_force`` [N] to the target, shape (3,).

        Args:
            normal_force: Of the grains on the wall [N].
            stiffness: Of the contacts that press on it [N/m].
            dt: Length of a step [s].
        """
        gain = self.speed / self.target
        if stiffness > 0.0:
            gain = min(gain, SERVO_GAIN / (stiffness * dt))
        v = gain * (self.target - normal_force)
        return min(max(v, -self.speed), self.speed) * self.normal


class Walls(Stateful):
    """All walls and their pairs with the nodes of this rank."""

    STATE = {
        "common": (
            "point", "normal", "velocity", "angular_velocity", "rotation", "displacement", "turn",
        ),
        "sum": ("work", "force", "torque"),
        "largest": ("radius", "box"),
    }  # fmt: skip

    def __init__(self, walls):
        self.walls = list(walls)
        for name in self.names:
            if self.names.count(name) > 1:
                raise InputError(f"name of a wall = {shown(name)}, expected one that no other has")
        self.has_servo = any(wall.target is not None for wall in self.walls)
        n = len(self.walls)
        self.point = np.array([w.point for w in self.walls], dtype=float).reshape(n, 3)
        self.normal = np.array([w.normal for w in self.walls], dtype=float).reshape(n, 3)
        self.friction = np.array([w.friction for w in self.walls], dtype=float)
        self.friction_kinetic = np.array(
            [kinetic_of(w.friction, w.friction_kinetic, f"of wall {w.name}") for w in self.walls]
        )
        self.velocity = np.zeros((n, 3))  #: of ``point`` [m/s]
        self.angular_velocity = np.zeros((n, 3))  #: about ``point`` [rad/s]
        for i, wall in enumerate(self.walls):
            if wall.velocity is not None:
                self.velocity[i] = wall.velocity
            if wall.angular_velocity is not None:
                self.angular_velocity[i] = wall.angular_velocity
        self.rotation = np.tile(np.eye(3), (n, 1, 1))  #: since the start
        self.force = np.zeros((n, 3))  #: of this rank's grains on walls [N]
        self.torque = np.zeros((n, 3))  #: of these forces about ``point`` [N m]
        self.work = 0.0  #: done by walls on this rank's grains so far [J]
        self.bonded = np.empty(0, dtype=np.int32)  #: wall that each surface node is glued to, or -1
        self.displacement = np.zeros((n, 3))  #: displacement in the last move [m]
        self.turn = np.zeros((n, 3))  #: rotation in the last move [rad]
        self.radius = np.zeros(n)  #: of this rank's surface nodes about ``point`` [m]
        self.box = np.zeros((n, 2, 3))  #: around the points near each, of all ranks [m]
        self._moves = np.zeros(n)
        self.pairs = None

    @property
    def names(self):
        """Of all walls, in their order."""
        return [wall.name for wall in self.walls]

    def number_of(self, name):
        """Place of a wall among all.

        Raises:
            InputError: There is none of that name.
        """
        if name not in self.names:
            raise InputError(f"wall = {shown(name)}, expected {nearest_name(name, self.names)}")
        return self.names.index(name)

    def move(self, dt):
        """Advance the planes by ``dt``; returns the largest distance moved [m].

        Moved is the plane, not the material in it: a turn about the normal counts nothing.
        """
        moved, turns = advance(
            self.point, self.displacement, self.velocity, self.turn, self.angular_velocity, dt
        )
        if not turns:
            return moved
        moved = np.sqrt((self.displacement**2).sum(axis=1))
        for i in np.flatnonzero(self.turn.any(axis=1)):
            turn = rotation_of(self.turn[i])
            swing = np.linalg.norm(np.cross(self.turn[i], self.normal[i]))
            moved[i] += swing * self.radius[i]
            self.rotation[i] = turn @ self.rotation[i]
            self.normal[i] = self.rotation[i] @ np.asarray(self.walls[i].normal, dtype=float)
            turn_rows(self.pairs.stick_point, self.pairs.wall, i, turn)
        return moved.max()

    def motion_in(self, field, dt):
        """How far a field brings points to the planes in the last :meth:`move`, at most. Local.

        Args:
            field: Velocity linear in the place, as in kernels.motion.
            dt: Length of that step [s].

        Returns:
            Distances [m], infinity for planes that turn, shape (num_walls,).
        """
        motion_to_walls(self._moves, field, self.normal, self.displacement, self.turn, self.box, dt)
        return self._moves

    def turn_back(self):
        """Undo what the last :meth:`move` did to the stick points of walls that turn. Local."""
        for i in np.flatnonzero(self.turn.any(axis=1)):
            turn_rows(self.pairs.stick_point, self.pairs.wall, i, rotation_of(-self.turn[i]))

    def add_work(self):
        """Add half of the work of the forces that act now along the last move."""
        self.work -= 0.5 * work_of(self.force, self.displacement, self.torque, self.turn)

    def loads(self, comm):
        """Forces on walls [N] and their torques about ``point`` [N m], (num_walls, 3). Collective.

        ``point`` moves along with the wall.
        """
        return comm.allreduce(self.force), comm.allreduce(self.torque)

    def normal_forces(self):
        """Normal forces of this rank's grains [N], compression positive, (num_walls,). Local."""
        return -np.einsum("ij,ij->i", self.force, self.normal)

    def pressing(self, comm):
        """Normal forces of the grains, compression positive, and stiffness of their contacts.

        Two arrays of shape (num_walls,) [N, N/m]. Collective.
        """
        p, local = self.pairs, np.empty((2, len(self.walls)))
        local[0] = self.normal_forces()
        closed_stiffness(local[1], p.wall, p.closed, p.stiffness)
        if comm.size > 1:
            comm.Allreduce(MPI.IN_PLACE, local)
        return local

    def adjust(self, comm, dt):
        """Set the speeds of walls with a servo for steps of length ``dt`` [s]. Collective."""
        for i, (wall, force, k) in enumerate(zip(self.walls, *self.pressing(comm), strict=True)):
            if wall.target is not None:
                self.velocity[i] = wall.servo_velocity(force, k, dt)

    def search(self, x, nodes, corner, grain_of_point, reach, bound):
        """Find the points near each wall and transfer what their pairs remember. Local.

        Args:
            x: Positions of this rank's points of contact [m], shape (num_points, 3).
            nodes: Positions of its surface nodes [m], shape (num_nodes, 3).
            corner: Nodes around each point, shape (num_points, 3); None where points are nodes.
            grain_of_point: Global grain of each, shape (num_points,).
            reach: Largest gap [m].
            bound: Of all relative motion so far [m].
        """
        if self.pairs is None:
            self.bonded = find_bonded(nodes, self.walls)
            held = self.bonded[:, None] == np.arange(len(self.walls))
            held |= nodes_on_mirrors(nodes, self.walls)
            self._held = held if corner is None else held[corner].all(axis=1)
        node, wall = find_wall_candidates(x, self._held, self.point, self.normal, reach)
        pairs = WallPairs(node, wall, grain_of_point, bound)
        if self.pairs is not None:
            source = transfer_pairs(self.pairs.node, self.pairs.wall, node, wall)
            new = np.flatnonzero(source >= 0)
            source = source[new]
            for name in REMEMBERED:
                getattr(pairs, name)[new] = getattr(self.pairs, name)[source]
            pairs.motion_bounds.transfer(self.pairs.motion_bounds)
            pairs.next_check[:] = pairs.motion_bounds.now
        self.pairs = pairs

    def enclose(self, comm, x, reach):
        """Find where points are that can come near planes until the next search. Collective.

        Args:
            comm: MPI communicator.
            x: Positions of this rank's points of contact at the last search [m], (num_points, 3).
            reach: More than points move until the next one [m].
        """
        if x.size:
            self.radius = farthest(x, self.point) + reach
        low, high = boxes_of_groups(x, self.pairs.node, self.pairs.wall, len(self.walls))
        both = np.stack([low, -high], axis=1)
        comm.Allreduce(MPI.IN_PLACE, both, op=MPI.MIN)
        both[:, 1] *= -1.0
        both += reach * np.array([[-1.0], [1.0]])
        self.box = np.where(np.isfinite(both), both, 0.0)

    def bind(self, f, x, corners, layer, points, ratio):
        """Let the kernel know the arrays of new pairs; afterwards they stay where they are. Local.

        Args:
            f, x: Forces [N] and positions [m] of points and nodes.
            corners: Nodes and weights of points in facets, kernels.points.
            layer, ratio: As of :class:`~mufe_fenicsx.kernels.walls.WallForces`.
            points: :class:`~mufe_fenicsx.contact.surface.points.Points`.
        """
        p = self.pairs
        p.forces = WallForces(
            p.state, p.next_check, p.motion_bounds.bounds, p.motion_bounds.of, p.node, p.wall,
            layer, points.area, points.recess, ratio, *corners, x, f, self.force, self.torque,
            self.point, self.normal, self.velocity, self.friction, self.friction_kinetic,
        )  # fmt: skip

    def add_forces(self, accept, ahead=0.0):
        """Add wall forces to those bound; returns the friction's dissipation [J], accepted pairs.

        Args:
            accept: Whether what overlaps now is not in contact.
            ahead: How much later than the planes the positions are [s].
        """
        self.clear()
        return self.pairs.forces(accept, ahead)

    def clear(self):
        """Forget the forces on walls. Local."""
        self.force[:] = 0.0
        self.torque[:] = 0.0

    def energy(self, layer, area, ratio):
        """Energy in the wall springs [J] and number of closed pairs. Local."""
        p = self.pairs
        return wall_energy(p.gap, p.offset, p.closed, p.shear, p.node, layer, area, ratio)


def rotation_of(turn):
    """Rotation matrix of a rotation vector [rad], by Rodrigues' formula."""
    angle = np.linalg.norm(turn)
    K = np.cross(np.eye(3), turn)
    if angle < 1e-4:  # series to rounding
        return np.eye(3) + (1 - angle**2 / 6) * K + 0.5 * (1 - angle**2 / 12) * K @ K
    return np.eye(3) + math.sin(angle) / angle * K + (1 - math.cos(angle)) / angle**2 * K @ K


class WallPairs(Stateful):
    """Node-wall pairs of one rank. Arrays as in kernels.walls."""

    STATE = {"here": ("next_check", "state", "bounds")}
    #: What a checkpoint keeps of each pair.
    KEPT = ("next_check", *REMEMBERED, "work")

    def __init__(self, node, wall, grain_of_point, bound):
        n = node.size
        self.node, self.wall = node, wall
        walls = WALLS + wall.astype(np.int64)
        self.motion_bounds = MotionBounds(grain_of_point[node], walls, bound)
        self.next_check = np.full(n, bound)
        self.state = rows(n, ROW)
        for name in (*REMEMBERED, "work", "stiffness"):
            setattr(self, name, column(self.state, name, COLUMNS))
        self.gap[:] = np.inf
        self.forces = None  #: kernels.walls.WallForces, once they are wanted

    @property
    def bounds(self):
        """Of motion relative to walls, of each grain and wall [m]."""
        return self.motion_bounds.bounds
