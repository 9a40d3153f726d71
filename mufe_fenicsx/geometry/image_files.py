"""Read three-dimensional images, whole or in part, from the formats of tomography.

Images come back with the axes (z, y, x): slice, row, column.
"""

import logging
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import tifffile

from ..errors import InputError
from .raw_file import open_raw
from .stated_size import tiff_voxel_size

# What is wrong with a file is said in our own line.
logging.getLogger("tifffile").setLevel(logging.CRITICAL)

TIFF, NUMPY, RAW = (".tif", ".tiff"), (".npy", ".npz"), (".raw", ".bin")
HDF5 = (".h5", ".hdf5", ".nxs")
ITK = (".mhd", ".mha", ".nrrd", ".nhdr", ".nii", ".nii.gz")
AVIZO = (".am", ".amiramesh", ".hx")


@dataclass
class Stored:
    """Voxels on disk, in the order of axes of the file."""

    voxels: Any  #: has a shape, and gives a part by slices
    voxel_size: tuple | None = None  #: along each axis of the file, if that states it [m]

    @property
    def shape(self):
        """Voxels along each axis."""
        return tuple(self.voxels.shape)


def read_image(path, *, shape=None, dtype=None, key=None, axes="zyx", crop=None):
    """Read an image, or a part of it; see `read_with_size`. Returns the voxels alone."""
    return read_with_size(path, shape=shape, dtype=dtype, key=key, axes=axes, crop=crop)[0]


def read_with_size(path, *, shape=None, dtype=None, key=None, axes="zyx", crop=None):
    """Read an image, or only a part of it, and its voxel size.

    Args:
        path: A TIFF stack, a folder of TIFF slices (taken in natural order of
            their names: slice2 before slice10), .npy, .npz, .h5, .mhd, .mha, .nrrd, .nii, .raw.
        shape: Voxels of a raw file along its axes, the last one fastest.
        dtype: Type of a raw file's voxels, as NumPy writes it: "<u2", big endian ">u2".
        key: Name of the array in a .npz or .h5 file that holds several.
        axes: Order of the axes in the file, slowest first: "zyx", or "xyz" and so on.
        crop: ((z0, z1), (y0, y1), (x0, x1)), ends excluded. Of uncompressed TIFF, .npy,
            .h5 and raw files no more than that is read.

    Returns:
        The image, shape (z, y, x); and the voxel size (z, y, x) that the file states [m], or None.

    Raises:
        InputError: there is no such file, it cannot be read, or it is not a
            numeric image with three axes and finite values.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"no image {path}, expected a file or a folder of TIFF slices")
    if sorted(axes) != ["x", "y", "z"]:
        raise InputError(f'axes = "{axes}", expected an order of z, y and x such as "zyx"')
    try:
        with _opened(path, shape, dtype, key) as stored:
            if len(stored.shape) != 3:
                raise InputError(
                    f"image {path} has {len(stored.shape)} axes, shape {stored.shape}, "
                    "expected 3: (z, y, x)"
                )
            order = [axes.index(axis) for axis in "zyx"]
            whole = tuple(stored.shape[k] for k in order)
            ranges = [(0, n) for n in whole] if crop is None else check_crop(crop, whole)
            part = stored.voxels[tuple(slice(*ranges["zyx".index(axis)]) for axis in axes)]
            image = np.ascontiguousarray(np.transpose(part, order))
            size = stored.voxel_size and tuple(stored.voxel_size[k] for k in order)
    except InputError:
        raise
    except (
        *(OSError, EOFError, ValueError, KeyError, IndexError, TypeError, RuntimeError),
        *(tifffile.TiffFileError, zipfile.BadZipFile),
    ) as error:
        text = " ".join(str(error).split())
        raise InputError(f"image {path} cannot be read: {text}") from error
    return _checked(path, image), size


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


class _opened:
    """Context in which an image is open as `Stored`."""

    def __init__(self, path, shape, dtype, key):
        self.path, self.shape, self.dtype, self.key = path, shape, dtype, key
        self.file = None

    def __enter__(self):
        path, name = self.path, self.path.name.lower()
        if path.is_dir():
            return Stored(_Slices(path))
        if name.endswith(TIFF):
            self.file = tifffile.TiffFile(path)
            return Stored(_TiffVoxels(self.file, path), tiff_voxel_size(self.file))
        if name.endswith(NUMPY):
            return Stored(_numpy_voxels(path, self.key))
        if name.endswith(RAW):
            return Stored(open_raw(path, self.shape, self.dtype))
        if name.endswith(HDF5):
            self.file = h5py.File(path, "r")
            return _hdf5_voxels(self.file, path, self.key)
        if name.endswith(ITK):
            voxels = _ItkVoxels(path)
            return Stored(voxels, voxels.voxel_size)
        if name.endswith(AVIZO):
            raise InputError(
                f"image {path} is in the format of Amira and Avizo, which no library here reads, "
                "expected an export as TIFF, NRRD, HDF5 or raw"
            )
        kinds = ", ".join((*TIFF, *NUMPY, *RAW, *HDF5, *ITK))
        raise InputError(
            f"image {path} ends in {path.suffix!r}, expected one of {kinds} "
            "or a folder of TIFF slices"
        )

    def __exit__(self, *error):
        if self.file is not None:
            self.file.close()


class _TiffVoxels:
    """A stack of pages; read where it lies if it is not compressed, else page by page."""

    def __init__(self, file, path):
        self.series = file.series[0] if file.series else None
        if self.series is None:
            raise InputError(f"image {path} holds no page, expected a TIFF stack")
        self.path, self.shape = path, tuple(self.series.shape)

    def __getitem__(self, where):
        if self.series.dataoffset is not None and len(self.shape) == 3:
            return np.array(tifffile.memmap(self.path, series=0, mode="r")[where])
        if len(self.series.pages) != self.shape[0]:
            return self.series.asarray()[where]
        pages = range(*where[0].indices(self.shape[0]))
        return np.stack([self.series.pages[k].asarray()[where[1:]] for k in pages])


class _Slices:
    """A folder of TIFF slices, of which only those that are asked for are read."""

    def __init__(self, folder):
        self.files = sorted(
            (f for f in folder.iterdir() if f.suffix.lower() in TIFF), key=natural_order
        )
        if not self.files:
            raise InputError(f"folder {folder} holds no .tif or .tiff, expected slices of an image")
        first = None
        for name in self.files:
            with tifffile.TiffFile(name) as file:
                shape = tuple(file.series[0].shape)
            first = first or shape
            if len(shape) != 2 or shape != first:
                raise InputError(
                    f"slice {name.name} has shape {shape}, expected {first[:2]} "
                    f"as the first slice, {self.files[0].name}"
                )
        self.shape = (len(self.files), *first)

    def __getitem__(self, where):
        return np.stack([tifffile.imread(name)[where[1:]] for name in self.files[where[0]]])


class _ItkVoxels:
    """A file that SimpleITK reads; spacings are in millimetres, as ITK has them."""

    def __init__(self, path):
        import SimpleITK

        SimpleITK.ProcessObject.SetGlobalWarningDisplay(False)
        self.sitk, self.reader = SimpleITK, SimpleITK.ImageFileReader()
        self.reader.SetFileName(str(path))
        self.reader.ReadImageInformation()
        if self.reader.GetNumberOfComponents() != 1:
            raise InputError(
                f"image {path} has {self.reader.GetNumberOfComponents()} numbers a voxel, "
                "expected one"
            )
        self.shape = tuple(self.reader.GetSize()[::-1])
        self.voxel_size = tuple(1e-3 * s for s in self.reader.GetSpacing()[::-1])

    def __getitem__(self, where):
        self.reader.SetExtractIndex([s.start for s in where][::-1])
        self.reader.SetExtractSize([s.stop - s.start for s in where][::-1])
        return self.sitk.GetArrayFromImage(self.reader.Execute())


def _numpy_voxels(path, key):
    # allow_pickle=False: a pickled object could run code while it is read.
    data = np.load(path, allow_pickle=False, mmap_mode="r")
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
    return _only_one({n: array for n, array in volumes.items() if array.ndim == 3}, path)


def _hdf5_voxels(file, path, key):
    if key is None:
        found = {}

        def keep(name, item):
            if isinstance(item, h5py.Dataset) and item.ndim == 3:
                found[name] = item

        file.visititems(keep)
        data = _only_one(found, path)
    else:
        data = file.get(key)
        if not isinstance(data, h5py.Dataset):
            raise InputError(f"no data set {key!r} in {path}, expected one of {_names(file)}")
    size = data.attrs.get("element_size_um")  # as ilastik and the HDF5 plugin of ImageJ write it
    if size is not None and np.size(size) == 3:
        return Stored(data, tuple(1e-6 * float(s) for s in size))
    return Stored(data)


def _names(file):
    names = []
    file.visititems(lambda name, item: names.append(name) if hasattr(item, "shape") else None)
    return ", ".join(names) or "none"


def _only_one(volumes, path):
    if len(volumes) != 1:
        raise InputError(
            f"{path} holds {len(volumes)} arrays with three axes ({', '.join(volumes)}), "
            "expected one, or its name as key"
        )
    return next(iter(volumes.values()))


def _checked(path, image):
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
