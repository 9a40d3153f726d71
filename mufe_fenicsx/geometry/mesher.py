"""Mesh every grain: surface, tetrahedra and a row of the quality table; in worker processes."""

import math
import time
from dataclasses import dataclass, field, replace

import numpy as np

from . import level_set, measure
from .bodies import body_surface
from .complexes import grain_complex
from .distance import surface_distance, voxel_distance
from .edge_sizes import Sizes, gaps_between, sizes_by_curvature, sizes_by_gap, voxel_gaps
from .joined import joined
from .labels import grains_in
from .remesh import SurfaceError, SurfaceTooSmall, oriented
from .sizing import CONTACT, UNIFORM, Sizing
from .surface import fitted, grain_surface
from .tetra import DELAUNAY, GMSH, HXT, NETGEN, fill
from .workers import WorkerError, run_jobs

#: Where the smallest altitude over h or the kept part of the volume is less, other settings
#: are tried and the mesh is taken that comes closest to both.
GOOD_ALTITUDE, GOOD_VOLUME = 0.25, 0.99
#: Where the filter may take what it does to curved surfaces.
FREE_VOLUME = 0.9
#: The same where the surface is given and other settings change little.
FAIR_ALTITUDE = 0.1
#: No mesh has flatter elements [h].
LEAST_ALTITUDE = 0.01
#: Part of the thickness of a slice that is a good altitude where that is less.
GOOD_PART_OF_SLICE = 0.4
#: Grains with sharp edges that are thinner than this are optimised by gmsh [h].
THIN = 3.0
#: What a node may leave the surface by to make flat tetrahedra thicker: parts of h, and of the
#: thickness of the grain (2 V / A, a third of the diameter of a ball), whose volume it changes.
TOLERANCE, TOLERANCE_OF_GRAIN = 0.02, 0.012

QUALITY = (
    "label",
    "status",
    "tets",
    "nodes",
    "surface_nodes",
    "volume_m3",
    "voxel_volume_m3",
    "volume_ratio",
    "min_dihedral_deg",
    "mean_dihedral_deg",
    "min_surface_angle_deg",
    "min_altitude_over_h",
    "mean_altitude_over_h",
    "share_below_quarter_h",
    "distance_median_m",
    "distance_95_m",
    "attempts",
    "seconds",
    "reason",
)


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
class Surface:
    """Triangles that tetrahedra are to fill."""

    points: np.ndarray  #: [m]
    triangles: np.ndarray
    sizes: Sizes  #: [m]
    held: np.ndarray | None = None  #: coordinates of points that may not change, (n, 3)
    along: np.ndarray | None = None  #: neighbours of points along edges of the body, (n, 2), or -1

    @property
    def sharp(self):
        """Whether it has edges that are to stay."""
        return self.along is not None and bool((self.along >= 0).any())


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

    @property
    def volume(self):
        """Volume of the voxels within the image [m³]."""
        return np.count_nonzero(self.crop == 1) * self.voxel_size**3

    def surface(self, sizing, attempt):
        """`Surface` of the wanted sizes."""
        sizing = sizing.scaled(1 / self.voxel_size)
        crop, inner = self.crop, slice(self.more, -self.more or None)
        others = crop == 2
        crop, offset = crop[inner, inner, inner], np.asarray(self.offset) + self.more
        if attempt.closing:
            crop = level_set.without_clefts(crop, attempt.closing * sizing.largest)
        sigma = self.smoothing * attempt.smoothing
        body = level_set.smoothed(crop, 1, offset, self.shape, sigma)
        volume = np.count_nonzero(crop == 1) if self.keep_volume else None

        def sizes(body, points, triangles, tags):
            if sizing.mode == UNIFORM:
                return Sizes(sizing.largest)
            if sizing.mode == CONTACT:
                gaps = voxel_gaps(others, points - self.offset)
                return sizes_by_gap(points, gaps, sizing)
            _, gradient = body.value_and_gradient(points)
            length = np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-12)
            plane = np.ones(len(points), dtype=bool)
            plane[triangles[tags == 0]] = False
            return sizes_by_curvature(points, -gradient / length, sizing, plane)

        points, triangles, found, *held = grain_surface(body, sizes, volume, sizing.nodes)
        found = found.scaled(self.voxel_size)
        return Surface(points * self.voxel_size, triangles, found, *held)

    def distance(self, points):
        """Distances of points on the surface from the faces of the voxels [m]."""
        at = points[:, ::-1] / self.voxel_size - self.offset
        return voxel_distance(self.crop == 1, at) * self.voxel_size


@dataclass(frozen=True)
class SurfaceGrain:
    """A grain given by its surface."""

    label: int
    points: np.ndarray  #: [m]
    triangles: np.ndarray
    gaps: np.ndarray | None = None  #: distances of the points from other grains [m]

    @property
    def volume(self):
        return measure.surface_volume(self.points, self.triangles)

    def surface(self, sizing, attempt):
        """`Surface` of the wanted sizes."""
        points, triangles = self.points, self.triangles
        if sizing.mode == UNIFORM:
            sizes = Sizes(sizing.largest)
        elif sizing.mode == CONTACT:
            sizes = sizes_by_gap(points, self.gaps, sizing)
        else:
            normals = measure.vertex_normals(points, triangles)
            sizes = sizes_by_curvature(points, normals, sizing)
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
        return self.voxels.label

    @property
    def volume(self):
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


@dataclass
class GrainMesh:
    """What became of one grain; points and cells are None if it failed."""

    quality: dict
    points: np.ndarray | None = None  #: [m]
    cells: np.ndarray | None = None

    @property
    def label(self):
        return self.quality["label"]

    @property
    def ok(self):
        return self.points is not None


@dataclass(frozen=True)
class Job:
    """One grain and the wanted lengths of its edges [m]."""

    grain: VoxelGrain | SurfaceGrain
    sizing: Sizing
    min_angle: float = 0.0  #: of the triangles of a good mesh [degrees]
    good_altitude: float = GOOD_ALTITUDE  #: below it other settings are tried [h]
    attempts: tuple = field(default=ATTEMPTS)
    inner_size: float = 1.0  #: of edges inside, times those of the surface

    def otherwise(self):
        """The job for a new try after a worker hung or died: the first settings are left out."""
        return replace(self, attempts=self.attempts[len(self.attempts) // 2 :])


def voxel_jobs(labels, voxel_size, settings):
    """A job for each grain of a label image."""
    sizing, more = settings.lengths, 0
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
        )
        yield Job(grain, sizing, settings.min_angle, inner_size=settings.inner_size)


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


def surface_jobs(bodies, settings):
    """A job for each body (label, points [m], triangles)."""
    gaps = [None] * len(bodies)
    if settings.sizing == CONTACT:
        gaps = gaps_between([points for _, points, _ in bodies])
    for (label, points, triangles), gap in zip(bodies, gaps, strict=True):
        grain = SurfaceGrain(label, points, triangles, gap)
        yield Job(grain, settings.lengths, settings.min_angle, inner_size=settings.inner_size)


def mesh_grains(jobs, processes=0, progress=None, limit=None):
    """Mesh grains in worker processes.

    Scripts that call this need ``if __name__ == "__main__":``, because each
    worker imports them.

    Args:
        jobs: From `voxel_jobs` or `surface_jobs`.
        processes: Number of workers; 0: one a core.
        progress: Called with the number of finished grains.
        limit: Time for one grain [s], after which it is tried once more with other settings;
            None: none.

    Returns:
        One `GrainMesh` a job, in the jobs' order; those that failed say why.
    """
    labels = []

    def remembered():
        for job in jobs:
            labels.append(job.grain.label)
            yield job

    results = run_jobs(
        mesh_one, remembered(), processes, progress, limit=limit, again=Job.otherwise
    )
    return [
        GrainMesh(_row(label, "failed", reason=f"{mesh}, with other settings too"))
        if isinstance(mesh, WorkerError)
        else mesh
        for label, mesh in zip(labels, results, strict=True)
    ]


def mesh_one(job):
    """Mesh one grain: try settings until a good mesh comes out, else take the best."""
    start, best, best_score, reasons = time.perf_counter(), None, 0.0, []
    grain, num_attempts = job.grain, 0
    # Where the size varies, elements are judged by their own mean edge.
    uniform, h = job.sizing.mode == UNIFORM, job.sizing.largest
    wanted = job.sizing.nodes is None
    good_volume = GOOD_VOLUME if getattr(grain, "keep_volume", True) else FREE_VOLUME
    for attempt in job.attempts:
        num_attempts += 1
        try:
            surface = _sized_surface(job, attempt)
            size, held = surface.sizes.size, surface.held
            thickness = 2 * grain.volume / measure.surface_area(surface.points, surface.triangles)
            tolerance = min(
                TOLERANCE * (h if uniform else job.sizing.smallest),
                TOLERANCE_OF_GRAIN * thickness,
            )
            # gmsh's tolerances suit bodies of size one.
            nodes, cells = fill(
                surface.points / size,
                surface.triangles,
                algorithm=attempt.algorithm,
                optimizer=GMSH if surface.sharp and thickness < THIN * size else NETGEN,
                size=1.0 if uniform else None,
                tolerance=tolerance / size,
                fixed=None if held is None else np.flatnonzero(held.all(axis=1)),
                along=surface.along,
                inner=job.inner_size,
            )
            nodes *= size
            if held is not None:  # to the last digit
                nodes[: len(held)] = np.where(held, surface.points, nodes[: len(held)])
        except SurfaceTooSmall as error:
            reasons.append(str(error))
            break
        except Exception as error:  # whatever gmsh, VTK or pyacvd raise: try the next settings
            reasons.append(" ".join(str(error).split()) or type(error).__name__)
            continue
        row = _measured(
            grain.label, grain.volume, nodes, cells, (h if wanted else size) if uniform else None
        )
        if not 0.5 < row["volume_ratio"] < 2:
            reasons.append(f"the mesh has {row['volume_ratio']:.3g} of the volume of the grain")
            continue
        if row["min_altitude_over_h"] < LEAST_ALTITUDE:
            reasons.append(f"the flattest element is {row['min_altitude_over_h']:.2g} h thick")
            continue
        good_altitude = min(job.good_altitude, GOOD_PART_OF_SLICE * thickness / h)
        score = min(row["min_altitude_over_h"] / good_altitude, 1) * min(
            row["volume_ratio"] / good_volume, 1
        )
        if job.min_angle > 0:
            score *= min(row["min_surface_angle_deg"] / job.min_angle, 1)
        if score > best_score:
            best, best_score = GrainMesh(row, nodes, cells), score
        if score == 1:
            break
    if best is not None:
        best.quality.update(_distances(grain, best))
    else:
        # The first reason concerns the settings that the user chose.
        reason = f"{reasons[0]} (the grain has {grain.volume / h**3:.3g} h^3)"
        best = GrainMesh(_row(grain.label, "failed", reason=reason))
        best.quality["voxel_volume_m3"] = grain.volume
    best.quality["attempts"] = num_attempts
    best.quality["seconds"] = round(time.perf_counter() - start, 3)
    return best


def _sized_surface(job, attempt):
    """The surface of a grain and its sizes, which are less than wanted in a small grain."""
    sizing = job.sizing.times(attempt.size)
    try:
        return job.grain.surface(sizing, attempt)
    except SurfaceTooSmall as error:
        largest = sizing.largest * error.factor
        if largest < job.sizing.smallest:
            raise
        sizing = replace(sizing, largest=largest, smallest=min(sizing.smallest, largest))
        return job.grain.surface(sizing, attempt)


def _distances(grain, mesh):
    """Distances of nodes and centres of facets of a mesh from the surface that was given."""
    triangles = measure.boundary_triangles(mesh.cells)
    at = np.concatenate([mesh.points[np.unique(triangles)], mesh.points[triangles].mean(axis=1)])
    median, most = np.quantile(grain.distance(at), [0.5, 0.95])
    return {"distance_median_m": float(median), "distance_95_m": float(most)}


def make_thicker_together(meshes, size, box):
    """Improve meshes of grains that share facets, in place (see `joined.joined`); table rows too.

    Distances from the voxels stay those before: nodes of surfaces move by a few hundredths of h.
    """
    done = [mesh for mesh in meshes if mesh.ok]
    if not done:
        return
    points = joined(
        [mesh.points for mesh in done],
        [mesh.cells for mesh in done],
        size,
        np.array([mesh.quality["voxel_volume_m3"] for mesh in done]),
        box,
    )
    for mesh, x in zip(done, points, strict=True):
        mesh.points, row = x, mesh.quality
        new = _measured(mesh.label, row["voxel_volume_m3"], x, mesh.cells, size)
        row.update({name: value for name, value in new.items() if value != ""})


def _measured(label, given_volume, points, cells, h):
    """A row of the table; altitudes over h, or over the mean edge of each element."""
    length = measure.mean_edges(points, cells) if h is None else h
    altitudes = measure.smallest_altitudes(points, cells) / length
    surface = measure.boundary_triangles(cells)
    angles = measure.smallest_dihedral_angles(points, cells)
    volume = measure.tet_volumes(points, cells).sum()
    return _row(
        label,
        "ok",
        tets=len(cells),
        nodes=len(points),
        surface_nodes=len(np.unique(surface)),
        volume_m3=float(volume),
        voxel_volume_m3=float(given_volume),
        volume_ratio=float(volume / given_volume),
        min_dihedral_deg=float(angles.min()),
        mean_dihedral_deg=float(angles.mean()),
        min_surface_angle_deg=measure.smallest_angle(points, surface),
        min_altitude_over_h=float(altitudes.min()),
        mean_altitude_over_h=float(altitudes.mean()),
        share_below_quarter_h=float((altitudes < 0.25).mean()),
    )


def _row(label, status, **values):
    row = dict.fromkeys(QUALITY, "")
    row.update(label=int(label), status=status, **values)
    return row
