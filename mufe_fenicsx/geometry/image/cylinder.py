"""A cylinder along z in an image: the part of it that is the sample."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Cylinder:
    """Middle and radius, and how the axis leans; lengths in voxels or metres, all alike.

    Positions are counted from the corner of the image. At height z the axis is at
    (x, y) + lean (z - z0).
    """

    x: float  #: of the axis at height z0
    y: float
    radius: float
    lean: tuple = (0.0, 0.0)  #: dx/dz and dy/dz of the axis
    z0: float = 0.0

    def scaled(self, factor):
        """In another unit of length: ``factor`` new ones are an old one."""
        x, y, radius, z0 = (factor * v for v in (self.x, self.y, self.radius, self.z0))
        return replace(self, x=x, y=y, radius=radius, z0=z0)

    def shift(self, height):
        """How far the axis moves sideways over a height."""
        return float(np.hypot(*self.lean)) * height

    def upright(self, height, inscribed):
        """The upright cylinder within this one over a height from 0, or around it."""
        half = height / 2
        x, y = (p + s * (half - self.z0) for p, s in zip((self.x, self.y), self.lean, strict=True))
        wider = -0.5 if inscribed else 0.5
        return Cylinder(x, y, self.radius + wider * self.shift(height))

    def distance(self, shape):
        """Of the middles of voxels from the axis, (z, y, x); lengths are voxels.

        One layer stands for all where the axis does not lean.
        """
        leans = any(self.lean)
        z = (np.arange(shape[0]) + 0.5 - self.z0)[:, None, None] if leans else 0.0
        y = np.arange(shape[1])[None, :, None] + 0.5 - self.y - self.lean[1] * z
        x = np.arange(shape[2])[None, None, :] + 0.5 - self.x - self.lean[0] * z
        return np.hypot(y, x)

    def inside(self, shape, smaller=0.0):
        """True at voxels whose middles lie in a cylinder so much ``smaller``, (z, y, x)."""
        within = self.distance(shape) <= self.radius - smaller
        return np.ascontiguousarray(np.broadcast_to(within, shape))

    def pixel_shares(self, shape, parts=8):
        """Part of each pixel (y, x) that lies within an upright cylinder.

        Pixels that the circle crosses are divided into ``parts`` × ``parts``.
        """
        distance = self.distance((1, *shape))[0]
        share = (distance <= self.radius).astype(float)
        j, i = np.nonzero(np.abs(distance - self.radius) < 0.75)
        at = (np.arange(parts) + 0.5) / parts
        y = j[:, None, None] + at[None, :, None] - self.y
        x = i[:, None, None] + at[None, None, :] - self.x
        share[j, i] = (np.hypot(y, x) <= self.radius).mean(axis=(1, 2))
        return share
