"""Arrays in the files of NumPy and HDF5."""

import itertools
import json
import math
import zipfile
from pathlib import Path

import h5py
import numpy as np

from ...errors import InputError
from ...machine.memory import check_room
from .stored_image import Stored, check_regular, only_one, three_axes
from .voxel_size import metres


def open_numpy(path, key=None):
    """The voxels of a .npy or .npz file: `Stored`.

    Raises:
        InputError: none or several arrays with three axes, none called ``key``, or Python objects.
    """
    if not zipfile.is_zipfile(path):
        # allow_pickle=False: a pickled object could run code while it is read.
        return Stored(three_axes(np.load(path, allow_pickle=False, mmap_mode="r")))
    members = _members(path)
    if key is not None:
        if key not in members:
            raise InputError(f"no array {key!r} in {path}, expected one of {', '.join(members)}")
        return Stored(three_axes(members[key]), whole=True)
    volumes = {name: three_axes(array) for name, array in members.items()}
    found = {name: array for name, array in volumes.items() if len(array.shape) == 3}
    return Stored(only_one(found, path), whole=True)


def array_names(path):
    """Names of the arrays of a .npz, none where it is no such file or a damaged one."""
    path = Path(path)
    if path.suffix.lower() != ".npz" or not path.is_file():
        return set()
    try:
        with zipfile.ZipFile(path) as archive:
            return {name.removesuffix(".npy") for name in archive.namelist()}
    except Exception:  # whoever reads it says what is wrong
        return set()


def read_arrays(path, names, what):
    """Some arrays of a .npz, once it is known that they fit into the memory.

    Args:
        path: Its file.
        names: Their names.
        what: What the messages call the file.

    Raises:
        InputError: it cannot be read, or lacks one.
    """
    try:
        members = _members(path)
        lacking = [name for name in names if name not in members]
        if lacking:
            raise InputError(f"{what} {path} has no {lacking[0]}, expected {', '.join(names)}")
        chosen = [members[name] for name in names]
        check_room(sum(m.dtype.itemsize * math.prod(m.shape) for m in chosen), f"{what} {path}")
        return [member[()] for member in chosen]
    except InputError:
        raise
    except Exception as error:  # of many kinds where bytes are damaged
        text = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{what} {path} cannot be read: {text[:300]}") from error


class _Member:
    """An array within a .npz, of which only the header has been read."""

    def __init__(self, path, name, shape, dtype):
        self.path, self.name, self.shape, self.dtype = path, name, shape, dtype

    def __getitem__(self, where):
        with np.load(self.path, allow_pickle=False) as data:
            return data[self.name][where]


def _members(path):
    """Arrays of a .npz by name: what a bomb unpacks to is in its header."""
    found = {}
    with zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            if not info.filename.endswith(".npy"):
                continue
            with archive.open(info) as file:
                version = np.lib.format.read_magic(file)
                read = {
                    (1, 0): np.lib.format.read_array_header_1_0,
                    (2, 0): np.lib.format.read_array_header_2_0,
                }.get(version)
                if read is None:
                    raise InputError(f"{path}: {info.filename} has format {version} of NumPy")
                shape, _, dtype = read(file)
                if dtype.hasobject:
                    raise InputError(f"{path}: Object arrays cannot be loaded, expected numbers")
                expected = file.tell() + math.prod(shape) * dtype.itemsize
                if info.file_size != expected:
                    raise InputError(
                        f"{path}: {info.filename} has {info.file_size} bytes, expected {expected}"
                    )
            name = info.filename.removesuffix(".npy")
            found[name] = _Member(path, name, tuple(shape), dtype)
    return found


def open_hdf5(file, path, key=None):
    """The voxels of an open `h5py.File`, with the size that ilastik and ImageJ state: `Stored`.

    Raises:
        InputError: none or several data sets with three axes, or none called ``key``.
    """
    if key is None:
        found = {}

        def keep(name, item):
            if isinstance(item, h5py.Dataset) and _num_axes(item.shape) == 3:
                found[name] = item

        file.visititems(keep)
        data = only_one(found, path)
    else:
        _check_links(file, path, key)
        data = file.get(key)
        if not isinstance(data, h5py.Dataset):
            raise InputError(f"no data set {key!r} in {path}, expected one of {_names(file)}")
    if data.shape is None:
        raise InputError(f"data set {data.name} of {path} is empty, expected voxels")
    _check_sources(data, path)
    size = data.attrs.get("element_size_um")  # as ilastik and the HDF5 plugin of ImageJ write it
    if size is not None and np.size(size) == 3 and np.issubdtype(np.asarray(size).dtype, np.number):
        size = tuple(1e-6 * float(s) for s in np.ravel(size))
    else:
        size = _steps(_scales(data)) if len(data.shape) == 3 else None
    return Stored(three_axes(_DataSet(data, path)), size)


class _DataSet:
    """A data set of which no part is made up: HDF5 gives zeros where nothing was written."""

    def __init__(self, data, path):
        self.data, self.path = data, path
        self.shape, self.dtype = data.shape, data.dtype
        self.letters = _letters(data)

    def __getitem__(self, where):
        self._check_written(where)
        return self.data[where]

    def _check_written(self, where):
        data = self.data
        if data.is_virtual or data.external:
            return  # looked at before
        if data.chunks is None:
            stored = data.id.get_storage_size()
            expected = math.prod(data.shape) * data.dtype.itemsize
            if stored < expected:
                raise InputError(
                    f"data set {data.name} of {self.path} has {stored} bytes, expected {expected}"
                )
            return
        counts = [-(-n // c) for n, c in zip(data.shape, data.chunks, strict=True)]
        if data.id.get_num_chunks() == math.prod(counts):
            return
        ranges = [
            range(s.start // c, -(-s.stop // c)) for s, c in zip(where, data.chunks, strict=True)
        ]
        for at in itertools.product(*ranges):
            corner = tuple(k * c for k, c in zip(at, data.chunks, strict=True))
            if data.id.get_chunk_info_by_coord(corner).byte_offset is None:
                raise InputError(
                    f"data set {data.name} of {self.path} lacks the chunk at {corner}, expected "
                    "all that is read to have been written"
                )


def _scales(data):
    """Data sets along the axes of another in its group, by NeXus or EMD (dim1 …)."""
    names = np.ravel(data.parent.attrs.get("axes", []))
    if len(names) != len(data.shape):
        names = [f"dim{k}" for k in range(1, len(data.shape) + 1)]
    names = [n.decode() if isinstance(n, bytes) else str(n) for n in names]
    found = [data.parent.get(name) for name in names]
    sizes = zip(found, data.shape, strict=True)
    right = all(isinstance(one, h5py.Dataset) and one.shape == (size,) for one, size in sizes)
    return found if right else []


def _steps(scales):
    """Lengths of voxels [m] by the places along axes, a text where they have no unit, or None."""
    lengths, words = [], []
    for scale in scales:
        place = scale[()] if scale.dtype.kind in "iuf" else np.zeros(0)
        step = np.diff(place.astype(float))
        if len(step) == 0 or not np.allclose(step, step[0], rtol=1e-3) or step[0] == 0:
            return None
        unit = scale.attrs.get("units", "")
        unit = unit.decode() if isinstance(unit, bytes) else str(unit)
        factor = metres(unit.strip("[]").replace("_", ""))
        lengths.append(factor and abs(float(step[0])) * factor)
        words.append(f"{abs(step[0]):.6g} {unit}".strip())
    return (tuple(lengths) if all(lengths) else " x ".join(words)) if lengths else None


def _letters(data):
    """What a data set calls its axes, in the ways of vigra, HDF5, NeXus and EMD, or ""."""
    try:
        tags = json.loads(data.attrs.get("axistags", "{}")).get("axes", [])
        found = [str(tag["key"]) for tag in tags]
    except (ValueError, TypeError, KeyError, AttributeError):
        found = []
    if not found:
        found = [dimension.label for dimension in data.dims]
    if not any(found):
        scales = _scales(data)
        found = [scale.attrs.get("name", scale.name.rpartition("/")[2]) for scale in scales]
        found = [name.decode() if isinstance(name, bytes) else str(name) for name in found]
    right = len(found) == len(data.shape) and all(len(name) == 1 for name in found)
    return "".join(found).lower() if right else ""


def _num_axes(shape):
    """Axes that are left when those of length one are left out until there are three."""
    if shape is None:
        return 0
    return max(min(len(shape), 3), sum(n != 1 for n in shape))


def _check_sources(data, path):
    """Files that a data set takes its values from have to be there, with enough bytes."""
    folder = Path(path).parent
    if data.is_virtual:
        mapped = sum(source.vspace.get_select_npoints() for source in data.virtual_sources())
        if mapped < math.prod(data.shape):
            raise InputError(
                f"data set {data.name} of {path} has sources for {mapped} of "
                f"{math.prod(data.shape)} voxels, expected all of them"
            )
        for source in data.virtual_sources():
            if source.file_name != "." and "%" not in source.file_name:
                check_regular(folder / source.file_name, path)
    left = math.prod(data.shape) * data.dtype.itemsize
    for name, offset, size in data.external or ():
        file = folder / name
        check_regular(file, path)
        left -= max(0, min(size, file.stat().st_size - offset))
    if data.external and left > 0:
        raise InputError(f"data set {data.name} of {path} lacks {left} bytes, expected all of them")


def _check_links(file, path, key):
    """What a link on the way to a data set points to has to be a plain file."""
    parts = [part for part in key.split("/") if part]
    for n in range(1, len(parts) + 1):
        name = "/".join(parts[:n])
        link = file.get(name, getlink=True) if "/".join(parts[: n - 1]) in file or n == 1 else None
        if isinstance(link, h5py.ExternalLink):
            check_regular(Path(path).parent / link.filename, path)


def _names(file):
    names = []
    file.visititems(lambda name, item: names.append(name) if hasattr(item, "shape") else None)
    return ", ".join(names[:20]) or "none"
