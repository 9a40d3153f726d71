"""Read three-dimensional images, whole or in part, from the formats of tomography.

Images come back with the axes (z, y, x): slice, row, column.
"""

import math
import re
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import tifffile

from ...errors import InputError
from ...machine.memory import check_room
from .array_file import open_hdf5, open_numpy
from .itk_file import ITK, open_itk
from .picture_file import PICTURES
from .raw_file import open_raw
from .stored_image import Stored, check_regular, errors_of_readers
from .tiff_file import TIFF, open_slices, open_tiff

NUMPY, RAW = (".npy", ".npz"), (".raw", ".bin")
HDF5 = (".h5", ".hdf5", ".nxs")
AVIZO = (".am", ".amiramesh", ".hx")


def read_image(path, *, shape=None, dtype=None, key=None, axes=None, crop=None):
    """Read an image, or a part of it; see `read_with_size`. Returns the voxels alone."""
    return read_with_size(path, shape=shape, dtype=dtype, key=key, axes=axes, crop=crop)[0]


def read_with_size(
    path,
    *,
    shape=None,
    dtype=None,
    key=None,
    axes=None,
    crop=None,
    grey=False,
    gaps=False,
    notices=None,
):
    """Read an image, or only a part of it, and its voxel size.

    Args:
        path: A TIFF stack, a folder of TIFF, PNG, JPEG or BMP slices (in natural order of
            their names: slice2 before slice10), .npy, .npz, .h5, .mhd, .mha, .nrrd, .nii, .raw.
        shape: Voxels of a raw file along its axes, the last one fastest.
        dtype: Type of a raw file's voxels, as NumPy writes it: "<u2", big endian ">u2".
        key: Name of the array in a .npz or .h5 file that holds several; number of the series in
            a TIFF that does.
        axes: Order of the axes in the file, slowest first: "zyx", or "xyz" and so on. None: as
            the file states it, else "zyx".
        crop: ((z0, z1), (y0, y1), (x0, x1)), ends excluded. Of uncompressed TIFF, .npy,
            .h5 and raw files no more than that is read.
        grey: Turn the levels round where a TIFF states that its zeros are white.
        gaps: Let voxels be NaN.
        notices: A list to which lines are added on what was done to make one image of the file.

    Returns:
        The image, shape (z, y, x); and the voxel size (z, y, x) that the file states [m], a text
        where what it states is no length along each axis, or None.

    Raises:
        InputError: there is no such file, it cannot be read, some of its bytes are missing, it
            does not fit into the memory that is free, or it is not a numeric image with three
            axes and finite values.
    """
    path = Path(path)
    notices = [] if notices is None else notices
    if axes is not None and sorted(axes) != ["x", "y", "z"]:
        raise InputError(f'axes = "{axes}", expected an order of z, y and x such as "zyx"')
    with errors_of_readers(path):
        if not path.exists():
            raise InputError(f"no image {path}, expected a file or a folder of slices")
        if not path.is_dir():
            check_regular(path, path)
        with _opened(path, shape, dtype, key) as stored:
            axes = stored.order(axes, path)
            order = [axes.index(axis) for axis in "zyx"]
            ranges = _ranges(path, stored, order, crop)
            part = stored.voxels[tuple(slice(*ranges["zyx".index(axis)]) for axis in axes)]
            image = np.ascontiguousarray(np.transpose(part, order))
            size = stored.voxel_size
            if isinstance(size, tuple):
                size = tuple(size[k] for k in order)
            notices.extend(stored.notices)
            if grey and stored.white_is_zero:
                image = inverted(image)
                notices.append(f"zeros of {path} are white, as the file states: levels turned")
        return _checked(path, image, gaps), size


def inverted(image):
    """The image with its levels turned round: what was bright is dark. Same type, same range."""
    if image.dtype == bool:
        return ~image
    low, high = (np.nanmin(image), np.nanmax(image)) if image.size else (0, 0)
    if image.dtype.kind == "f":
        return (low - image) + high
    # In steps that stay within the type.
    return (high - image) + low if low >= 0 else ~image + (high + low + 1)


def check_crop(ranges, shape):
    """The ranges of a crop, if they lie within an image of this shape."""
    if len(ranges) != 3:
        raise InputError(f"crop has {len(ranges)} ranges, expected 3: ((z0,z1), (y0,y1), (x0,x1))")
    for axis, (first, last), size in zip("zyx", ranges, shape, strict=True):
        if not 0 <= first < last <= size:
            raise InputError(
                f"crop along {axis} = {first} to {last}, expected a range within 0 to {size}"
            )
    return ranges


def natural_order(path):
    """Key that sorts names with their numbers by value."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", Path(path).name)]


def files_in(folder, endings):
    """Files of a folder with these endings, in natural order.

    Hidden ones are left out: macOS puts a "._slice1.tif" beside each slice1.tif.
    """
    files = [f for f in Path(folder).iterdir() if f.suffix.lower() in endings]
    return sorted((f for f in files if not f.name.startswith(".")), key=natural_order)


@contextmanager
def _opened(path, shape, dtype, key):
    """Context in which an image is open as `Stored`."""
    name = path.name.lower()
    if path.is_dir():
        # Pictures beside TIFF slices are looks at them.
        yield open_slices(path, files_in(path, TIFF) or files_in(path, PICTURES))
    elif name.endswith(TIFF):
        with tifffile.TiffFile(path) as file:
            yield open_tiff(file, path, key)
    elif name.endswith(NUMPY):
        yield open_numpy(path, key)
    elif name.endswith(RAW):
        yield Stored(open_raw(path, shape, dtype))
    elif name.endswith(HDF5):
        with h5py.File(path, "r") as file:
            yield open_hdf5(file, path, key)
    elif name.endswith(ITK):
        yield open_itk(path)
    elif name.endswith(AVIZO):
        raise InputError(
            f"image {path} is in the format of Amira and Avizo, which no library here reads, "
            "expected an export as TIFF, NRRD, HDF5 or raw"
        )
    else:
        kinds = ", ".join((*TIFF, *NUMPY, *RAW, *HDF5, *ITK))
        raise InputError(
            f"image {path} ends in {path.suffix!r}, expected one of {kinds} or a folder of slices"
        )


def _ranges(path, stored, order, crop):
    """The part of the image that is wanted, (z, y, x), if it is one and fits into the memory."""
    dtype = np.dtype(stored.voxels.dtype)
    if dtype.kind not in "buif" or dtype.subdtype or 0 in stored.shape:
        raise InputError(f"image {path} has type {dtype}, shape {stored.shape}, expected numbers")
    if len(stored.shape) != 3:
        raise InputError(
            f"image {path} has {len(stored.shape)} axes, shape {stored.shape}, "
            "expected 3: (z, y, x)"
        )
    whole = tuple(stored.shape[k] for k in order)
    ranges = [(0, n) for n in whole] if crop is None else check_crop(crop, whole)
    part = whole if stored.whole else [last - first for first, last in ranges]
    check_room(
        math.prod(part) * dtype.itemsize,
        f"image {path} of {' x '.join(map(str, part))} voxels of {dtype}",
        "" if stored.whole else "; crop reads a part of it",
    )
    return ranges


def _checked(path, image, gaps):
    if image.dtype.kind == "f":
        bad = ~np.isfinite(image) if not gaps else np.isinf(image)
        if bad.any():
            first = np.unravel_index(int(np.argmax(bad)), bad.shape)
            raise InputError(
                f"image {path} has {np.count_nonzero(bad)} voxels that are NaN or infinite, the "
                f"first at (z, y, x) = {tuple(int(k) for k in first)}, expected finite values"
            )
    return image
