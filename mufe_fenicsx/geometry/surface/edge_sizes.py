"""Length of edges over the surface of a grain, as `Sizing` wants it.

All lengths here are in one unit, that of the points.
"""

import numpy as np
import scipy.ndimage
from scipy.spatial import cKDTree


class Sizes:
    """Lengths of edges as a function of position; even if there are no points.

    Args:
        size: Length where there is nothing else, and at most.
        points: Positions at which lengths are known, shape (n, 3).
        values: The lengths, shape (n,).
    """

    def __init__(self, size, points=None, values=None):
        self.size, self.values = size, values
        self._tree = None if points is None else cKDTree(points)

    @property
    def even(self):
        """Whether the length is the same everywhere."""
        return self._tree is None

    def __call__(self, x):
        """Lengths at positions x, shape (n, 3)."""
        if self.even:
            return np.full(len(x), self.size)
        distance, near = self._tree.query(x, k=3)
        weight = 1 / (distance + 1e-6 * self.size)
        return (weight * self.values[near]).sum(axis=1) / weight.sum(axis=1)

    def scaled(self, factor):
        """The field in another unit: lengths and positions multiplied by a factor."""
        if self.even:
            return Sizes(self.size * factor)
        return Sizes(self.size * factor, self._tree.data * factor, self.values * factor)

    def times(self, factor):
        """The same field with all lengths multiplied by a factor."""
        other = Sizes(self.size * factor)
        other._tree, other.values = self._tree, self.values
        if not self.even:
            other.values = self.values * factor
        return other


def sizes_by_gap(points, gaps, sizing):
    """Small where the next grain is within ``sizing.reach``; growing with the gap beyond."""
    wanted = sizing.smallest + sizing.growth * np.maximum(gaps - sizing.reach, 0)
    return _graded(points, wanted, sizing)


def voxel_gaps(others, at):
    """Distances of positions, by index from a voxel's centre, from other grains [voxels]."""
    if not others.any():
        return np.full(len(at), np.inf)
    distance = scipy.ndimage.distance_transform_edt(~others) - 0.5
    return scipy.ndimage.map_coordinates(distance, at.T, order=1, mode="nearest")


def gaps_between(bodies):
    """Distances of the points of each body from those of all others.

    Args:
        bodies: Points of each, a list of arrays (n, 3).
    """
    points = np.concatenate(bodies)
    body = np.repeat(np.arange(len(bodies)), [len(x) for x in bodies])
    if len(bodies) == 1:
        return [np.full(len(points), np.inf)]
    gaps = []
    for b, x in enumerate(bodies):
        distance, _ = cKDTree(points[body != b]).query(x)
        gaps.append(distance)
    return gaps


def _graded(points, wanted, sizing):
    """The field within its limits, growing by no more than ``growth`` per distance."""
    wanted = np.clip(wanted, sizing.smallest, sizing.largest)
    keep = _thinned(points, 0.5 * sizing.smallest)
    points, wanted = points[keep], wanted[keep]
    neighbours = cKDTree(points)
    distance, near = neighbours.query(points, k=min(12, len(points)))
    for _ in range(60):
        limit = (wanted[near] + sizing.growth * distance).min(axis=1)
        if np.all(limit >= wanted - 1e-3 * sizing.smallest):
            break
        wanted = np.minimum(wanted, limit)
    return Sizes(sizing.largest, points, wanted)


def _thinned(points, spacing):
    """One point in each cube of this edge."""
    return np.unique(np.floor(points / spacing).astype(np.int64), axis=0, return_index=True)[1]
