"""The two steps of the command line: an image to labels, and labels to grain meshes."""

import time
from pathlib import Path

import numpy as np

from ..errors import InputError
from . import image as images
from . import labels as labelling
from .bodies import has_bodies, read_bodies
from .contact_faces import contact_table
from .doubts import mark_doubts
from .grain_file import available_memory
from .grains import Grains, save_grains
from .image_files import read_with_size
from .jobs import shared_jobs, surface_jobs, voxel_jobs
from .label_files import grain_table, read_labels, write_labels, write_table
from .measure import smallest_altitudes, surface_volume, worst_share_costs
from .mesher import make_thicker_together, mesh_grains
from .output import new_files, new_folder
from .picture import draw_quality, draw_segmentation
from .quality import QUALITY
from .segmentation import segment
from .stated_size import known_voxel_size
from .tiff_file import TIFF

#: Tetrahedra in a cube of the length of edges, and memory that meshing takes for each [bytes].
CELLS_A_CUBE, BYTES_A_CELL = 4.0, 200.0
#: Of the table of contacts, which may have no rows.
CONTACT_COLUMNS = ("label_a", "label_b", "area_m2", "neck_ratio", "doubt")


def segment_image(image_path, settings, output, *, overwrite=False):
    """From a grey image to a label image.

    Writes ``output`` (TIFF), beside it the tables of grains (.csv) and of pairs that touch
    (_contacts.csv) and a picture of slices with the outlines of labels (.png).

    Args:
        image_path: See `image_files.read_with_size`.
        settings: `SegmentSettings`.
        output: Path of the labels, ending in .tif or .tiff.
        overwrite: Replace files that are there.

    Returns:
        A dictionary: files, threshold, num_grains, solid_fraction, …

    Raises:
        InputError: the image cannot be used, or the output not be written.
    """
    start = time.perf_counter()
    output = Path(output)
    if output.suffix.lower() not in TIFF:
        raise InputError(f"output {output} ends in {output.suffix!r}, expected .tif")
    table, picture = output.with_suffix(".csv"), output.with_suffix(".png")
    contacts = output.with_name(f"{output.stem}_contacts.csv")
    with new_files(output, table, contacts, picture, overwrite=overwrite) as folder:
        raw, stated = read_with_size(
            image_path,
            shape=settings.shape,
            dtype=settings.dtype,
            key=settings.key,
            axes=settings.axes,
            crop=settings.crop,
        )
        size = known_voxel_size(settings.voxel_size, stated, image_path)
        raw, edge = images.to_cubes(raw, size)
        labels, grey, found = segment(raw, settings)
        num_grains = int(labels.max())
        if num_grains < 2:
            raise InputError(
                f"image {image_path}: {num_grains} grains of at least "
                f"{settings.min_grain_voxels} voxels above the threshold {found['threshold']:g}, "
                "expected at least 2"
            )
        voxel_size = edge / settings.upsample
        rows = grain_table(labels, voxel_size)
        pairs = contact_table(labels, voxel_size)
        doubts = mark_doubts(rows, pairs, labels)
        write_labels(folder / output.name, labels, voxel_size)
        write_table(folder / contacts.name, pairs, CONTACT_COLUMNS)
        write_table(folder / table.name, rows)
        draw_segmentation(folder / picture.name, grey, labels, voxel_size)
    warning = found.pop("warning")
    diameters = np.array([row["equivalent_diameter_m"] for row in rows])
    return {
        "labels": str(output),
        "table": str(table),
        "contacts": str(contacts),
        "picture": str(picture),
        "shape": list(labels.shape),
        "image_voxel_size": list(size),
        "image_voxel_size_from": "the file" if settings.voxel_size is None else "the settings",
        "voxel_size": voxel_size,
        "threshold_method": settings.threshold if isinstance(settings.threshold, str) else "given",
        "num_grains": num_grains,
        "num_border_grains": sum(row["touches_border"] for row in rows),
        "num_contacts": len(pairs),
        **found,
        "solid_fraction": float(np.count_nonzero(labels) / labels.size),
        "median_diameter": float(np.median(diameters)),
        **doubts,
        "warnings": [] if warning is None else [warning],
        "seconds": round(time.perf_counter() - start, 3),
    }


def mesh_labels(labels_path, settings, output_folder, *, progress=None, overwrite=False):
    """From labels, or surfaces of grains, to the folder of grain meshes.

    Scripts that call this need ``if __name__ == "__main__":``, because the
    worker processes import them.

    Args:
        labels_path: A label image (see `label_files.read_labels`), or surfaces
            (see `bodies.read_bodies`).
        settings: `MeshSettings`.
        output_folder: New folder for grains.h5, grains.xdmf, quality.csv and quality.png.
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
        table, trimmed, repaired, voxel_size = None, [], [], None
        if has_bodies(labels_path):
            if settings.conforming:
                raise InputError(
                    f"conforming = true for the surfaces {labels_path}, expected labels"
                )
            bodies = read_bodies(labels_path, settings.scale, repaired)
            _check_size(settings, sum(surface_volume(*body[1:3]) for body in bodies))
            jobs, total = surface_jobs(bodies, settings), len(bodies)
            points = np.concatenate([points for _, points, _ in bodies])
            box = np.array([points.min(axis=0), points.max(axis=0)])
        else:
            labels, voxel_size = read_labels(
                labels_path,
                voxel_size=settings.voxel_size,
                key=settings.key,
                shape=settings.shape,
                dtype=settings.dtype,
                axes=settings.axes,
            )
            labels, trimmed = labelling.checked_labels(
                labels, keep_largest_piece=settings.keep_largest_piece, source=str(labels_path)
            )
            _check_size(
                settings, np.count_nonzero(labels) * float(np.prod(np.broadcast_to(voxel_size, 3)))
            )
            table = grain_table(labels, voxel_size)
            make = shared_jobs if settings.conforming else voxel_jobs
            jobs, total = make(labels, voxel_size, settings), len(table)
            box = np.array([[0, 0, 0], np.array(labels.shape[::-1]) * voxel_size])

        meshes = mesh_grains(
            jobs,
            settings.processes,
            progress and (lambda finished: progress(finished, total)),
            settings.time_limit,
        )
        if table is not None and settings.conforming:
            make_thicker_together(meshes, settings.size, box)
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
            box,
        )
        rows = [mesh.quality for mesh in meshes]
        save_grains(folder, grains)
        write_table(folder / "quality.csv", rows, QUALITY)
        if table is not None:
            write_table(folder / "labels.csv", table)
        draw_quality(folder / "quality.png", rows, settings.size)

    def column(name):
        return np.array([mesh.quality[name] for mesh in done], dtype=float)

    return {
        "grains": str(output_folder),
        "num_grains": grains.num_grains,
        "failed": [mesh.label for mesh in failed],
        "reasons": [mesh.quality["reason"] for mesh in failed],
        "trimmed": trimmed,
        "repaired": repaired,
        "retried": int((column("attempts") > 1).sum()),
        "num_cells": len(grains.cells),
        "num_nodes": len(grains.points),
        "element_size": settings.size,
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
        **_distances(column, voxel_size or settings.size, "voxels" if voxel_size else "sizes"),
        "seconds": round(time.perf_counter() - start, 3),
    }


def _check_size(settings, volume):
    """Raise InputError where grains of that volume [m³] would have more cells than memory holds."""
    expected = CELLS_A_CUBE * volume / (settings.size * settings.inner_size) ** 3
    room = available_memory() / BYTES_A_CELL
    if expected > room:
        least = (CELLS_A_CUBE * volume / room) ** (1 / 3) / settings.inner_size
        raise InputError(
            f"size = {settings.size:g} m, expected at least {least:.2g} m: about {expected:.2g} "
            f"tetrahedra, and memory for {room:.2g}"
        )


def _distances(column, length, unit):
    """Distances of surfaces from those given: the grains' medians and 95 %, by their nodes."""
    nodes, most = column("surface_nodes"), column("distance_95_m") / length
    median = column("distance_median_m") / length
    return {
        f"distance_median_{unit}": float((median * nodes).sum() / nodes.sum()),
        f"distance_95_{unit}": float((most * nodes).sum() / nodes.sum()),
        f"largest_distance_95_{unit}": float(most.max()),
    }
