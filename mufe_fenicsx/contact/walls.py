"""Rigid planes, cylinders and spheres: at rest, moved, turned, or pressed by a servo."""

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from ..arguments import check_fields, finite_number
from ..errors import InputError, finite_array, nearest_name, shortened, shown
from ..kernels.bulk.glued import turn_rows
from ..kernels.bulk.motion import advance, work_of
from ..kernels.contact.transfer import transfer_pairs
from ..kernels.contact.walls import (
    WallForces,
    closed_stiffness,
    find_wall_candidates,
    gaps_to_walls,
)
from ..state import Stateful
from .curved_walls import CurvedWalls
from .glued import find_glued
from .laws import edge_of_area, kinetic_of
from .mirrors import nodes_on_mirrors
from .near_walls import NearWalls
from .pairs.wall_pairs import WallPairs
from .surface.bulges import against_walls, bend_at_walls

#: Part α of the force that a servo lacks which one step may change: stable below 1 at the longest
#: step that contacts allow, and below 2 at short ones (theory.servo).
SERVO_GAIN = 0.5


@dataclass
class Wall:
    """One plane, whose normal points into the sample; with a ``radius`` a cylinder or a sphere.

    Of a cylinder ``point`` and ``normal`` are a point of its axis and the axis, of a sphere its
    middle and zero. Grains are inside where the radius is positive, outside where it is negative.

    With ``target`` force F0 the wall moves along its normal at g (F0 - F), within ± ``speed``:
    fast while it is free, and at rest when F = F0. The gain g is ``speed``/F0, or the largest that
    is stable with the contacts that the wall has (``SERVO_GAIN``) where this is less. A curved wall
    grows or shrinks instead, and F is the sum of the normal forces on it.

    Nodes that lie on the surface of a ``bonded`` wall at the start are glued to it for
    good, like those of a glued platen: those of all grains, or of the grains whose labels
    ``bonded`` lists. Other nodes meet it as any wall.

    Raises:
        InputError: The normal is not of unit length, the friction negative, or the kinetic
            friction larger; a mirror that moves, presses, glues, rubs or is curved; a glued wall
            that grows.
    """

    name: str
    point: np.ndarray  #: a point of the plane or axis [m], shape (3,)
    normal: np.ndarray  #: unit normal or axis, shape (3,)
    friction: float = 0.0  #: coefficient of friction [-]
    velocity: np.ndarray | None = None  #: [m/s], shape (3,); rest if None
    target: float | None = None  #: normal force to hold [N]
    speed: float = 0.0  #: largest speed of the servo [m/s]
    bonded: bool | Collection[int] = False  #: glue nodes on the plane at the start; or labels
    friction_kinetic: float | None = None  #: coefficient while a node slips [-]; None: friction
    angular_velocity: np.ndarray | None = None  #: about ``point`` [rad/s], shape (3,)
    mirror: bool = False  #: a plane of symmetry that grains are cut by: contact.mirrors
    radius: float = 0.0  #: of a cylinder or sphere [m], negative with the grains outside; 0: plane
    growth_rate: float = 0.0  #: of the distance between a curved wall and its axis [m/s]

    def __post_init__(self):
        check_fields(self, f" of wall {shortened(self.name)}")
        for name in ("point", "normal", "velocity", "angular_velocity"):
            value = getattr(self, name)
            if value is not None or name in ("point", "normal"):
                setattr(self, name, finite_array(f"{name} of wall {self.name}", value, (3,)))
        length = float(np.linalg.norm(self.normal))
        if not abs(length - 1) < 1e-9 and not (self.radius and length == 0.0):
            raise InputError(f"length of the normal of wall {self.name} = {length}, expected 1")
        if self.growth_rate and (self.bonded or not self.radius):
            raise InputError(
                f"growth_rate of wall {self.name} = {self.growth_rate}, expected none of a plane "
                "or a glued wall"
            )
        if self.target is not None:
            finite_number(f"target of wall {self.name}", self.target, gt=0, unit="N")
            if self.speed <= 0.0:
                raise InputError(
                    f"speed of wall {self.name} = {self.speed}, expected > 0 m/s where it holds a "
                    "force"
                )
        kinetic_of(self.friction, self.friction_kinetic, f"of wall {self.name}")
        if self.mirror:
            for name, value in (("friction", self.friction), ("velocity", self.velocity),
                                ("angular_velocity", self.angular_velocity),
                                ("target", self.target), ("bonded", self.bonded),
                                ("radius", self.radius)):  # fmt: skip
                if value is not None and np.any(value):
                    raise InputError(
                        f"{name} of the mirror {self.name} = {value}, expected none: a plane of "
                        "symmetry is smooth and at rest"
                    )

    def gap(self, x):
        """Gaps of places to the wall at the start [m], shape (num,); ``x`` has (num, 3)."""
        gap, normal = np.empty(len(x)), np.empty((len(x), 3))
        own = [np.array([value], dtype=float) for value in (self.point, self.normal, self.radius)]
        gaps_to_walls(gap, normal, x, np.zeros(len(x), np.int32), *own)
        return gap

    def servo_speed(self, normal_force, stiffness, dt):
        """Speed along the normal [m/s] that brings ``normal_force`` [N] to the target.

        Args:
            normal_force: Of the grains on the wall [N].
            stiffness: Of the contacts that press on it [N/m].
            dt: Length of a step [s].
        """
        gain = self.speed / self.target
        if stiffness > 0.0:
            gain = min(gain, SERVO_GAIN / (stiffness * dt))
        v = gain * (self.target - normal_force)
        return min(max(v, -self.speed), self.speed)


class Walls(Stateful):
    """All walls and their pairs with the nodes of this rank."""

    STATE = {
        "common": (
            "point", "normal", "velocity", "angular_velocity", "rotation", "displacement", "turn",
        ),
        "sum": ("work", "force", "torque"),
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
        self.glued = np.empty(0, dtype=np.int32)  #: wall that each surface node is glued to, or -1
        self.displacement = np.zeros((n, 3))  #: displacement in the last move [m]
        self.turn = np.zeros((n, 3))  #: rotation in the last move [rad]
        self.curved, self.near = CurvedWalls(self.walls), NearWalls(n)
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
        """Advance the walls by ``dt``; returns the largest distance moved [m].

        Moved is the surface, not the material in it: a turn about the normal counts nothing.
        """
        moved, turns = advance(
            self.point, self.displacement, self.velocity, self.turn, self.angular_velocity, dt
        )
        if self.curved.any:
            moved += self.curved.move(dt)
        if not turns:
            return moved
        moved = np.sqrt((self.displacement**2).sum(axis=1)) + np.abs(self.curved.growth)
        for i in np.flatnonzero(self.turn.any(axis=1)):
            turn = rotation_of(self.turn[i])
            swing = np.linalg.norm(np.cross(self.turn[i], self.normal[i]))
            moved[i] += swing * self.near.farthest[i]
            self.rotation[i] = turn @ self.rotation[i]
            self.normal[i] = self.rotation[i] @ np.asarray(self.walls[i].normal, dtype=float)
            turn_rows(self.pairs.stick_point, self.pairs.wall, i, turn)
        return moved.max()

    def speed_square(self):
        """The speeds of all walls and their growth, squared and added up [m²/s²]. Local."""
        return (self.velocity**2).sum() + (self.curved.growth_rate**2).sum()

    def gaps(self, x, wall):
        """Gaps of places to walls [m], shape (num,), and the walls' normals there, (num, 3). Local.

        Args:
            x: Places [m], shape (num, 3).
            wall: Number of a wall for each, int32, shape (num,).
        """
        gap, normal = np.empty(len(x)), np.empty((len(x), 3))
        gaps_to_walls(gap, normal, x, wall, self.point, self.normal, self.curved.radius)
        return gap, normal

    def gaps_of_pairs(self, x):
        """Gaps of all pairs where points of contact are at ``x``, (num_points, 3) [m]. Local."""
        p = self.pairs
        return self.gaps(x[p.node], p.wall)[0] + p.recess

    def turn_back(self):
        """Undo what the last :meth:`move` did to the stick points of walls that turn. Local."""
        for i in np.flatnonzero(self.turn.any(axis=1)):
            turn_rows(self.pairs.stick_point, self.pairs.wall, i, rotation_of(-self.turn[i]))

    def add_work(self):
        """Add half of the work of the forces that act now along the last move."""
        self.work -= 0.5 * work_of(self.force, self.displacement, self.torque, self.turn)
        if self.curved.any:
            self.work += self.curved.half_work()

    def loads(self, comm):
        """Forces on walls [N] and their torques about ``point`` [N m], (num_walls, 3). Collective.

        ``point`` moves along with the wall.
        """
        return comm.allreduce(self.force), comm.allreduce(self.torque)

    def normal_forces(self):
        """Normal forces of this rank's grains [N], compression positive, (num_walls,). Local.

        On a curved wall their sum.
        """
        on_planes = -np.einsum("ij,ij->i", self.force, self.normal)
        return np.where(self.curved.side == 0.0, on_planes, self.curved.pressing)

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
                self.set_speed(i, wall.servo_speed(force, k, dt))

    def set_speed(self, i, speed):
        """Let wall number ``i`` come towards the sample at ``speed`` [m/s]. Local."""
        if self.curved.side[i]:
            self.curved.growth_rate[i] = -self.curved.side[i] * speed
        else:
            self.velocity[i] = speed * self.normal[i]

    def set_speeds(self, speeds):
        """Let all walls come towards the sample at ``speeds`` [m/s], shape (num_walls,). Local."""
        for i, speed in enumerate(speeds):
            self.set_speed(i, speed)

    def begin(self, x, label, points, tools=None):
        """Find what walls hold and what lies on them at the start. Local.

        Args:
            x: Reference positions of this rank's surface nodes [m], shape (num_nodes, 3).
            label: Labels of their grains, shape (num_nodes,).
            points: :class:`~mufe_fenicsx.contact.surface.points.Points`.
            tools: Which nodes and which points are of tools, which pass through walls; None: none.
        """
        self.glued = find_glued(x, label, self.walls)
        if tools is not None:
            self.glued[tools[0]] = -1
        held = self.glued[:, None] == np.arange(len(self.walls))
        held |= nodes_on_mirrors(x, self.walls)
        self._held = held[points.corner].all(axis=1)
        if tools is not None:
            self._held[tools[1]] = True
        if self.curved.any:
            places = points.places(x, np.arange(points.num_points))
            self.curved.measure_sag(self.walls, places, x, points.corner)

    def search(self, x, points, reach, bound, yields):
        """Find the points near each wall and transfer what their pairs remember. Local.

        Args:
            x: Positions of this rank's points of contact [m], shape (num_points, 3).
            points: :class:`~mufe_fenicsx.contact.surface.points.Points`.
            reach: Largest gap [m].
            bound: Of all relative motion so far [m].
            yields: Whether some body of all ranks can yield.
        """
        node, wall = find_wall_candidates(
            x, self._held, self.point, self.normal, self.curved.radius, reach
        )
        pairs = WallPairs(node, wall, points, bound, yields)
        sag = self.curved.sag_of(node, wall)
        if sag is not None:
            pairs.recess[:] = np.where(np.isfinite(sag), -sag, pairs.recess)
        if self.pairs is not None:
            source = transfer_pairs(self.pairs.node, self.pairs.wall, node, wall)
            new = np.flatnonzero(source >= 0)
            pairs.take_rows(new, self.pairs, source[new])
            pairs.motion_bounds.transfer(self.pairs.motion_bounds)
            pairs.next_check[:] = pairs.motion_bounds.now
        self.pairs = pairs

    def bind(self, points, ghosts, layers, work):
        """Let the kernel know the arrays of new pairs; afterwards they stay where they are. Local.

        Args:
            points, ghosts, layers, work: As of kernels.contact.pairs.PairForces.
        """
        p = self.pairs
        curvature, bend = points.curvature[p.node], self.curved.bend[p.wall]
        cylinder = self.normal[p.wall].any(axis=1)
        p.softer[:] = against_walls(curvature, points.facet_area[p.node], bend, cylinder)
        if p.yields:
            p.name_dents(layers.strengths, points)
            p.bend[:] = bend_at_walls(curvature, bend, cylinder)
            p.edge[:] = edge_of_area(points.facet_area[p.node], 1)
            p.layers[:] = points.layer[p.node]
            p.reference[:] = np.where(points.is_vertex(p.node), 0.0, points.facet_area[p.node])
        p.forces = WallForces(p, self, points, ghosts, layers, work)

    def add_forces(self, accept, ahead=0.0):
        """Add wall forces to those bound.

        Returns:
            Friction's dissipation [J], accepted pairs.

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
        self.curved.pressing[:] = 0.0


def rotation_of(turn):
    """Rotation matrix of a rotation vector [rad], by Rodrigues' formula."""
    x, y, z = map(float, turn)
    angle = math.sqrt(x * x + y * y + z * z)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-4:  # series to rounding
        return np.eye(3) + (1 - angle**2 / 6) * K + 0.5 * (1 - angle**2 / 12) * K @ K
    return np.eye(3) + math.sin(angle) / angle * K + (1 - math.cos(angle)) / angle**2 * K @ K
