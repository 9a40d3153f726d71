"""One grain in the frame of its principal axes, which rigid bodies of other programs move in."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.form.shape import inertia_of, principal, tet_moments
from ..geometry.measure import boundary_triangles, compact
from ..kernels.geometry.rings import neighbours, rings
from ..kernels.geometry.signed_distance import find_signed_distances


@dataclass(frozen=True)
class Body:
    """A grain of uniform density; positions are about its centroid, along its principal axes."""

    label: int
    volume: float  #: [m³]
    centroid: np.ndarray  #: in the sample [m], shape (3,)
    moments: np.ndarray  #: principal moments of inertia for unit density, rising [m⁵], shape (3,)
    axes: np.ndarray  #: their axes in the sample, right-handed, in rows, shape (3, 3)
    points: np.ndarray  #: vertices of the surface in the frame of the axes [m], shape (n, 3)
    triangles: np.ndarray  #: seen from outside, shape (m, 3)

    @property
    def diameter(self):
        """Of the ball of equal volume [m]."""
        return (6 * self.volume / np.pi) ** (1 / 3)

    @property
    def quaternion(self):
        """Rotation from the principal axes to the sample as (x, y, z, w), w >= 0, shape (4,)."""
        return Rotation.from_matrix(self.axes.T).as_quat(canonical=True)

    def in_sample(self, points):
        """Positions in the sample [m] of ``points`` in the frame of the axes, shape (n, 3)."""
        return np.asarray(points) @ self.axes + self.centroid

    def signed_distance(self, points):
        """Distance of points in the frame of the axes from the surface [m], negative inside."""
        distance = np.empty(len(points))
        find_signed_distances(distance, np.ascontiguousarray(points), self.points, *self._surface)
        return distance

    @cached_property
    def _surface(self):
        facets = np.ascontiguousarray(self.triangles, dtype=np.int32)
        corner = self.points[facets]
        centre = corner.mean(axis=1)
        radius = np.linalg.norm(corner - centre[:, None], axis=2).max(axis=1)
        ring = rings(facets, len(self.points))
        return facets, neighbours(facets, *ring), *ring, centre, radius


def bodies_of(grains):
    """A :class:`Body` of each grain in turn.

    Args:
        grains: :class:`~mufe_fenicsx.geometry.grains.Grains`.
    """
    for g, label in enumerate(grains.labels):
        points, cells = grains.grain(g)
        volume, centroid, second = tet_moments(points, cells)
        moments, axes = principal(inertia_of(second))
        points, triangles = compact(points, boundary_triangles(cells))
        local = np.ascontiguousarray((points - centroid) @ axes.T)
        yield Body(int(label), volume, centroid, moments, axes, local, triangles)
