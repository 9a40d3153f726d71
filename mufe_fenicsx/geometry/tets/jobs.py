"""Grains to mesh, each with the wanted lengths of its edges and the settings to try in turn."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.ndimage

from ..image.labels import grains_in
from ..surface import level_set
from ..surface.edge_sizes import gaps_between
from ..surface.shared_surface import grain_complex
from ..surface.sizing import CONTACT, Sizing
from .fill import DELAUNAY, HXT
from .sources import SharedGrain, SurfaceGrain, VoxelGrain

#: Other settings are tried where the smallest altitude is less than this part of h.
GOOD_ALTITUDE = 0.25
#: The same where the surface is given and other settings change little.
FAIR_ALTITUDE = 0.1


@dataclass(frozen=True)
class Attempt:
    """Settings of one try to mesh a grain."""

    size: float = 1.0  #: times the wanted length of edges
    algorithm: int = HXT
    smoothing: float = 1.0  #: times the standard deviation of the filter
    closing: float = 0.0  #: clefts in the grain narrower than this are filled [times h]


ATTEMPTS = (
    Attempt(),
    Attempt(size=0.93),
    Attempt(size=0.85, algorithm=DELAUNAY),
    # A sheet of a few voxels vanishes in the filter; may overlap neighbours a little.
    Attempt(size=0.85, smoothing=0.5),
    Attempt(size=0.85, closing=1.0),
    Attempt(closing=2.0),
    # The last resort may overlap neighbours, which are smoothed less.
    Attempt(size=0.75, closing=1.0, smoothing=1.6),
)


@dataclass(frozen=True)
class Job:
    """One grain and the wanted lengths of its edges [m]."""

    grain: VoxelGrain | SurfaceGrain
    sizing: Sizing
    min_angle: float = 0.0  #: of the triangles of a good mesh [degrees]
    good_altitude: float = GOOD_ALTITUDE  #: below it other settings are tried [h]
    attempts: tuple = field(default=ATTEMPTS)
    inner_size: float = 1.0  #: of edges inside, times those of the surface
    volume_tolerance: float = 0.2  #: part of its volume by which a mesh may be off

    def otherwise(self):
        """The job for a new try after a worker hung or died: the first settings are left out."""
        return replace(self, attempts=self.attempts[len(self.attempts) // 2 :])


def voxel_jobs(labels, voxel_size, settings, cylinder=None):
    """A job for each grain of a label image.

    Args:
        labels: (z, y, x).
        voxel_size: [m].
        settings: `MeshSettings`.
        cylinder: `Cylinder` in voxels that cuts the grains, beyond which labels do not count;
            None: none.
    """
    sizing, more = settings.lengths, 0
    if cylinder is not None:
        labels = beyond_rim(labels, cylinder, level_set.margin(1.6 * settings.smoothing))
    if sizing.mode == CONTACT:
        more = math.ceil((sizing.largest / sizing.growth + sizing.reach) / voxel_size)
    for label, where in grains_in(labels):
        crop, offset = level_set.crop_around(labels, where, 1.6 * settings.smoothing, more)
        codes = np.where(crop == label, 1, np.where(crop == 0, 0, 2)).astype(np.uint8)
        grain = VoxelGrain(
            label,
            codes,
            offset,
            labels.shape,
            voxel_size,
            settings.smoothing,
            settings.keep_volume,
            more,
            cylinder,
        )
        yield _job(grain, sizing, settings)


def beyond_rim(labels, cylinder, width):
    """Labels that go on beyond the rim of an upright cylinder, as far as smoothing looks.

    Each voxel outside takes the label of the nearest one inside in its slice, so that neither
    clefts and pieces of a grain nor its gaps to others meet a void that is none.
    """
    distance = cylinder.distance((1, *labels.shape[1:]))[0]
    near = scipy.ndimage.distance_transform_edt(
        distance > cylinder.radius, return_distances=False, return_indices=True
    )
    return np.where(distance <= cylinder.radius + width, labels[:, near[0], near[1]], 0)


def shared_jobs(labels, voxel_size, settings):
    """A job for each grain of a label image, where grains that touch share their facets."""
    surface = grain_complex(
        labels, settings.size / voxel_size, settings.smoothing, settings.keep_volume
    )
    points = np.ascontiguousarray(surface.x[:, ::-1]) * voxel_size
    attempts = (Attempt(), Attempt(algorithm=DELAUNAY))
    for job in voxel_jobs(labels, voxel_size, settings):
        nodes, triangles, shared = surface.grain(job.grain.label)
        grain = SharedGrain(job.grain, points[nodes], triangles, np.flatnonzero(shared))
        yield replace(job, grain=grain, attempts=attempts, good_altitude=FAIR_ALTITUDE)


def surface_jobs(bodies, settings, from_walls=None):
    """A job for each body (label, points [m], triangles).

    Args:
        bodies: List of them.
        settings: `MeshSettings`.
        from_walls: Gives distances of points from the nearest wall [m], where that is a contact.
    """
    gaps = [None] * len(bodies)
    if settings.sizing == CONTACT:
        gaps = gaps_between([points for _, points, _ in bodies])
    if settings.sizing == CONTACT and from_walls is not None:
        gaps = [np.minimum(gap, from_walls(x)) for gap, (_, x, _) in zip(gaps, bodies, strict=True)]
    for (label, points, triangles), gap in zip(bodies, gaps, strict=True):
        grain = SurfaceGrain(label, points, triangles, gap)
        yield _job(grain, settings.lengths, settings)


def _job(grain, sizing, settings):
    return Job(
        grain,
        sizing,
        settings.min_angle,
        inner_size=settings.inner_size,
        volume_tolerance=settings.volume_tolerance,
    )
