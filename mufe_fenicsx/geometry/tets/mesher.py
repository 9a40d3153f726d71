"""Mesh every grain: surface, tetrahedra and a row of the quality table; in worker processes."""

import time
from dataclasses import dataclass, replace

import numpy as np

from ...kernels.geometry.topology import body_defect
from .. import measure
from ..surface.remesh import SurfaceTooSmall
from ..surface.sizing import UNIFORM
from .fill import GMSH, NETGEN, fill
from .jobs import Job
from .joint_quality import joined
from .quality import measured_row, quality_row
from .workers import WorkerError, run_jobs

#: Where the kept part of the volume is less, or the smallest altitude less than the job's, other
#: settings are tried and the mesh is taken that comes closest to both.
GOOD_VOLUME = 0.99
#: Where the filter may take what it does to curved surfaces.
FREE_VOLUME = 0.9
#: No mesh has flatter elements [h].
LEAST_ALTITUDE = 0.01
#: Part of the thickness of a slice that is a good altitude where that is less.
GOOD_PART_OF_SLICE = 0.4
#: Grains with sharp edges that are thinner than this are optimised by gmsh [h].
THIN = 3.0
#: What a node may leave the surface by to make flat tetrahedra thicker: parts of h, and of the
#: thickness of the grain (2 V / A, a third of the diameter of a ball), whose volume it changes.
TOLERANCE, TOLERANCE_OF_GRAIN = 0.02, 0.012


@dataclass
class GrainMesh:
    """What became of one grain; points and cells are None if it failed."""

    quality: dict
    points: np.ndarray | None = None  #: [m]
    cells: np.ndarray | None = None

    @property
    def label(self):
        """Label of the grain."""
        return self.quality["label"]

    @property
    def ok(self):
        """Whether it was meshed."""
        return self.points is not None


def mesh_grains(jobs, processes=0, progress=None, limit=None):
    """Mesh grains in worker processes.

    Scripts that call this need ``if __name__ == "__main__":``, because each
    worker imports them.

    Args:
        jobs: From `jobs.voxel_jobs`, `jobs.shared_jobs` or `jobs.surface_jobs`.
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
        GrainMesh(quality_row(label, "failed", reason=f"{mesh}, with other settings too"))
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
            nodes, cells, size, thickness = _filled(job, attempt, uniform)
        except SurfaceTooSmall as error:
            reasons.append(str(error))
            break
        except Exception as error:  # whatever gmsh, VTK or pyacvd raise: try the next settings
            reasons.append(" ".join(str(error).split()) or type(error).__name__)
            continue
        defect = body_defect(cells, len(nodes))
        if defect:
            reasons.append(f"the mesh has {defect}")
            continue
        row = measured_row(
            grain.label, grain.volume, nodes, cells, (h if wanted else size) if uniform else None
        )
        if abs(row["volume_ratio"] - 1) > job.volume_tolerance:
            reasons.append(
                f"the mesh has {row['volume_ratio']:.3g} of the volume of the grain, expected "
                f"within volume_tolerance = {job.volume_tolerance:g}: take a smaller size"
            )
            continue
        if row["min_altitude_over_h"] < LEAST_ALTITUDE:
            reasons.append(f"the flattest element is {row['min_altitude_over_h']:.2g} h thick")
            continue
        good_altitude = min(job.good_altitude, GOOD_PART_OF_SLICE * thickness / h)
        score = min(row["min_altitude_over_h"] / good_altitude, 1) * min(
            min(row["volume_ratio"], 1 / row["volume_ratio"]) / good_volume, 1
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
        best = GrainMesh(quality_row(grain.label, "failed", reason=reason))
        best.quality["voxel_volume_m3"] = grain.volume
    best.quality["attempts"] = num_attempts
    best.quality["seconds"] = round(time.perf_counter() - start, 3)
    return best


def _filled(job, attempt, uniform):
    """Nodes and tetrahedra of a grain [m], edges of its surface [m], its mean thickness [m]."""
    surface = _sized_surface(job, attempt)
    size, held = surface.sizes.size, surface.held
    area = measure.surface_area(surface.points, surface.triangles)
    thickness = 2 * job.grain.volume / area
    tolerance = min(
        TOLERANCE * (job.sizing.largest if uniform else job.sizing.smallest),
        TOLERANCE_OF_GRAIN * thickness,
    )
    # gmsh's tolerances suit bodies of size one.
    nodes, cells = fill(
        surface.points / size,
        surface.triangles,
        algorithm=attempt.algorithm,
        optimiser=GMSH if surface.sharp and thickness < THIN * size else NETGEN,
        size=1.0 if uniform else None,
        tolerance=tolerance / size,
        fixed=None if held is None else np.flatnonzero(held.all(axis=1)),
        along=surface.along,
        inner=job.inner_size,
    )
    nodes *= size
    return surface.put_back(nodes), cells, size, thickness


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
        new = measured_row(mesh.label, row["voxel_volume_m3"], x, mesh.cells, size)
        row.update({name: value for name, value in new.items() if value != ""})
