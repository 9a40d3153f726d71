"""What a user may choose about segmenting an image and meshing its grains."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import InputError
from ..units import REQUIRED, check_keys, require, setting
from .surface.sizing import CONTACT, FEWEST_NODES, UNIFORM, Sizing

#: Ways to find the grey level between void and solid.
METHODS = ("otsu", "gaussians", "middle")

#: Masks that are neither a file nor a grey level.
MASKS = ("cylinder", "none")

#: What a cylindrical sample is recognised by.
FIELD, MOULD, GIVEN = "field", "mould", "given"
#: What becomes of grains at its rim.
CUT, DROP, WHOLE = "cut", "drop", "whole"


@dataclass(frozen=True)
class SegmentSettings:
    """From a grey image to labelled grains. Lengths in voxels mean voxels of the raw image."""

    voxel_size: float | tuple | None = setting(
        None, "m", "edge of an image voxel, or (z, y, x); None: as the image states it", shape=(3,)
    )
    shape: tuple | None = setting(
        None,
        "",
        "voxels of a raw file along its axes, the last one fastest",
        shape=(3,),
        form="z,y,x",
    )
    dtype: str | None = setting(
        None, "", 'type of a raw file\'s voxels, such as "<u2"; ">" is big endian'
    )
    key: str | None = setting(None, "", "name of the array in an .npz or .h5 file")
    axes: str | None = setting(
        None, "", 'order of the axes in the file, slowest first; None: as it states, or "zyx"'
    )
    crop: tuple | None = setting(
        None,
        "",
        "ranges of raw voxels along z, y and x that are kept",
        shape=(3, 2),
        form="z0:z1,y0:y1,x0:x1",
    )
    mask: float | str | Path | None = setting(
        None,
        "",
        'field of view: "cylinder", "none", a level or a file (0) outside; None: recognised',
        words=MASKS,
    )
    cylinder: str | None = setting(
        None,
        "",
        'the sample is a cylinder along z: the "field" of view, within a "mould", or "given"',
        allowed=(FIELD, MOULD, GIVEN),
    )
    cylinder_middle: tuple | None = setting(
        None, "m", "x and y of its axis; None: as recognised", shape=(2,), form="x,y"
    )
    cylinder_radius: float | None = setting(
        None, "m", "its radius, smaller than what is there; None: as recognised", gt=0
    )
    rim: str | None = setting(
        None,
        "",
        'grains at its rim: "cut", "drop" or "whole"; None: cut, in a mould whole',
        allowed=(CUT, DROP, WHOLE),
    )
    invert: bool = setting(False, "", "grains are darker than voids", off="bright")
    upsample: float = setting(
        1.0, "", "voxels of the labels per raw voxel", gt=0, le=100, plausible=(0.05, 20.0)
    )
    filter: str = setting(
        "gaussian",
        "",
        'of grey levels: "gaussian", "median" or "none"',
        allowed=("gaussian", "median", "none"),
    )
    filter_radius: float = setting(
        0.7,
        "voxels",
        "of the filter: standard deviation, or radius of the median's ball",
        ge=0,
        le=100,
        plausible=(0.0, 50.0),
    )
    threshold: str | float = setting(
        "middle", "", 'between void and solid: "middle" of both, "gaussians", "otsu", or a level'
    )
    separation: str = setting(
        "depth",
        "",
        'of grains: "depth", "level" (as ITK\'s watershed filter) or "markers"',
        allowed=("depth", "level", "markers"),
    )
    marker_depth: float | None = setting(
        None,
        "voxels",
        "grains part where the distance map dips more; None: 0.35",
        gt=0,
        plausible=(0.0, 1e4),
    )
    relative_depth: float | None = setting(
        None, "-", "and more than this part of its local maximum; None: 0.06", ge=0, lt=1
    )
    watershed_threshold: float | None = setting(
        None, "-", "ITK's threshold, of the largest distance; None: 0.04", ge=0, le=1
    )
    watershed_level: float | None = setting(
        None, "-", "ITK's level, of the largest distance; None: 0.2", ge=0, le=1
    )
    tightening: float = setting(
        1.5, "voxels", "width over which faces between grains are drawn tight", ge=0, le=10
    )
    contact_level: float = setting(
        0.7, "", "grains touch where their face gets as bright, void 0, solid 1", ge=0, lt=1
    )
    fill_pores: bool = setting(
        True, "", "voids enclosed on all sides become part of the solid", off="keep-pores"
    )
    min_grain_voxels: int = setting(
        200, "voxels of labels", "smaller fragments join a neighbour or are dropped", ge=0
    )

    def __post_init__(self):
        _require_voxels(self)
        _require_crop(self.crop)
        check_keys(self)
        ball = self.filter != "median" or self.filter_radius <= 10
        require(ball, "filter_radius", self.filter_radius, "at most 10 voxels for the median")
        check_method(self.threshold)
        for name in ("watershed_threshold", "watershed_level"):
            value = getattr(self, name)
            only = 'a value only where separation = "level"'
            require(value is None or self.separation == "level", name, value, only)
        only = 'a value only where separation = "depth"'
        share, depth = self.relative_depth, self.marker_depth
        require(share is None or self.separation == "depth", "relative_depth", share, only)
        only = 'a value only where separation = "depth" or "markers"'
        require(depth is None or self.separation != "level", "marker_depth", depth, only)
        self._require_cylinder()

    def _require_cylinder(self):
        for name in ("cylinder_middle", "cylinder_radius", "rim"):
            value = getattr(self, name)
            only = 'a value only where cylinder = "field", "mould" or "given"'
            require(value is None or self.cylinder is not None, name, value, only)
        if self.rim == WHOLE:
            where = f'where cylinder = "{self.cylinder}"'
            walled = self.cylinder == GIVEN or (
                self.cylinder == MOULD and self.cylinder_radius is None
            )
            require(
                walled,
                "rim",
                f'"{WHOLE}" {where}',
                '"cut" or "drop": grains end of themselves only at the wall of a mould',
            )

    @property
    def rim_of_cylinder(self):
        """What becomes of grains at the rim of the cylinder."""
        if self.rim is not None:
            return self.rim
        at_wall = self.cylinder == MOULD and self.cylinder_radius is None
        return WHOLE if at_wall and self.cylinder_middle is None else CUT

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

    size: float = setting(
        REQUIRED, "m", "wanted length of edges, at most", gt=0, expected="a length > 0 in metres"
    )
    smallest_size: float | None = setting(
        None, "m", "least length of edges, where size varies and in small grains", gt=0
    )
    sizing: str = setting(
        UNIFORM,
        "",
        '"uniform", or "contact": it follows the distance to the next grain',
        allowed=(UNIFORM, CONTACT),
    )
    contact_reach: float | None = setting(
        None,
        "m",
        "gaps up to this get the smallest size; None: that size",
        ge=0,
        expected="a length >= 0 in metres",
    )
    growth: float = setting(0.4, "", "of the size over distance and over the gap", ge=0.05, le=2)
    surface_nodes: int | None = setting(
        None,
        "",
        "nodes of the surface of each grain, whose sizes are scaled to that",
        ge=FEWEST_NODES,
        plausible=(1, 1_000_000),
    )
    inner_size: float = setting(
        1.0, "-", "length of edges inside grains, times that of the surface", ge=1, le=5
    )
    min_angle: float = setting(
        0.0,
        "degrees",
        "least angle of triangles; other settings are tried where one is less",
        ge=0,
        le=35,
    )
    conforming: bool = setting(
        False, "", "grains that touch share their nodes and facets there", off="apart"
    )
    smoothing: float = setting(
        1.0, "voxels of the labels", "standard deviation of the filter of surfaces", ge=0.3, le=5
    )
    keep_volume: bool = setting(
        True,
        "",
        "move free surfaces so that each grain keeps its voxels' volume",
        off="free-volume",
    )
    volume_tolerance: float = setting(
        0.2, "-", "part of a grain's volume by which its mesh may be off; others are refused",
        gt=0, lt=1,
    )  # fmt: skip
    processes: int = setting(0, "", "worker processes; 0: one a core", ge=0, plausible=(0, 4096))
    time_limit: float = setting(
        120.0,
        "s",
        "for a grain, which is then tried once with other settings",
        gt=0,
        expected="a time > 0 in seconds",
    )
    keep_largest_piece: bool = setting(
        False, "", "of a grain in several pieces; otherwise an error", off="whole-grains"
    )
    fill_cavities: bool = setting(
        False, "", "voids that a grain encloses become part of it", off="keep-cavities"
    )
    voxel_size: float | tuple | None = setting(
        None, "m", "edge of a voxel of labels that do not state it, or (z, y, x)", shape=(3,)
    )
    shape: tuple | None = setting(
        None,
        "",
        "voxels of a raw file along its axes, the last one fastest",
        shape=(3,),
        form="z,y,x",
    )
    dtype: str | None = setting(
        None, "", 'type of a raw file\'s voxels, such as "<u2"; ">" is big endian'
    )
    key: str | None = setting(None, "", "name of the labels in an .npz or .h5 file")
    axes: str | None = setting(
        None, "", 'order of the axes in the file, slowest first; None: as it states, or "zyx"'
    )
    cylinder_middle: tuple | None = setting(
        None, "m", "x and y of its axis; None: as the labels state it, or the middle",
        shape=(2,), form="x,y",
    )  # fmt: skip
    cylinder_radius: float | None = setting(
        None, "m", "of a cylinder along z that is cut out of labels; None: as they state", gt=0
    )
    scale: float = setting(
        1.0,
        "m",
        "length of a unit of foreign surfaces",
        gt=0,
        expected="> 0 metres a unit",
        plausible=(1e-10, 1e4),
    )

    def __post_init__(self):
        check_keys(self)
        require(
            self.smallest_size is None or self.smallest_size <= self.size,
            "smallest_size",
            self.smallest_size,
            f"a length in metres > 0 and <= size = {self.size:g}",
        )
        require(
            not self.conforming or (self.sizing == UNIFORM and self.surface_nodes is None),
            "conforming",
            "true",
            'sizing = "uniform" and no surface_nodes beside it',
        )
        _require_voxels(self)

    @property
    def lengths(self):
        """What the surface's edges follow: a `Sizing`."""
        least = self.least_size
        reach = least if self.contact_reach is None else self.contact_reach
        return Sizing(self.sizing, self.size, least, reach, self.growth, self.surface_nodes)

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
    require(all(edge > 0 for edge in edges), "voxel_size", size, "a length > 0 in metres")
    shape = settings.shape
    good = shape is None or (len(shape) == 3 and all(n >= 1 for n in shape))
    require(good, "shape", shape, "three numbers of voxels >= 1")
    if settings.dtype is not None:
        from .image.raw_file import number_type

        number_type(settings.dtype)
    order = 'an order of z, y and x such as "zyx"'
    axes = settings.axes
    require(axes is None or sorted(axes) == ["x", "y", "z"], "axes", repr(axes), order)


def _require_crop(crop):
    for axis, ends in zip("zyx", crop or (), strict=False):
        require(len(ends) == 2, "crop", ends, "(first, last) along each axis")
        text = f"{ends[0]} to {ends[1]} along {axis}"
        require(0 <= ends[0] < ends[1], "crop", text, "a first voxel below the last, from 0")


def check_method(method):
    """Raise InputError unless a threshold is one of `METHODS` or a number."""
    if isinstance(method, str) and method not in METHODS:
        names = ", ".join(f'"{name}"' for name in METHODS)
        raise InputError(f"threshold = {method!r}, expected {names} or a grey level")
