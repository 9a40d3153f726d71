"""What a user may choose about segmenting an image and meshing its grains."""

from dataclasses import dataclass

from ..errors import InputError


@dataclass(frozen=True)
class SegmentSettings:
    """From a grey image to labelled grains. Lengths in voxels mean voxels of the raw image."""

    voxel_size: float  #: edge of a voxel of the raw image [m]
    shape: tuple | None = None  #: (z, y, x) of a raw file
    dtype: str | None = None  #: type of a raw file's voxels, such as "<u2"
    key: str | None = None  #: name of the array in an .npz file
    crop: tuple | None = None  #: ((z0, z1), (y0, y1), (x0, x1)) in raw voxels
    upsample: float = 1.0  #: voxels of the labels per raw voxel
    filter: str = "gaussian"  #: "gaussian", "median" or "none"
    filter_radius: float = 1.0  #: standard deviation, or radius of the median's ball [voxels]
    threshold: str | float = "otsu"  #: "otsu", "gaussians" or a grey level
    marker_depth: float = 0.75  #: grains part where the distance map dips by this much [voxels]
    tightening: float = 1.5  #: width over which faces between grains are drawn tight [voxels]
    fill_pores: bool = True  #: voids enclosed on all sides become part of the solid
    min_grain_voxels: int = (
        200  #: smaller fragments join a neighbour or are dropped [voxels of labels]
    )

    def __post_init__(self):
        _require(self.voxel_size > 0, "voxel_size", self.voxel_size, "a length > 0 in metres")
        _require(self.upsample > 0, "upsample", self.upsample, "> 0")
        _require(
            self.filter in ("gaussian", "median", "none"),
            "filter",
            repr(self.filter),
            '"gaussian", "median" or "none"',
        )
        _require(self.filter_radius >= 0, "filter_radius", self.filter_radius, ">= 0 voxels")
        _require(
            not isinstance(self.threshold, str) or self.threshold in ("otsu", "gaussians"),
            "threshold",
            repr(self.threshold),
            '"otsu", "gaussians" or a grey level',
        )
        _require(self.marker_depth > 0, "marker_depth", self.marker_depth, "> 0 voxels")
        _require(0 <= self.tightening <= 10, "tightening", self.tightening, "0 to 10 voxels")
        _require(self.min_grain_voxels >= 0, "min_grain_voxels", self.min_grain_voxels, ">= 0")


@dataclass(frozen=True)
class MeshSettings:
    """From labels, or surfaces, to tetrahedra."""

    size: float  #: wanted length of edges [m]
    smallest_size: float | None = None  #: in grains too small for size [m]; None: half of it
    smoothing: float = 1.0  #: standard deviation of the filter of surfaces [voxels of the labels]
    keep_volume: bool = True  #: move free surfaces so that each grain keeps its voxels' volume
    processes: int = 0  #: worker processes; 0: one a core
    time_limit: float = 120.0  #: for a grain, which is then tried once with other settings [s]
    keep_largest_piece: bool = False  #: of a grain in several pieces; otherwise an error
    voxel_size: float | None = None  #: for labels that do not state their own [m]
    key: str | None = None  #: name of the labels in an .npz file
    scale: float = 1.0  #: metres a unit of length of foreign surfaces

    def __post_init__(self):
        _require(self.size > 0, "size", self.size, "a length > 0 in metres")
        _require(
            self.smallest_size is None or 0 < self.smallest_size <= self.size,
            "smallest_size",
            self.smallest_size,
            f"a length in metres > 0 and <= size = {self.size:g}",
        )
        _require(self.time_limit > 0, "time_limit", self.time_limit, "a time > 0 in seconds")
        _require(0.3 <= self.smoothing <= 5, "smoothing", self.smoothing, "0.3 to 5 voxels")
        _require(self.processes >= 0, "processes", self.processes, ">= 0")
        _require(
            self.voxel_size is None or self.voxel_size > 0,
            "voxel_size",
            self.voxel_size,
            "a length > 0 in metres",
        )
        _require(self.scale > 0, "scale", self.scale, "> 0 metres a unit")

    @property
    def least_size(self):
        """Least length of edges [m]."""
        return 0.5 * self.size if self.smallest_size is None else self.smallest_size


def _require(holds, name, value, expected):
    if not holds:
        raise InputError(f"{name} = {value}, expected {expected}")
