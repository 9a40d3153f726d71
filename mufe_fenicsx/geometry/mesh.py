"""From labelled grains, or their surfaces, to a mesh of each."""

import time
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..machine.files import new_folder
from .form.proportions import warnings_of_proportions
from .grains import Grains, save_grains
from .image import labels as labelling
from .image.cylinder import Cylinder
from .image.label_files import grain_table, read_labels, write_table
from .image.picture import draw_quality
from .image.round_sample import cut_labels
from .image.tiff_file import TIFF
from .measure import assumed_unit, smallest_altitudes, surface_volume, worst_share_costs
from .round_cut import cylinder_of, faces_on, numbers_of, place_of
from .surface.given_surfaces import has_bodies, read_bodies
from .tets.jobs import shared_jobs, surface_jobs, voxel_jobs
from .tets.mesher import make_thicker_together, mesh_grains
from .tets.quality import QUALITY
from .tets.work import check_work

#: Part of a grain's volume by which its mesh may be off without a warning.
VOLUME_OFF = 0.02
#: Distance of half of the surface from that given over the mean thickness, 2V/A, likewise: plates
#: of three voxels may have their volume and be two thirds too thick.
THICKNESS_OFF = 0.15


def mesh_labels(labels_path, settings, output_folder, *, progress=None, overwrite=False):
    """From labels, or surfaces of grains, to the folder of grain meshes.

    Scripts that call this need ``if __name__ == "__main__":``, because the
    worker processes import them.

    Args:
        labels_path: A label image (see `label_files.read_labels`), or surfaces
            (see `bodies.read_bodies`).
        settings: `MeshSettings`.
        output_folder: New folder for grains.h5, grains.xdmf, labels.csv (of labels a row a grain,
            of surfaces the file of each), quality.csv and quality.png.
        progress: Called with the numbers of finished and of all grains.
        overwrite: Replace a folder of grains that is there.

    Returns:
        A dictionary: num_grains, failed (labels), reasons, num_cells, num_nodes, …

    Raises:
        InputError: labels cannot be used, nothing could be meshed, or the
            output cannot be written.
    """
    start = time.perf_counter()
    with new_folder(output_folder, overwrite=overwrite, marker="grains.h5") as folder:
        read = _given_surfaces if has_bodies(labels_path) else _given_labels
        given = read(labels_path, settings)
        total = given.num_grains
        meshes = mesh_grains(
            given.jobs,
            settings.processes,
            progress and (lambda finished: progress(finished, total)),
            settings.time_limit,
        )
        if given.voxel_size is not None and settings.conforming:
            make_thicker_together(meshes, settings.size, given.box)
        done = [mesh for mesh in meshes if mesh.ok]
        failed = [mesh for mesh in meshes if not mesh.ok]
        if not done:
            raise InputError(
                f"size = {settings.size:g} m: none of {total} grains could be meshed; "
                f"grain {failed[0].label}: {failed[0].quality['reason']}"
            )
        grains = Grains.from_list(
            [mesh.label for mesh in done],
            [(mesh.points, mesh.cells) for mesh in done],
            settings.size,
            given.box,
            given.cylinder and tuple(place_of(given.cylinder).values()),
        )
        for mesh in done:  # against the labels as they were given
            whole = mesh.quality["voxel_volume_m3"] + given.trimmed.get(mesh.label, 0.0)
            mesh.quality["volume_ratio"] *= mesh.quality["voxel_volume_m3"] / whole
            mesh.quality["voxel_volume_m3"] = whole
        rows = [mesh.quality for mesh in meshes]
        save_grains(folder, grains)
        write_table(folder / "quality.csv", rows, QUALITY)
        write_table(folder / "labels.csv", given.table)
        draw_quality(folder / "quality.png", rows, settings.size)
        _keep_segmentation(folder, Path(labels_path), given)
    return {
        "grains": str(output_folder),
        "num_grains": grains.num_grains,
        "failed": [mesh.label for mesh in failed],
        "reasons": [mesh.quality["reason"] for mesh in failed],
        "trimmed": list(given.trimmed),
        "notices": given.notices,
        "repaired": given.repaired,
        "filled": given.filled,
        "warnings": [*warnings_of(done), *warnings_of_proportions(grains)],
        "renumbered": given.renumbered,
        **_numbers_of_cut(given, done),
        **_quality(done, grains, settings.size, given.voxel_size),
        "seconds": round(time.perf_counter() - start, 3),
    }


def _keep_segmentation(folder, labels_path, given):
    """Keep what `mufe segment` wrote beside labels whose numbers are those of the grains."""
    if given.voxel_size is None or given.renumbered:
        return
    for ending, name in (("_contacts.csv", "label_contacts.csv"), (".png", "labels.png")):
        path = labels_path.with_name(labels_path.stem + ending)
        if labels_path.suffix.lower() in TIFF and path.is_file():
            (folder / name).write_bytes(path.read_bytes())


@dataclass
class _Given:
    """What grains are meshed from."""

    jobs: object  #: one for each grain
    num_grains: int
    box: np.ndarray  #: corners of the box around all grains [m], shape (2, 3)
    table: list  #: rows of labels.csv
    voxel_size: float | None = None  #: of labels [m]; None: surfaces
    renumbered: bool = False  #: whether labels of the file are other ones
    trimmed: dict = field(default_factory=dict)  #: volume that was left out, by label [m³]
    notices: list = field(default_factory=list)  #: lines on what was done to the file's labels
    repaired: list = field(default_factory=list)  #: what was mended of surfaces
    filled: list = field(default_factory=list)  #: cavities that were filled, in words
    cylinder: Cylinder | None = None  #: that cuts the grains [m]
    left_out: int = 0  #: grains of which the cylinder leaves too little


def _given_surfaces(path, settings):
    """:class:`_Given` by surfaces of grains."""
    if settings.conforming:
        raise InputError(f"conforming = true for the surfaces {path}, expected labels")
    if settings.cylinder_radius is not None or settings.cylinder_middle is not None:
        raise InputError(f"a cylinder that cuts the surfaces {path}, expected labels")
    repaired, origins = [], []
    cavity = np.inf if settings.fill_cavities else settings.least_cavity
    bodies = read_bodies(path, settings.scale, repaired, cavity, origins)
    check_work([surface_volume(*body[1:3]) for body in bodies], settings)
    points = np.concatenate([points for _, points, _ in bodies])
    columns = ("label", "file", "body")
    return _Given(
        surface_jobs(bodies, settings),
        len(bodies),
        np.array([points.min(axis=0), points.max(axis=0)]),
        [dict(zip(columns, origin, strict=True)) for origin in origins],
        notices=[assumed_unit(path, points)] if settings.scale == 1.0 else [],
        repaired=repaired,
    )


def _given_labels(path, settings):
    """:class:`_Given` by a label image."""
    filled, numbers, notices = [], [], []
    labels, voxel_size = read_labels(
        path,
        voxel_size=settings.voxel_size,
        key=settings.key,
        shape=settings.shape,
        dtype=settings.dtype,
        axes=settings.axes,
        numbers=numbers,
        notices=notices,
    )
    cylinder = cylinder_of(path, settings, labels.shape, voxel_size)
    cut, inside, left_out, lost = None, None, 0, {}
    if cylinder is not None:
        cut = cylinder.scaled(1 / voxel_size)
        inside = cut.inside(labels.shape)
        labels, left_out = cut_labels(labels, cut, lost)
    labels, left = labelling.checked_labels(
        labels, keep_largest_piece=settings.keep_largest_piece, source=str(path)
    )
    present = set(np.unique(labels).tolist())
    left = {label: lost[label] for label in lost if label in present} | left
    notices += labelling.left_out_lines(left, labels)
    largest = None if settings.fill_cavities else settings.least_cavity / voxel_size**3
    cavities = labelling.fill_cavities(labels, largest)
    table = grain_table(labels, voxel_size, inside)
    why = "" if settings.fill_cavities else " smaller than elements"
    for row in table:
        count, voxels = cavities.get(row["label"], (0, 0))
        if count:
            filled.append(
                f"grain {row['label']}: {count} cavities{why} of {voxels} voxels, "
                f"{voxels / row['voxels']:.2g} of its volume"
            )
    for row in table if numbers else ():
        row["label_in_file"] = numbers[row["label"] - 1]
    check_work([row["volume_m3"] for row in table], settings)
    make = shared_jobs if settings.conforming else partial(voxel_jobs, cylinder=cut)
    return _Given(
        make(labels, voxel_size, settings),
        len(table),
        np.array([[0, 0, 0], np.array(labels.shape[::-1]) * voxel_size]),
        table,
        voxel_size,
        bool(numbers),
        {grain: sum(sizes) * voxel_size**3 for grain, (sizes, _) in left.items()},
        filled=filled,
        notices=notices,
        cylinder=cylinder,
        left_out=left_out,
    )


def _quality(meshes, grains, size, voxel_size):
    """Numbers of all meshes together."""

    def column(name):
        return np.array([mesh.quality[name] for mesh in meshes], dtype=float)

    return {
        "retried": int((column("attempts") > 1).sum()),
        "num_cells": len(grains.cells),
        "num_nodes": len(grains.points),
        "element_size": size,
        "volume_ratio": float(column("volume_m3").sum() / column("voxel_volume_m3").sum()),
        "smallest_volume_ratio": float(column("volume_ratio").min()),
        "min_altitude_over_h": float(column("min_altitude_over_h").min()),
        "mean_min_altitude_over_h": float(column("min_altitude_over_h").mean()),
        "min_dihedral_deg": float(column("min_dihedral_deg").min()),
        "share_below_quarter_h": float(
            (column("share_below_quarter_h") * column("tets")).sum() / len(grains.cells)
        ),
        "time_step_without_worst": worst_share_costs(
            smallest_altitudes(grains.points, grains.cells)
        ),
        **_distances(column, voxel_size or size, "voxels" if voxel_size else "sizes"),
    }


def warnings_of(meshes):
    """A line for each grain whose mesh has another volume, or thickness, than what was given."""
    off = [mesh.quality for mesh in meshes if abs(mesh.quality["volume_ratio"] - 1) > VOLUME_OFF]
    off.sort(key=lambda row: -abs(row["volume_ratio"] - 1))
    thin = {mesh.label: mesh.quality["distance_median_m"] / mesh.quality["thickness_m"]
            for mesh in meshes}  # fmt: skip
    thin = sorted((item for item in thin.items() if item[1] > THICKNESS_OFF), key=lambda i: -i[1])
    return [
        f"grain {row['label']}: the mesh has {row['volume_ratio']:.3f} of the volume that was "
        f"given, expected within {VOLUME_OFF:.0%}: take a smaller size, or part it at thin necks"
        for row in off
    ] + [
        f"grain {label}: half of its surface is off that given by more than {part:.0%} of its mean "
        f"thickness, expected {THICKNESS_OFF:.0%}: take a smaller size"
        for label, part in thin
    ]


def _numbers_of_cut(given, meshes):
    """What was cut by a cylinder; {} where the sample has none."""
    cylinder = given.cylinder
    if cylinder is None:
        return {}
    round_faces = faces_on(cylinder, meshes, np.ptp(given.box[:, 2]))
    return numbers_of(cylinder) | {
        "rim_grains_left_out": given.left_out,
        "round_faces_share": round_faces,
    }


def _distances(column, length, unit):
    """Distances of surfaces from those given: the grains' medians and 95 %, by their nodes."""
    nodes, most = column("surface_nodes"), column("distance_95_m") / length
    median = column("distance_median_m") / length
    return {
        f"distance_median_{unit}": float((median * nodes).sum() / nodes.sum()),
        f"distance_95_{unit}": float((most * nodes).sum() / nodes.sum()),
        f"largest_distance_95_{unit}": float(most.max()),
    }
