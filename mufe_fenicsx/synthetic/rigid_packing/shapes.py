"""Shapes of grains as the packing needs them: surface points and signed distances on a grid."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...geometry.form.shape import inertia_of, principal, tet_moments
from ...geometry.measure import compact
from ...kernels.geometry.rings import neighbours, rings
from ...kernels.geometry.signed_distance import find_signed_distances
from ..triangulated import divided, vertex_areas

#: Intervals of the grid of signed distances along an edge, and room around the body [sizes].
INTERVALS, ROOM = 28, 0.08


@dataclass
class Shapes:
    """Bodies of volume π/6 about their centroid, along their principal axes.

    Spheres have neither points nor grids: they are known as such. Arrays are those of
    `kernels.packing.packed_surfaces`.
    """

    surfaces: list  #: points and triangles seen from outside of each
    inertia: np.ndarray  #: principal moments for unit density, shape (num_shapes, 3)
    reach: np.ndarray  #: largest distance of the surface from the centre, shape (num_shapes,)
    place: np.ndarray
    weight: np.ndarray
    first: np.ndarray
    grid: np.ndarray
    low: np.ndarray
    step: np.ndarray
    spheres: bool = False

    @property
    def num_shapes(self):
        """How many there are."""
        return len(self.reach)


def ball(surface):
    """:class:`Shapes` of a sphere, whose ``surface`` is for pictures."""
    nothing = np.zeros((1, 2, 2, 2), dtype=np.float32)
    return Shapes(
        [surface], np.full((1, 3), np.pi / 60), np.array([0.5]), np.zeros((0, 3)), np.zeros(0),
        np.zeros(2, dtype=np.int64), nothing, np.zeros((1, 3)), np.ones(1), spheres=True,
    )  # fmt: skip


def in_own_frame(points, triangles):
    """A body of volume π/6 in the frame of its centroid and principal axes.

    Args:
        points, triangles: Closed surface, seen from outside.

    Returns:
        Points; principal moments, shape (3,); centroid [m]; axes in rows, shape (3, 3); diameter of
        the sphere of equal volume [m].
    """
    origin = points.mean(axis=0)
    fan = np.column_stack([np.full(len(triangles), len(points)), triangles])
    volume, centroid, second = tet_moments(np.vstack([points - origin, np.zeros(3)]), fan)
    moments, axes = principal(inertia_of(second))
    size = np.cbrt(6 / np.pi * volume)
    own = (points - origin - centroid) @ axes.T / size
    return own, moments / size**5, origin + centroid, axes, float(size)


def make_shapes(surfaces, num_points):
    """:class:`Shapes` of surfaces in their own frames.

    Args:
        surfaces: (points, triangles, principal moments) of each, by :func:`in_own_frame`.
        num_points: Points of each surface that are looked at.
    """
    places, weights, grids, lows, steps = [], [], [], [], []
    for points, triangles, _ in surfaces:
        place, weight = spread_points(points, triangles, num_points)
        places.append(place)
        weights.append(weight)
        for found, value in zip((grids, lows, steps), distances(points, triangles), strict=True):
            found.append(value)
    return Shapes(
        [(points, triangles) for points, triangles, _ in surfaces],
        np.array([moments for _, _, moments in surfaces]),
        np.array([np.linalg.norm(points, axis=1).max() for points, _, _ in surfaces]) * 1.001,
        np.concatenate(places),
        np.concatenate(weights),
        np.cumsum([0] + [len(place) for place in places]),
        np.array(grids, dtype=np.float32),
        np.array(lows),
        np.array(steps),
    )


def spread_points(points, triangles, count):
    """Vertices spread over a surface, each as far from the others as it can be, and their areas.

    The first is the one farthest from the centre, each next one that farthest from those so far
    (T. F. Gonzalez, Theor. Comput. Sci. 38, 1985, 293-306). Where there are too few vertices,
    triangles are divided.

    Returns:
        Points, shape (num_points, 3); area of the surface that is nearest to each.
    """
    while len(points) < 2 * count:
        points, triangles = divided(points, triangles)
    (of_vertex,) = vertex_areas(points[None], triangles)
    chosen = [int(np.argmax(np.linalg.norm(points, axis=1)))]
    away = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
    place = points[chosen]
    nearest = cKDTree(place).query(points)[1]
    return place, np.bincount(nearest, of_vertex, count)


def distances(points, triangles):
    """Signed distances from a surface on a grid of cubes around it.

    Returns:
        Values, negative inside, shape (m, m, m); first point, shape (3,); edge of a cube.
    """
    points, triangles = compact(points, triangles)
    low, high = points.min(axis=0) - ROOM, points.max(axis=0) + ROOM
    step = float((high - low).max() / INTERVALS)
    low = 0.5 * (low + high - step * INTERVALS)
    ticks = np.arange(INTERVALS + 1) * step
    at = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3) + low
    facets = np.ascontiguousarray(triangles, dtype=np.int32)
    corner = points[facets]
    centre = corner.mean(axis=1)
    radius = np.linalg.norm(corner - centre[:, None], axis=2).max(axis=1)
    value = np.empty(len(at))
    ring = rings(facets, len(points))
    find_signed_distances(
        value, at, points, facets, neighbours(facets, *ring), *ring, centre, radius
    )
    return value.reshape((INTERVALS + 1,) * 3), low, step
