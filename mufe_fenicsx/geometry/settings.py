"""What a user may choose about segmenting an image and meshing its grains."""

from dataclasses import dataclass, replace

from ..errors import InputError
from .threshold import check_method


@dataclass(frozen=True)
class SegmentSettings:
    """From a grey image to labelled grains. Lengths in voxels mean voxels of the raw image."""

    voxel_size: float | tuple | None = None  #: edge of an image voxel, or (z, y, x) [m]; as stated
    shape: tuple | None = None  #: voxels of a raw file along its axes, the last one fastest
    dtype: str | None = None  #: type of a raw file's voxels, such as "<u2"
    key: str | None = None  #: name of the array in an .npz or .h5 file
    axes: str = "zyx"  #: order of the axes in the file, slowest first
    crop: tuple | None = None  #: ((z0, z1), (y0, y1), (x0, x1)) in raw voxels
    upsample: float = 1.0  #: voxels of the labels per raw voxel
    filter: str = "gaussian"  #: "gaussian", "median" or "none"
    filter_radius: float = 0.7  #: standard deviation, or radius of the median's ball [voxels]
    threshold: str | float = "middle"  #: "middle" of both phases, "gaussians", "otsu", or a level
    separation: str = "depth"  #: "depth", "level" (as ITK's watershed filter) or "markers"
    marker_depth: float | None = (
        None  #: grains part where the distance map dips more [voxels]; 0.35
    )
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
        _require(self.upsample > 0, "upsample", self.upsample, "> 0")
        _require(
            self.filter in ("gaussian", "median", "none"),
            "filter",
            repr(self.filter),
            '"gaussian", "median" or "none"',
        )
        _require(self.filter_radius >= 0, "filter_radius", self.filter_radius, ">= 0 voxels")
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
        only = 'a value only where separation = "depth" or "markers"'
        _require(depth is None or self.separation != "level", "marker_depth", depth, only)
        _require(0 <= self.tightening <= 10, "tightening", self.tightening, "0 to 10 voxels")
        _require(0 <= self.contact_level < 1, "contact_level", self.contact_level, "0 to below 1")
        _require(self.min_grain_voxels >= 0, "min_grain_voxels", self.min_grain_voxels, ">= 0")

    def separated_by(self, separation):
        """These settings with another way to part grains, without what only the old one uses."""
        if separation in (None, self.separation):
            return self
        unused = dict.fromkeys(("marker_depth", "watershed_threshold", "watershed_level"))
        return replace(self, separation=separation, **unused)

    @property
    def depth(self):
        """Dip of the distance map that parts grains [voxels]."""
        return 0.35 if self.marker_depth is None else self.marker_depth

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

    size: float  #: wanted length of edges [m]
    smoothing: float = 1.0  #: standard deviation of the filter of surfaces [voxels of the labels]
    keep_volume: bool = True  #: move free surfaces so that each grain keeps its voxels' volume
    processes: int = 0  #: worker processes; 0: one a core
    keep_largest_piece: bool = False  #: of a grain in several pieces; otherwise an error
    voxel_size: float | tuple | None = None  #: of labels that do not state it, or (z, y, x) [m]
    shape: tuple | None = None  #: voxels of a raw file along its axes, the last one fastest
    dtype: str | None = None  #: type of a raw file's voxels, such as "<u2"
    key: str | None = None  #: name of the labels in an .npz or .h5 file
    axes: str = "zyx"  #: order of the axes in the file, slowest first
    scale: float = 1.0  #: metres a unit of length of foreign surfaces

    def __post_init__(self):
        _require(self.size > 0, "size", self.size, "a length > 0 in metres")
        _require(0.3 <= self.smoothing <= 5, "smoothing", self.smoothing, "0.3 to 5 voxels")
        _require(self.processes >= 0, "processes", self.processes, ">= 0")
        _require_voxels(self)
        _require(self.scale > 0, "scale", self.scale, "> 0 metres a unit")


def _require_voxels(settings):
    size = settings.voxel_size
    edges = size if isinstance(size, tuple) else (1.0 if size is None else size,)
    _require(all(edge > 0 for edge in edges), "voxel_size", size, "a length > 0 in metres")
    order = 'an order of z, y and x such as "zyx"'
    _require(sorted(settings.axes) == ["x", "y", "z"], "axes", repr(settings.axes), order)


def _require(holds, name, value, expected):
    if not holds:
        raise InputError(f"{name} = {value}, expected {expected}")
