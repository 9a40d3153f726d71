"""The two steps of the command line: an image to labels, and labels to grain meshes."""

import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from ..errors import InputError
from .atomic_output import new_files, new_folder
from .form.proportions import warnings_of_proportions
from .grains import Grains, save_grains
from .image import image as images
from .image import labels as labelling
from .image.compare_labels import compare_labels, fitted, true_labels
from .image.contact_faces import contact_table
from .image.cylinder import Cylinder
from .image.field_of_view import field_of_view
from .image.image_files import inverted, read_with_size
from .image.label_files import (
    grain_table,
    read_labels,
    stated_cylinder,
    write_labels,
    write_table,
)
from .image.picture import draw_quality, draw_refusal, draw_segmentation
from .image.quality_flags import mark_doubts
from .image.round_sample import cut_labels, round_sample
from .image.segmentation import resampled_mask, segment
from .image.threshold import NoThreshold
from .image.tiff_file import TIFF
from .image.voxel_size import known_voxel_size
from .measure import (
    area_on_cylinder,
    assumed_unit,
    smallest_altitudes,
    surface_volume,
    worst_share_costs,
)
from .settings import CUT, WHOLE
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
#: Of the table of contacts, which may have no rows.
CONTACT_COLUMNS = ("label_a", "label_b", "area_m2", "neck_ratio", "doubt")


def segment_image(image_path, settings, output, *, truth=None, overwrite=False):
    """From a grey image to a label image.

    Writes ``output`` (TIFF), beside it the tables of grains (.csv) and of pairs that touch
    (_contacts.csv) and a picture of slices with the outlines of labels (.png).

    Args:
        image_path: See `image_files.read_with_size`.
        settings: `SegmentSettings`.
        output: Path of the labels, ending in .tif or .tiff.
        truth: Labels to hold the result against (see `label_files.read_labels`), of the image or
            of its ``crop``; None: none.
        overwrite: Replace files that are there.

    Returns:
        A dictionary: files, threshold, num_grains, solid_fraction, …; notices and warnings, lists
        of lines; compared, what `compare.compare_labels` says, or None.

    Raises:
        InputError: the image cannot be used, or the output not be written. Where a threshold is
            refused, a picture of its histogram and of a slice is left (_threshold.png).
    """
    start = time.perf_counter()
    output = Path(output)
    if output.suffix.lower() not in TIFF:
        raise InputError(f"output {output} ends in {output.suffix!r}, expected .tif")
    table, picture = output.with_suffix(".csv"), output.with_suffix(".png")
    contacts = output.with_name(f"{output.stem}_contacts.csv")
    with (
        _pictured(output.with_name(f"{output.stem}_threshold.png")),
        new_files(output, table, contacts, picture, overwrite=overwrite) as folder,
    ):
        raw, inside, true, given = _grey_image(image_path, settings, truth)
        labels, grey, found, sample = _segmented(raw, inside, settings, given, image_path)
        level, warning = found.pop("field"), found.pop("warning")
        num_grains = int(labels.max())
        if num_grains < 1:
            raise NoThreshold(
                f"image {image_path}: no grain of at least {settings.min_grain_voxels} voxels "
                f"above the threshold {found['threshold']:g}, expected at least one",
                grey, level, found["threshold"],
            )  # fmt: skip
        voxel_size = given["edge"] / settings.upsample
        cylinder = None if sample is None else sample.cylinder.scaled(given["edge"])
        rows = grain_table(labels, voxel_size, found.pop("rim", level))
        pairs = contact_table(labels, voxel_size)
        doubts = mark_doubts(rows, pairs, labels)
        compared = None
        if true is not None:
            true = fitted(true, labels.shape)
            if sample is not None:
                true[~sample.cylinder.scaled(settings.upsample).inside(labels.shape)] = 0
            compared = compare_labels(labels, true, min_voxels=settings.min_grain_voxels)
        about = None if sample is None else _about(cylinder, sample.rim == CUT)
        write_labels(folder / output.name, labels, voxel_size, about)
        write_table(folder / contacts.name, pairs, CONTACT_COLUMNS)
        write_table(folder / table.name, rows)
        draw_segmentation(folder / picture.name, grey, labels, voxel_size, level, cylinder, pairs)
    diameters = np.array([row["equivalent_diameter_m"] for row in rows])
    return {
        "labels": str(output),
        "table": str(table),
        "contacts": str(contacts),
        "picture": str(picture),
        "shape": list(labels.shape),
        "image_voxel_size": list(given["size"]),
        "image_voxel_size_from": "the file" if settings.voxel_size is None else "the settings",
        "voxel_size": voxel_size,
        "threshold_method": settings.threshold if isinstance(settings.threshold, str) else "given",
        "num_grains": num_grains,
        "num_border_grains": sum(row["touches_border"] for row in rows),
        "num_contacts": len(pairs),
        **found,
        **({} if sample is None else _numbers(cylinder, sample.rim)),
        "median_diameter": float(np.median(diameters)),
        **doubts,
        "notices": given["notices"],
        "warnings": _warnings(warning, num_grains),
        "compared": compared,
        "seconds": round(time.perf_counter() - start, 3),
    }


def _warnings(warning, num_grains):
    few = "one grain only: is the threshold right, are grains brighter than voids?"
    return ([] if warning is None else [warning]) + [few] * (num_grains == 1)


@contextmanager
def _pictured(picture):
    """What refuses a threshold in the block leaves a picture of what it was to part."""
    try:
        yield
    except NoThreshold as refusal:
        with new_files(picture, overwrite=True) as folder:
            draw_refusal(folder / picture.name, refusal)
        raise InputError(f"{refusal}; {picture} shows the histogram") from None


def _segmented(raw, inside, settings, given, source):
    """Labels of the sample, its levels and what was found, as `segmentation.segment` has them.

    Of a cylinder, levels are those of the image beyond it too, for the picture; what was found has
    the mask of the cylinder where it cuts grains (``rim``). Fourth, the `RoundSample` or None.
    """
    if settings.cylinder is None:
        return *segment(raw, settings, inside), None
    levels, mine, sample = round_sample(raw, inside, settings, given["edge"], str(source))
    labels, grey, found = segment(levels, settings, mine, sample.closed)
    field = found["field"]
    labels, within, numbers = sample.cut(labels, field, settings)
    if sample.closed:
        grey = np.where(field, grey, images.resample(raw, settings.upsample))
        measured = None if inside is None else resampled_mask(
            inside, settings.upsample, labels.shape)  # fmt: skip
        found["field"] = measured
    given["notices"] += sample.lines
    rim = None if sample.rim == WHOLE else within
    return labels, grey, found | numbers | {"rim": rim}, sample


def _about(cylinder, cut):
    """What a file of labels states of the cylinder of its sample [m]."""
    place = {name: float(getattr(cylinder, name)) for name in ("x", "y", "radius")}
    return place | {"cut": cut}


def _numbers(cylinder, rim):
    """The same for a summary."""
    place = {f"cylinder_{name}_m": float(getattr(cylinder, name)) for name in ("x", "y", "radius")}
    return place | {"rim": rim}


def _grey_image(path, settings, truth):
    """What :func:`segment_image` computes with, in cubic voxels.

    Returns:
        Grey values; where the sample is, or None; the true labels, or None; and a dictionary: size
        of voxels in the file, edge of the cubes, notices.
    """
    notices = []
    raw, stated = read_with_size(
        path,
        shape=settings.shape,
        dtype=settings.dtype,
        key=settings.key,
        axes=settings.axes,
        crop=settings.crop,
        grey=True,
        gaps=True,
        notices=notices,
    )
    size = known_voxel_size(settings.voxel_size, stated, path)
    true = None if truth is None else true_labels(truth, raw.shape, size, settings, notices)
    inside, line = field_of_view(
        raw, settings.mask, source=str(path), axes=settings.axes, crop=settings.crop
    )
    notices += [line] if line else []
    raw = inverted(raw) if settings.invert else raw
    raw, edge = images.to_cubes(raw, size)
    if inside is not None:
        inside, _ = images.to_cubes(inside, size, labels=True)
    return raw, inside, true, {"size": size, "edge": edge, "notices": notices}


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
            given.cylinder and (given.cylinder.x, given.cylinder.y, given.cylinder.radius),
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
        **_cylinder_numbers(given, done),
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
    cylinder = _cylinder(path, settings, labels.shape, voxel_size)
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


def _cylinder(path, settings, shape, voxel_size):
    """The `Cylinder` that cuts the grains of labels [m], or None.

    Raises:
        InputError: It is not within the image, or grains share their facets.
    """
    stated = stated_cylinder(path)
    given = settings.cylinder_middle, settings.cylinder_radius
    if stated is None and given == (None, None):
        return None
    sides = [n * voxel_size for n in shape[1:]]
    y, x = (side / 2 for side in sides)
    if settings.cylinder_middle is not None:
        x, y = settings.cylinder_middle
    elif stated is not None:
        x, y = stated["x"], stated["y"]
    room = min(x, y, sides[1] - x, sides[0] - y)
    if stated is not None:
        room = stated["radius"] - float(np.hypot(x - stated["x"], y - stated["y"]))
    radius = room if settings.cylinder_radius is None else settings.cylinder_radius
    if not 0 < radius <= room * (1 + 1e-9):
        raise InputError(
            f"cylinder_radius = {radius:g} m about (x, y) = ({x:g}, {y:g}) m, expected > 0 and at "
            f"most {room:g} m, within the labels {path}"
        )
    if given == (None, None) and not stated["cut"]:
        return None
    if settings.conforming:
        raise InputError(
            "conforming = true with a cylinder that cuts grains, expected false: only faces of the "
            "image cut grains that share their facets"
        )
    return Cylinder(float(x), float(y), float(radius))


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


def _cylinder_numbers(given, meshes):
    """What was cut by a cylinder; {} where the sample has none."""
    if given.cylinder is None:
        return {}
    cylinder = given.cylinder
    x, y, radius = cylinder.x, cylinder.y, cylinder.radius
    area = sum(area_on_cylinder(mesh.points, mesh.cells, (x, y, radius)) for mesh in meshes)
    return {
        "cylinder_x_m": x,
        "cylinder_y_m": y,
        "cylinder_radius_m": radius,
        "rim_grains_left_out": given.left_out,
        "round_faces_share": float(area / (2 * np.pi * radius * np.ptp(given.box[:, 2]))),
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
