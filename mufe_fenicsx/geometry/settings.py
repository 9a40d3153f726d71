"""What a user may choose about segmenting an image and meshing its grains."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import InputError
from .image.raw_file import number_type
from .surface.sizing import CONTACT, CURVATURE, FEWEST_NODES, UNIFORM, Sizing

#: Ways to find the grey level between void and solid.
METHODS = ("otsu", "gaussians", "middle")

#: Masks that are neither a file nor a grey level.
MASKS = ("cylinder", "none")


@dataclass(frozen=True)
class SegmentSettings:
    """From a grey image to labelled grains. Lengths in voxels mean voxels of the raw image."""

    voxel_size: float | tuple | None = None  #: edge of an image voxel, or (z, y, x) [m]; as stated
    shape: tuple | None = None  #: voxels of a raw file along its axes, the last one fastest
    dtype: str | None = None  #: type of a raw file's voxels, such as "<u2"
    key: str | None = None  #: name of the array in an .npz or .h5 file
    axes: str = "zyx"  #: order of the axes in the file, slowest first
    crop: tuple | None = None  #: ((z0, z1), (y0, y1), (x0, x1)) in raw voxels
    mask: float | str | Path | None = (
        None  #: field of view: "cylinder", a level or a file (0) outside; not set: recognised
    )
    invert: bool = False  #: grains are darker than voids
    upsample: float = 1.0  #: voxels of the labels per raw voxel
    filter: str = "gaussian"  #: "gaussian", "median" or "none"
    filter_radius: float = 0.7  #: standard deviation, or radius of the median's ball [voxels]
    threshold: str | float = "middle"  #: "middle" of both phases, "gaussians", "otsu", or a level
    separation: str = "depth"  #: "depth", "level" (as ITK's watershed filter) or "markers"
    marker_depth: float | None = (
        None  #: grains part where the distance map dips more [voxels]; 0.35
    )
    relative_depth: float | None = None  #: and more than this part of its local maximum [-]; 0.06
    watershed_threshold: float | None = None  #: ITK's threshold, of the largest distance [-]; 0.04
    watershed_level: float | None = None  #: ITK's level, of the largest distance [-]; 0.2
    tightening: float = 1.5  #: width over which faces between grains are drawn tight [voxels]
    contact_level: float = 0.7  #: grains touch where their face gets as bright, void 0, solid 1
    fill_pores: bool = True  #: voids enclosed on all sides become part of the solid
    min_grain_voxels: int = (
        200  #: smaller fragments join a neighbour or are dropped [voxels of labels]
    )

    def __post_init__(self):
        _require_voxels(self)
        _require_crop(self.crop)
        _require(0 < self.upsample <= 100, "upsample", self.upsample, "> 0, at most 100")
        _require(
            self.filter in ("gaussian", "median", "none"),
            "filter",
            repr(self.filter),
            '"gaussian", "median" or "none"',
        )
        _require(
            0 <= self.filter_radius <= 100, "filter_radius", self.filter_radius, "0 to 100 voxels"
        )
        ball = self.filter != "median" or self.filter_radius <= 10
        _require(ball, "filter_radius", self.filter_radius, "at most 10 voxels for the median")
        check_method(self.threshold)
        _require(
            self.separation in ("depth", "level", "markers"),
            "separation",
            repr(self.separation),
            '"depth", "level" or "markers"',
        )
        for name in ("watershed_threshold", "watershed_level"):
            value = getattr(self, name)
            _require(value is None or 0 <= value <= 1, name, value, "0 to 1")
            only = 'a value only where separation = "level"'
            _require(value is None or self.separation == "level", name, value, only)
        depth = self.marker_depth
        _require(depth is None or depth > 0, "marker_depth", depth, "> 0 voxels")
        share = self.relative_depth
        _require(share is None or 0 <= share < 1, "relative_depth", share, "0 to below 1")
        only = 'a value only where separation = "depth"'
        _require(share is None or self.separation == "depth", "relative_depth", share, only)
        only = 'a value only where separation = "depth" or "markers"'
        _require(depth is None or self.separation != "level", "marker_depth", depth, only)
        _require(0 <= self.tightening <= 10, "tightening", self.tightening, "0 to 10 voxels")
        _require(0 <= self.contact_level < 1, "contact_level", self.contact_level, "0 to below 1")
        _require(self.min_grain_voxels >= 0, "min_grain_voxels", self.min_grain_voxels, ">= 0")

    def separated_by(self, separation):
        """These settings with another way to part grains, without what only the old one uses."""
        if separation in (None, self.separation):
            return self
        unused = dict.fromkeys(
            ("marker_depth", "relative_depth", "watershed_threshold", "watershed_level")
        )
        return replace(self, separation=separation, **unused)

    @property
    def depth(self):
        """Dip of the distance map that parts grains [voxels]."""
        return 0.35 if self.marker_depth is None else self.marker_depth

    @property
    def relative(self):
        """The same, over the largest distance in the smaller of two grains [-]."""
        return 0.06 if self.relative_depth is None else self.relative_depth

    @property
    def threshold_and_level(self):
        """Of ITK's watershed filter; unless stated, those of Nadimi & Fonseca (2018)."""
        return (
            0.04 if self.watershed_threshold is None else self.watershed_threshold,
            0.2 if self.watershed_level is None else self.watershed_level,
        )


@dataclass(frozen=True)
class MeshSettings:
    """From labels, or surfaces, to tetrahedra."""

    size: float  #: wanted length of edges, at most [m]
    smallest_size: float | None = None  #: at least, where size varies and in small grains [m]
    sizing: str = "uniform"  #: "uniform", "curvature" or "contact": what the size follows
    angle: float = 20.0  #: between neighbouring facets, by which curvature sets the size [degrees]
    contact_reach: float | None = None  #: gaps up to this get the smallest size [m]; None: it
    growth: float = 0.4  #: of the size over distance and over the gap
    surface_nodes: int | None = None  #: of each grain, whose sizes are scaled to that
    inner_size: float = 1.0  #: length of edges inside grains, times that of the surface [-]
    min_angle: float = 0.0  #: of triangles; other settings are tried where one is less [degrees]
    conforming: bool = False  #: grains that touch share their nodes and facets there
    smoothing: float = 1.0  #: standard deviation of the filter of surfaces [voxels of the labels]
    keep_volume: bool = True  #: move free surfaces so that each grain keeps its voxels' volume
    processes: int = 0  #: worker processes; 0: one a core
    time_limit: float = 120.0  #: for a grain, which is then tried once with other settings [s]
    keep_largest_piece: bool = False  #: of a grain in several pieces; otherwise an error
    fill_cavities: bool = False  #: voids that a grain encloses become part of it
    voxel_size: float | tuple | None = None  #: of labels that do not state it, or (z, y, x) [m]
    shape: tuple | None = None  #: voxels of a raw file along its axes, the last one fastest
    dtype: str | None = None  #: type of a raw file's voxels, such as "<u2"
    key: str | None = None  #: name of the labels in an .npz or .h5 file
    axes: str = "zyx"  #: order of the axes in the file, slowest first
    scale: float = 1.0  #: metres a unit of length of foreign surfaces

    def __post_init__(self):
        _require(self.size > 0, "size", self.size, "a length > 0 in metres")
        _require(
            self.smallest_size is None or 0 < self.smallest_size <= self.size,
            "smallest_size",
            self.smallest_size,
            f"a length in metres > 0 and <= size = {self.size:g}",
        )
        modes = (UNIFORM, CURVATURE, CONTACT)
        _require(self.sizing in modes, "sizing", repr(self.sizing), f"one of {', '.join(modes)}")
        _require(
            not self.conforming or (self.sizing == UNIFORM and self.surface_nodes is None),
            "conforming",
            "true",
            'sizing = "uniform" and no surface_nodes beside it',
        )
        _require(1 <= self.angle <= 90, "angle", self.angle, "1 to 90 degrees")
        _require(
            self.contact_reach is None or self.contact_reach >= 0,
            "contact_reach",
            self.contact_reach,
            "a length >= 0 in metres",
        )
        _require(0.05 <= self.growth <= 2, "growth", self.growth, "0.05 to 2")
        _require(
            self.surface_nodes is None or self.surface_nodes >= FEWEST_NODES,
            "surface_nodes",
            self.surface_nodes,
            f">= {FEWEST_NODES}",
        )
        _require(1 <= self.inner_size <= 5, "inner_size", self.inner_size, "1 to 5")
        _require(0 <= self.min_angle <= 35, "min_angle", self.min_angle, "0 to 35 degrees")
        _require(self.time_limit > 0, "time_limit", self.time_limit, "a time > 0 in seconds")
        _require(0.3 <= self.smoothing <= 5, "smoothing", self.smoothing, "0.3 to 5 voxels")
        _require(self.processes >= 0, "processes", self.processes, ">= 0")
        _require_voxels(self)
        _require(self.scale > 0, "scale", self.scale, "> 0 metres a unit")

    @property
    def lengths(self):
        """What the surface's edges follow: a `Sizing`."""
        least = self.least_size
        reach = least if self.contact_reach is None else self.contact_reach
        return Sizing(
            self.sizing, self.size, least, self.angle, reach, self.growth, self.surface_nodes
        )

    @property
    def least_cavity(self):
        """Volume from which a cavity is meshed [m³]: a ball of it takes `FEWEST_NODES` nodes.

        That is where 2/√3 (36π)^(1/3) V^(2/3) = `FEWEST_NODES` times the square of the least size.
        """
        nodes_of_unit = 2 / 3**0.5 * (36 * math.pi) ** (1 / 3)
        return (FEWEST_NODES / nodes_of_unit) ** 1.5 * self.least_size**3

    @property
    def least_size(self):
        """Least length of edges [m]."""
        return 0.5 * self.size if self.smallest_size is None else self.smallest_size


def _require_voxels(settings):
    size = settings.voxel_size
    edges = size if isinstance(size, tuple) else (1.0 if size is None else size,)
    _require(all(edge > 0 for edge in edges), "voxel_size", size, "a length > 0 in metres")
    shape = settings.shape
    good = shape is None or (len(shape) == 3 and all(n >= 1 for n in shape))
    _require(good, "shape", shape, "three numbers of voxels >= 1")
    if settings.dtype is not None:
        number_type(settings.dtype)
    order = 'an order of z, y and x such as "zyx"'
    _require(sorted(settings.axes) == ["x", "y", "z"], "axes", repr(settings.axes), order)


def _require_crop(crop):
    for axis, ends in zip("zyx", crop or (), strict=False):
        _require(len(ends) == 2, "crop", ends, "(first, last) along each axis")
        text = f"{ends[0]} to {ends[1]} along {axis}"
        _require(0 <= ends[0] < ends[1], "crop", text, "a first voxel below the last, from 0")


def _require(holds, name, value, expected):
    if not holds:
        raise InputError(f"{name} = {value}, expected {expected}")


def check_method(method):
    """Raise InputError unless a threshold is one of `METHODS` or a number."""
    if isinstance(method, str) and method not in METHODS:
        names = ", ".join(f'"{name}"' for name in METHODS)
        raise InputError(f"threshold = {method!r}, expected {names} or a grey level")
