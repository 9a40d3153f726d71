"""What is known of a grain: the labels around it, its own surface, or one shared with others.

Each gives the surface that tetrahedra are to fill, in edges of the wanted lengths, and the
distances of points from what was given.
"""

from dataclasses import dataclass, replace

import numpy as np

from .. import measure
from ..image.cylinder import Cylinder
from ..image.distance import surface_distance, voxel_distance
from ..surface import level_set
from ..surface.edge_sizes import Sizes, sizes_by_gap, voxel_gaps
from ..surface.given_surfaces import body_surface
from ..surface.remesh import SurfaceError, oriented
from ..surface.round_cut import RoundCut
from ..surface.sizing import UNIFORM
from ..surface.surface import fitted, grain_surface


@dataclass(frozen=True)
class Surface:
    """Triangles that tetrahedra are to fill."""

    points: np.ndarray  #: [m]
    triangles: np.ndarray
    sizes: Sizes  #: [m]
    held: np.ndarray | None = None  #: coordinates of points that may not change, (n, 3)
    along: np.ndarray | None = None  #: neighbours of points along edges of the body, (n, 2), or -1
    round: np.ndarray | None = None  #: points on the cylinder that cuts the grain, (n,)
    cylinder: Cylinder | None = None  #: that cylinder [m]

    @property
    def sharp(self):
        """Whether it has edges that are to stay."""
        return self.along is not None and bool((self.along >= 0).any())

    def put_back(self, nodes):
        """Nodes, of which the first are those of the surface, where faces hold them exactly."""
        n = len(self.points)
        if self.held is not None:
            nodes[:n] = np.where(self.held, self.points, nodes[:n])
        if self.round is not None and self.round.any():
            which, axis = np.flatnonzero(self.round), [self.cylinder.x, self.cylinder.y]
            out = nodes[which, :2] - axis
            length = np.linalg.norm(out, axis=1, keepdims=True)
            nodes[which, :2] = axis + out * (self.cylinder.radius / length)
        return nodes


@dataclass(frozen=True)
class VoxelGrain:
    """A grain given by the labels around it."""

    label: int
    crop: np.ndarray  #: 0 void, 1 this grain, 2 other grains
    offset: np.ndarray  #: index of the crop's first voxel within the image
    shape: tuple  #: voxels of the image
    voxel_size: float  #: [m]
    smoothing: float  #: [voxels]
    keep_volume: bool
    more: int = 0  #: voxels of the crop beyond those that smoothing needs
    cylinder: Cylinder | None = None  #: that cuts grains; lengths are voxels

    @property
    def volume(self):
        """Volume of the voxels within the image and the cylinder [m³]."""
        voxels = (self.crop == 1).sum(axis=0)
        return float((voxels * self._shares).sum()) * self.voxel_size**3

    @property
    def _shares(self):
        """Part of each voxel that is within the cylinder, (y, x) of the crop."""
        if self.cylinder is None:
            return np.ones(self.crop.shape[1:])
        _, y, x = self.offset
        own = replace(self.cylinder, x=self.cylinder.x - x, y=self.cylinder.y - y)
        return own.pixel_shares(self.crop.shape[1:])

    @property
    def _cut(self):
        """`RoundCut`, of positions counted from the middle of voxels, or None."""
        if self.cylinder is None:
            return None
        return RoundCut((self.cylinder.y - 0.5, self.cylinder.x - 0.5), self.cylinder.radius)

    def surface(self, sizing, attempt):
        """`Surface` of the wanted sizes."""
        sizing = sizing.scaled(1 / self.voxel_size)
        crop, inner = self.crop, slice(self.more, -self.more or None)
        others = crop == 2
        crop, offset = crop[inner, inner, inner], np.asarray(self.offset) + self.more
        if attempt.closing:
            crop = level_set.without_clefts(crop, attempt.closing * sizing.largest)
        sigma = self.smoothing * attempt.smoothing
        body = level_set.smoothed(crop, 1, offset, self.shape, sigma, self._cut)
        volume, shares = None, self._shares[inner, inner]
        if self.keep_volume:
            volume = level_set.volume_in_one_piece(body, crop, shares)

        def sizes(points):
            if sizing.mode == UNIFORM:
                return Sizes(sizing.largest)
            return sizes_by_gap(points, voxel_gaps(others, points - self.offset), sizing)

        points, triangles, found, *held = grain_surface(body, sizes, volume, sizing.nodes)
        found = found.scaled(self.voxel_size)
        cylinder = self.cylinder and self.cylinder.scaled(self.voxel_size)
        return Surface(points * self.voxel_size, triangles, found, *held, cylinder)

    def distance(self, points):
        """Distances of points on the surface from the faces of the voxels [m]."""
        at = points[:, ::-1] / self.voxel_size - self.offset
        return voxel_distance((self.crop == 1) & (self._shares > 0.5), at) * self.voxel_size


@dataclass(frozen=True)
class SurfaceGrain:
    """A grain given by its surface."""

    label: int
    points: np.ndarray  #: [m]
    triangles: np.ndarray
    gaps: np.ndarray | None = None  #: distances of the points from other grains [m]

    @property
    def volume(self):
        """Volume within the surface [m³]."""
        return measure.surface_volume(self.points, self.triangles)

    def surface(self, sizing, attempt):
        """`Surface` of the wanted sizes."""
        points, triangles = self.points, self.triangles
        if sizing.mode == UNIFORM:
            sizes = Sizes(sizing.largest)
        else:
            sizes = sizes_by_gap(points, self.gaps, sizing)
        sizes = fitted(sizes, points, triangles, sizing.nodes)
        return Surface(*body_surface(points, triangles, sizes), sizes)

    def distance(self, points):
        """Distances of points from the given surface [m]."""
        return surface_distance(self.points, self.triangles, points)


@dataclass(frozen=True)
class SharedGrain:
    """A grain of voxels whose surface is made already, together with its neighbours'."""

    voxels: VoxelGrain
    points: np.ndarray  #: [m]
    triangles: np.ndarray
    shared: np.ndarray  #: nodes that belong to a neighbour too

    @property
    def label(self):
        """Label of the grain."""
        return self.voxels.label

    @property
    def volume(self):
        """Volume of its voxels within the image [m³]."""
        return self.voxels.volume

    def surface(self, sizing, attempt):
        """`Surface` of the wanted sizes."""
        if len(self.triangles) == 0:
            raise SurfaceError("no cell of the size of elements lies in the grain")
        triangles = oriented(self.points, self.triangles)
        defect = measure.surface_defect(self.points, triangles)
        if defect:
            raise SurfaceError(f"surface has {defect}")
        held = np.zeros(self.points.shape, dtype=bool)
        held[self.shared] = True
        return Surface(self.points, triangles, Sizes(sizing.largest), held)

    def distance(self, points):
        """Distances of points on the surface from the faces of the voxels [m]."""
        return self.voxels.distance(points)
