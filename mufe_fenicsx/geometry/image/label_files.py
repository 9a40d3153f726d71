"""Labels on disk: a TIFF that knows its voxel size, and a table of its grains."""

import csv
import json
from pathlib import Path

import numpy as np
import scipy.ndimage
import tifffile

from ...errors import InputError
from ...machine.files import replacing
from .array_file import array_names
from .image import to_cubes
from .image_files import read_with_size
from .label_defects import defects_of
from .labels import doubts_about, plain_labels
from .tiff_file import TIFF
from .voxel_size import known_voxel_size, own_description, own_voxel_size

TABLE = (
    "label",
    "volume_m3",
    "equivalent_diameter_m",
    "centroid_x_m",
    "centroid_y_m",
    "centroid_z_m",
    "voxels",
    "touches_border",
)


def write_labels(path, labels, voxel_size, cylinder=None):
    """Write labels as compressed TIFF with the voxel size [m] in its description.

    Args:
        path: File.
        labels: (z, y, x).
        voxel_size: [m].
        cylinder: {"x", "y", "radius": [m], "cut": whether it cuts grains}, or None.
    """
    about = {"voxel_size": float(voxel_size), "axes": "zyx"}
    description = json.dumps(about if cylinder is None else about | {"cylinder": cylinder})
    largest = labels.max(initial=0)
    kind = np.uint16 if largest < 2**16 else np.int32
    try:
        with replacing(path) as part:
            tifffile.imwrite(
                part, labels.astype(kind), description=description, metadata=None,
                compression="zlib", photometric="minisblack",
            )  # fmt: skip
    except OSError as error:
        raise InputError(f"labels {path} cannot be written: {error}") from error


def read_labels(
    path,
    *,
    voxel_size=None,
    unstated=None,
    key=None,
    shape=None,
    dtype=None,
    axes=None,
    numbers=None,
    notices=None,
):
    """Read labels and their voxel size.

    Args:
        path: An image (see `image_files.read_with_size`), from here or elsewhere; a .npz
            with an array "labels". Fiji writes labels as floating point numbers: those are taken
            if they are whole.
        voxel_size: Voxel size of a file that does not state it [m], or three (z, y, x).
        unstated: Voxel size where the file does not state it and `voxel_size` is not given [m].
        key, shape, dtype, axes, notices: See `image_files.read_with_size`.
        numbers: See `labels.plain_labels`.

    Returns:
        labels on cubes, integers from 0; and the voxel size [m].

    Raises:
        InputError: the file cannot be read or the voxel size is not known.
    """
    path = Path(path)
    key = labels_key(path) if key is None else key
    labels, stated = read_with_size(
        path, shape=shape, dtype=dtype, key=key, axes=axes, notices=notices
    )
    size = known_voxel_size(voxel_size, unstated if stated is None else stated, path)
    own = _own_voxel_size(path)
    if own is not None and abs(max(size) / own - 1) + abs(min(size) / own - 1) > 1e-9:
        raise InputError(
            f"voxel_size = {voxel_size} m, but {path} states {own} m, expected one of them only"
        )
    labels = plain_labels(labels, path, numbers)
    if notices is not None:
        notices += doubts_about(labels, path) + defects_of(labels, path)
    return to_cubes(labels, size, labels=True)


def grain_table(labels, voxel_size, inside=None):
    """One dictionary a grain: size, place and whether the image's border cuts it.

    Args:
        labels: 0 void, grains from 1, (z, y, x).
        voxel_size: [m].
        inside: True in the field of view, whose rim is a border, too; None: all of the image.
    """
    voxels = np.bincount(labels.ravel())
    present = np.flatnonzero(voxels)
    present = present[present > 0]
    centres = scipy.ndimage.center_of_mass(labels > 0, labels, present)
    border = np.zeros(len(voxels), dtype=bool)
    for axis in range(3):
        for end in (0, -1):
            border[np.unique(labels.take(end, axis=axis))] = True
    if inside is not None:
        border[np.unique(labels[scipy.ndimage.binary_dilation(~inside)])] = True
    rows = []
    for label, (z, y, x) in zip(present, centres, strict=True):
        volume = voxels[label] * voxel_size**3
        values = (
            int(label),
            float(volume),
            float((6 * volume / np.pi) ** (1 / 3)),
            *(float((c + 0.5) * voxel_size) for c in (x, y, z)),
            int(voxels[label]),
            bool(border[label]),
        )
        rows.append(dict(zip(TABLE, values, strict=True)))
    return rows


def write_table(path, rows, columns=None):
    """Write dictionaries as CSV, columns in the order of the first row."""
    columns = list(columns or rows[0])
    try:
        with replacing(path) as part, part.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, columns, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(rows)
    except OSError as error:
        raise InputError(f"table {path} cannot be written: {error}") from error


def labels_key(path):
    """Name of the array with labels in a .npz file that holds one, or None."""
    return "labels" if "labels" in array_names(path) else None


def stated_cylinder(path):
    """What :func:`write_labels` wrote of a cylinder, or None.

    Raises:
        InputError: What stands there is none.
    """
    path = Path(path)
    if path.is_dir() or path.suffix.lower() not in TIFF:
        return None
    with tifffile.TiffFile(path) as file:
        found = own_description(file).get("cylinder")
    if found is None:
        return None
    numbers = [found.get(name) for name in ("x", "y", "radius")] if isinstance(found, dict) else []
    good = numbers and all(isinstance(v, int | float) and np.isfinite(v) for v in numbers)
    if not (good and found["radius"] > 0):
        raise InputError(
            f"{path} states the cylinder {found}, expected x, y and a radius > 0 in metres"
        )
    return found


def _own_voxel_size(path):
    """The voxel size in the description of a TIFF that was written here, or None."""
    if path.is_dir() or path.suffix.lower() not in TIFF:
        return None
    with tifffile.TiffFile(path) as file:
        return own_voxel_size(file)
