"""Rigid planes: at rest, moved, or pressed by a servo."""

from dataclasses import dataclass

import numpy as np

from ..kernels.walls import add_wall_forces, add_wall_stiffness, find_wall_candidates, wall_energy


@dataclass
class Wall:
    """One plane. Its normal points into the sample.

    With ``target`` force F0 the wall moves along its normal at ``speed`` (1 - F/F0),
    within ± ``speed``: fast while it is free, and at rest when F = F0.
    """

    name: str
    point: np.ndarray  #: a point of the plane [m], shape (3,)
    normal: np.ndarray  #: unit normal, shape (3,)
    friction: float = 0.0  #: coefficient of friction [-]
    velocity: np.ndarray | None = None  #: [m/s], shape (3,); rest if None
    target: float | None = None  #: normal force to hold [N]
    speed: float = 0.0  #: largest speed of the servo [m/s]

    def servo_velocity(self, normal_force):
        """Velocity [m/s] that brings ``normal_force`` [N] to the target, shape (3,)."""
        return self.speed * np.clip(1 - normal_force / self.target, -1, 1) * self.normal


class Walls:
    """All walls and their pairs with the nodes of this rank."""

    def __init__(self, walls):
        self.walls = list(walls)
        self.names = [wall.name for wall in self.walls]
        n = len(self.walls)
        self.point = np.array([w.point for w in self.walls], dtype=float).reshape(n, 3)
        self.normal = np.array([w.normal for w in self.walls], dtype=float).reshape(n, 3)
        self.friction = np.array([w.friction for w in self.walls], dtype=float)
        self.velocity = np.zeros((n, 3))
        for i, wall in enumerate(self.walls):
            if wall.velocity is not None:
                self.velocity[i] = wall.velocity
        self.force = np.zeros((n, 3))  #: of this rank's grains on walls [N]
        self.work = 0.0  #: done by walls on this rank's grains so far [J]
        self._push = np.zeros((n, 3))
        self.pairs = None

    @property
    def has_servo(self):
        return any(wall.target is not None for wall in self.walls)

    def move(self, dt):
        """Advance the planes by ``dt``; returns the largest distance moved [m]."""
        self._push[:] = self.velocity
        self._push *= dt
        self.point += self._push
        return np.sqrt(max((self._push**2).sum(axis=1), default=0.0))

    def add_work(self):
        """Add half of the last move times the force that acts now on the grains."""
        self.work -= 0.5 * np.vdot(self._push, self.force)

    def adjust(self, normal_force):
        """Set the velocities of servo-controlled walls, from forces over all ranks [N]."""
        for i, wall in enumerate(self.walls):
            if wall.target is not None:
                self.velocity[i] = wall.servo_velocity(normal_force[i])

    def search(self, x, num_own, reach, clock):
        """Find the nodes near each wall and carry over what their pairs remember. Local."""
        node, wall = find_wall_candidates(x, num_own, self.point, self.normal, reach)
        pairs = _WallPairs(node, wall, clock)
        if self.pairs is not None:
            n = len(self.walls)
            old = self.pairs.node.astype(np.int64) * n + self.pairs.wall
            _, at_old, at_new = np.intersect1d(
                old, node.astype(np.int64) * n + wall, return_indices=True
            )
            for name in ("gap", "offset", "closed", "anchor", "shear", "slip", "push"):
                getattr(pairs, name)[at_new] = getattr(self.pairs, name)[at_old]
        self.pairs = pairs

    def add_forces(self, f, x, clock, layer, area, ratio, adopt):
        """Add wall forces to ``f``; returns the friction's dissipation [J] and adopted pairs."""
        self.force[:] = 0.0
        p = self.pairs
        return add_wall_forces(
            f, self.force, p.due, p.gap, p.offset, p.closed, p.anchor, p.shear, p.slip, p.push,
            p.work, clock, x, p.node, p.wall, self.point, self.normal, layer, area, ratio,
            self.friction, adopt,
        )  # fmt: skip

    def add_stiffness(self, y, q, margin, clock, layer, area, ratio):
        """Add the wall springs times ``q`` to ``y``. Local."""
        p = self.pairs
        add_wall_stiffness(
            y, q, margin, p.due, clock, p.node, p.wall, p.closed, self.normal, layer, area, ratio
        )

    def energy(self, layer, area, ratio):
        """Energy in the wall springs [J] and number of closed pairs. Local."""
        p = self.pairs
        return wall_energy(p.gap, p.offset, p.closed, p.shear, p.node, layer, area, ratio)


class _WallPairs:
    def __init__(self, node, wall, clock):
        n = node.size
        self.node, self.wall = node, wall
        self.due = np.full(n, clock)
        self.gap = np.full(n, np.inf)
        self.offset = np.zeros(n)
        self.closed = np.zeros(n, dtype=bool)
        self.anchor = np.zeros((n, 3))
        self.shear = np.zeros((n, 3))
        self.slip = np.zeros(n)
        self.push = np.zeros(n)
        self.work = np.zeros(n)
