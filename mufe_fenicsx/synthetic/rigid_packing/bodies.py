"""Rigid grains that move: places, velocities and inertia, in mean diameters."""

from dataclasses import dataclass

import numpy as np

from ...kernels.bulk import rigid


@dataclass
class Bodies:
    """Arrays of n bodies of unit density, as of kernels.packing.packing and kernels.bulk.rigid."""

    shapes: object  #: `shapes.Shapes`
    shape: np.ndarray  #: number of the shape of each
    size: np.ndarray  #: diameter of the sphere of equal volume
    centre: np.ndarray
    turn: np.ndarray  #: unit quaternions, shape (n, 4)
    axes: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray  #: principal moments, shape (n, 3)
    least: np.ndarray  #: smallest of them
    reach: np.ndarray
    velocity: np.ndarray
    momentum: np.ndarray  #: angular
    spin: np.ndarray
    force: np.ndarray
    torque: np.ndarray

    @property
    def num_bodies(self):
        """How many there are."""
        return len(self.size)

    @property
    def solid(self):
        """Volume of all."""
        return float(np.pi / 6 * (self.size**3).sum())

    @property
    def kinetic_energy(self):
        """Of all."""
        moving = 0.5 * self.mass @ (self.velocity**2).sum(axis=1)
        return float(moving + 0.5 * (self.spin * self.momentum).sum())


def bodies_at(shapes, shape, size, centre, turn):
    """:class:`Bodies` at rest at given places, turned by quaternions."""
    n = len(size)
    axes = np.empty((n, 3, 3))
    rigid.set_axes(axes, turn)
    inertia = shapes.inertia[shape] * size[:, None] ** 5
    return Bodies(
        shapes, shape, size, centre, turn, axes, np.pi / 6 * size**3, inertia,
        np.ascontiguousarray(inertia.min(axis=1)), shapes.reach[shape] * size,
        *np.zeros((5, n, 3)),
    )  # fmt: skip


def random_turns(rng, n):
    """Unit quaternions of rotations at random, shape (n, 4) (K. Shoemake, Graphics Gems III)."""
    turn = rng.standard_normal((n, 4))
    return turn / np.linalg.norm(turn, axis=1, keepdims=True)
