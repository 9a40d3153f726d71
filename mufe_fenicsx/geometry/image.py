"""Read a three-dimensional grey image; crop, resample and smooth it.

Axes are (z, y, x): slice, row, column.
"""

import math
import re
import zipfile
from pathlib import Path

import numpy as np
import scipy.ndimage
import tifffile

from ..errors import InputError

TIFF, NUMPY, RAW = (".tif", ".tiff"), (".npy", ".npz"), (".raw", ".bin")


def read_image(path, *, shape=None, dtype=None, key=None):
    """Read an image of shape (z, y, x).

    Args:
        path: A TIFF stack, a folder of TIFF slices (taken in natural order of
            their names: slice2 before slice10), .npy, .npz, .raw or .bin.
        shape: (z, y, x) of a raw file.
        dtype: Type of a raw file's voxels, as NumPy writes it: "<u2".
        key: Name of the array in an .npz file that holds several.

    Raises:
        InputError: there is no such file, it cannot be read, or it is not a
            numeric image with three axes and finite values.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"no image {path}, expected a file or a folder of TIFF slices")
    kind = path.suffix.lower()
    try:
        if path.is_dir():
            image = _read_slices(path)
        elif kind in TIFF:
            image = tifffile.imread(path)
        elif kind in NUMPY:
            image = _read_numpy(path, key)
        elif kind in RAW:
            image = _read_raw(path, shape, dtype)
        else:
            raise InputError(
                f"image {path} ends in {kind!r}, expected one of {', '.join(TIFF + NUMPY + RAW)} "
                "or a folder of TIFF slices"
            )
    except InputError:
        raise
    except (OSError, EOFError, ValueError, KeyError, IndexError, TypeError) as error:
        raise InputError(f"image {path} cannot be read: {_one_line(error)}") from error
    except (tifffile.TiffFileError, zipfile.BadZipFile) as error:
        raise InputError(f"image {path} cannot be read: {_one_line(error)}") from error
    return _checked(path, image)


def crop(image, ranges):
    """The part ((z0, z1), (y0, y1), (x0, x1)) of an image; ends are excluded."""
    if len(ranges) != 3:
        raise InputError(f"crop has {len(ranges)} ranges, expected 3: ((z0,z1), (y0,y1), (x0,x1))")
    for axis, (first, last), size in zip("zyx", ranges, image.shape, strict=True):
        if not 0 <= first < last <= size:
            raise InputError(
                f"crop along {axis} = {first} to {last}, expected a range within 0 to {size}"
            )
    return np.ascontiguousarray(image[tuple(slice(*r) for r in ranges)])


def resample(image, factor, *, labels=False):
    """The image on voxels ``factor`` times finer; the domain stays the same.

    Grey values are interpolated by cubic splines, labels taken from the
    nearest voxel. Before coarsening, grey values are averaged by a Gaussian.
    """
    if not factor > 0:
        raise InputError(f"upsample = {factor}, expected > 0")
    if factor == 1:
        return image
    if min(round(n * factor) for n in image.shape) < 1:
        raise InputError(f"upsample = {factor} leaves no voxel of an image of {image.shape}")
    if labels:
        return scipy.ndimage.zoom(image, factor, order=0, mode="nearest", grid_mode=True)
    image = image.astype(np.float32)
    if factor < 1:
        image = scipy.ndimage.gaussian_filter(image, 0.5 / factor, mode="nearest")
    return scipy.ndimage.zoom(image, factor, order=3, mode="nearest", grid_mode=True)


def smooth(image, kind="gaussian", radius=1.0):
    """The image filtered against noise, as float32.

    Args:
        kind: "gaussian", "median" or "none".
        radius: Standard deviation of the Gaussian, or radius of the ball
            whose median is taken [voxels].
    """
    image = image.astype(np.float32)
    if kind == "none" or radius == 0:
        return image
    if kind == "gaussian":
        return scipy.ndimage.gaussian_filter(image, radius, mode="nearest")
    if kind == "median":
        r = math.floor(radius)
        z, y, x = np.ogrid[-r : r + 1, -r : r + 1, -r : r + 1]
        ball = z * z + y * y + x * x <= radius * radius
        return scipy.ndimage.median_filter(image, footprint=ball, mode="nearest")
    raise InputError(f'filter = {kind!r}, expected "gaussian", "median" or "none"')


def natural_order(path):
    """Key that sorts names with their numbers by value."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", Path(path).name)]


def _read_slices(folder):
    files = sorted((f for f in folder.iterdir() if f.suffix.lower() in TIFF), key=natural_order)
    if not files:
        raise InputError(f"folder {folder} holds no .tif or .tiff, expected slices of an image")
    slices = [tifffile.imread(file) for file in files]
    for file, part in zip(files, slices, strict=True):
        if part.ndim != 2 or part.shape != slices[0].shape:
            raise InputError(
                f"slice {file.name} has shape {part.shape}, expected {slices[0].shape[:2]} "
                "as the first slice"
            )
    return np.stack(slices)


def _read_numpy(path, key):
    # allow_pickle=False: a pickled object could run code while it is read.
    data = np.load(path, allow_pickle=False)
    if isinstance(data, np.ndarray):
        return data
    with data:
        if key is not None:
            if key not in data.files:
                raise InputError(
                    f"no array {key!r} in {path}, expected one of {', '.join(data.files)}"
                )
            return data[key]
        volumes = {name: data[name] for name in data.files}
    volumes = {name: array for name, array in volumes.items() if array.ndim == 3}
    if len(volumes) != 1:
        raise InputError(
            f"{path} holds {len(volumes)} arrays with three axes ({', '.join(volumes)}), "
            "expected one, or its name as key"
        )
    return next(iter(volumes.values()))


def _read_raw(path, shape, dtype):
    if shape is None or dtype is None:
        raise InputError(f"raw image {path}: shape = {shape}, dtype = {dtype}, expected both")
    try:
        dtype = np.dtype(dtype)
    except TypeError as error:
        raise InputError(f'dtype = {dtype!r}, expected a NumPy type such as "<u2"') from error
    if dtype.hasobject or len(shape) != 3 or min(shape) < 1:
        raise InputError(f"shape = {shape}, dtype = {dtype}, expected (z, y, x) and a number type")
    expected, size = math.prod(shape) * dtype.itemsize, path.stat().st_size
    if size != expected:
        raise InputError(
            f"{path} has {size} bytes, expected {expected} = "
            f"{' x '.join(map(str, shape))} voxels of {dtype}"
        )
    return np.fromfile(path, dtype=dtype).reshape(shape)


def _checked(path, image):
    if image.ndim != 3:
        raise InputError(
            f"image {path} has {image.ndim} axes, shape {image.shape}, expected 3: (z, y, x)"
        )
    if image.dtype.kind not in "buif" or image.size == 0:
        raise InputError(
            f"image {path} has type {image.dtype}, shape {image.shape}, expected numbers"
        )
    if image.dtype.kind == "f" and not np.isfinite(image).all():
        bad = np.argwhere(~np.isfinite(image))
        raise InputError(
            f"image {path} has {len(bad)} voxels that are NaN or infinite, the first at "
            f"(z, y, x) = {tuple(bad[0].tolist())}, expected finite values"
        )
    return image


def _one_line(error):
    return " ".join(str(error).split())
