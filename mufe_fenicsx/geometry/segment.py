"""From a grey image to labelled grains, with their tables and a picture."""

import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..machine.files import new_files
from .image import image as images
from .image.compare_labels import compare_labels, fitted, true_labels
from .image.contact_faces import contact_table
from .image.field_of_view import field_of_view
from .image.image_files import inverted, read_with_size
from .image.label_files import grain_table, write_labels, write_table
from .image.picture import draw_refusal, draw_segmentation
from .image.quality_flags import mark_doubts
from .image.round_sample import round_sample
from .image.segmentation import resampled_mask, segment
from .image.threshold import NoThreshold
from .image.tiff_file import TIFF
from .image.voxel_size import known_voxel_size
from .round_cut import numbers_of, place_of
from .settings import CUT, WHOLE

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
        about = None if sample is None else place_of(cylinder) | {"cut": sample.rim == CUT}
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
        **({} if sample is None else numbers_of(cylinder) | {"rim": sample.rim}),
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
