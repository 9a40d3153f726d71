"""Contacts of the grains with each other and with walls, and what they remember."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...kernels.packing import packed_spheres, packed_surfaces
from .container import PERIODIC

#: Tangential over normal stiffness: a sphere then turns as fast as it is pushed.
RATIO = 2 / 7
#: Part of critical damping of the dashpot of a pair, which leaves 0.42 of its speed.
DAMPING = 0.33
#: Pairs nearer than this part of the mean diameter are kept in the list.
SKIN = 0.15


@dataclass
class Sums:
    """Of one step."""

    num_pairs: int = 0  #: that touch
    depth: float = 0.0  #: mean of the largest depth of each pair that touches
    deepest: float = 0.0


def near_pairs(centre, reach, skin, cell=None):
    """Bodies of which the spheres around are nearer than ``skin``, in order, (num_pairs, 2).

    Args:
        centre: Shape (n, 3).
        reach: Radii of the spheres, shape (n,).
        skin: Distance.
        cell: Edges of a periodic cell with its corner at zero, shape (3,), or None.
    """
    tree = cKDTree(centre, boxsize=cell)
    found = tree.query_pairs(2 * reach.max() + skin, output_type="ndarray").astype(np.int64)
    found.sort(axis=1)
    apart = centre[found[:, 0]] - centre[found[:, 1]]
    if cell is not None:
        apart -= cell * np.round(apart / cell)
    found = found[np.linalg.norm(apart, axis=1) < reach[found].sum(axis=1) + skin]
    return np.ascontiguousarray(found[np.lexsort(found.T[::-1])])


class Contacts:
    """Pairs of spheres, or of bodies of any shape, with their slips.

    Args:
        bodies: `bodies.Bodies`.
        container: `container.Container`.
    """

    def __init__(self, bodies, container):
        n, num_walls = bodies.num_bodies, len(container.names)
        self.bodies, self.container = bodies, container
        self.stress, self.stiff = np.zeros((3, 3)), np.zeros(n)
        self.wall_push = np.zeros((n, num_walls))
        self.sums = Sums()
        self.pairs, self.push = np.zeros((0, 2), dtype=np.int64), np.zeros(0)
        self._normals = np.zeros((0, 3))
        if bodies.shapes.spheres:
            self._slip, self._wall_slip = np.zeros((0, 3)), np.zeros((n, num_walls, 3))
        else:
            self._row = np.cumsum(np.append(0, np.diff(bodies.shapes.first)[bodies.shape]))
            self._slip = np.zeros((self._row[-1], 3))
            self._partner = np.full(self._row[-1], packed_surfaces.FREE, dtype=np.int64)
            self._seen = np.zeros(self._row[-1], dtype=bool)
        self.list_pairs()

    def list_pairs(self):
        """List the pairs that may touch soon."""
        bodies, container = self.bodies, self.container
        centre, reach = bodies.centre, bodies.reach
        if container.kind == PERIODIC:
            edge = container.edge
            centre -= edge * np.floor((centre - container.low) / edge)
            found = near_pairs((centre - container.low) % edge, reach, SKIN, edge)
        else:
            found = near_pairs(centre, reach, SKIN)
        if bodies.shapes.spheres:
            slip = np.zeros((len(found), 3))
            n = bodies.num_bodies
            old, new = self.pairs @ (n, 1), found @ (n, 1)
            _, from_old, to_new = np.intersect1d(old, new, True, return_indices=True)
            slip[to_new] = self._slip[from_old]
            self._slip = slip
        self.pairs, self.push = found, np.zeros(len(found))
        self._normals = np.zeros((len(found), 3))
        self._at, self._strain, self._moved = centre.copy(), 0.0, 0.0

    def follow(self, strain, moved):
        """Take a shrinking and a step into account; list pairs anew where it is time.

        Args:
            strain: Part by which the edges of the container shrank, shape (3,), or None.
            moved: Bound of how far a body went, apart from that.
        """
        if strain is not None:
            self._at += (self.container.middle - self._at) * strain
            self._strain += float(np.abs(strain).max())
        self._moved += moved
        room = 0.5 * SKIN - self._strain * self.bodies.reach.max()
        if self._moved < room:
            return
        # The sum of bounds is reached; what counts is how far bodies are from where they were.
        away = np.sqrt(((self.bodies.centre - self._at) ** 2).sum(axis=1).max())
        if away < 0.9 * room:
            self._moved = float(away)
        else:
            self.list_pairs()

    def add_loads(self, friction, wall_friction, dashpots, dt):
        """Add forces and torques of all contacts to those of the bodies, in place."""
        self.stress[:], self.stiff[:] = 0.0, 0.0
        time = 2 * DAMPING if dashpots else 0.0
        law = RATIO, float(friction), time
        wall_law = RATIO, float(wall_friction), time
        add = self._add_spheres if self.bodies.shapes.spheres else self._add_surfaces
        touching, depths, deepest = add(law, wall_law, dt)
        self.sums = Sums(touching, depths / max(touching, 1), deepest)

    def _add_spheres(self, law, wall_law, dt):
        b, c = self.bodies, self.container
        loads = b.force, b.torque, self.stress, self.stiff
        touching, depths, deepest = packed_spheres.add_sphere_pairs(
            *loads, self._slip, self.push, self.pairs, b.centre, b.velocity, b.spin, b.size, b.mass,
            law, c.edge, dt,
        )  # fmt: skip
        _, at_walls = packed_spheres.add_sphere_walls(
            *loads, self._wall_slip, self.wall_push, c.point, c.normal, c.radius, b.centre,
            b.velocity, b.spin, b.size, b.mass, wall_law, dt,
        )  # fmt: skip
        return touching, depths, max(deepest, at_walls)

    def _add_surfaces(self, law, wall_law, dt):
        b, c, s = self.bodies, self.container, self.bodies.shapes
        loads = b.force, b.torque, self.stress, self.stiff, self._slip, self._partner, self._seen
        motion = b.centre, b.velocity, b.spin, b.axes, b.size, b.reach, b.mass, b.least, b.shape
        points = self._row, s.place, s.weight, s.first
        touching, depths, deepest = packed_surfaces.add_surface_pairs(
            *loads, self.push, self._normals, self.pairs, *motion, *points, s.grid, s.low, s.step,
            law, c.edge, dt,
        )  # fmt: skip
        at_walls = packed_surfaces.add_surface_walls(
            *loads, self.wall_push, c.point, c.normal, c.radius, *motion, *points, wall_law, dt
        )
        packed_surfaces.forget_open(self._slip, self._partner, self._seen)
        return touching, depths, max(deepest, at_walls)

    @property
    def num_closed(self):
        """Contacts that are closed, with grains and walls."""
        return self.sums.num_pairs + np.count_nonzero(self.wall_push)

    def touching(self):
        """Pairs that push each other, and their unit normals towards the first body."""
        closed = self.push > 0
        pairs = self.pairs[closed]
        normal = self._normals[closed]
        if self.bodies.shapes.spheres:
            normal = self.bodies.centre[pairs[:, 0]] - self.bodies.centre[pairs[:, 1]]
            if self.container.kind == PERIODIC:
                normal -= self.container.edge * np.round(normal / self.container.edge)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        return pairs, normal / np.maximum(length, 1e-300)
