"""The file `grains.h5`, of which nothing is believed before it was checked.

HDF5 may hang on a damaged file. So the file begins with a checksum of all that follows, in a block
that HDF5 leaves to its users, and is compared before HDF5 sees it. The table (labels, numbers of
nodes and cells, centroids, volumes) is then checked when the file is opened, each grain when it is
read: kinds and shapes, ranges, volumes. Files of version 1 have no checksum; all else is checked.
"""

import hashlib
from pathlib import Path

import h5py
import numpy as np

from ..errors import InputError
from .measure import tet_volumes

FORMAT, VERSION, WITHOUT_CHECKSUM = "mufe-grains", 2, 1
#: Bytes that HDF5 leaves free at the start, and what stands there before the checksum.
BLOCK, SIGN = 512, b"mufe-grains blake2b "
#: What a file of HDF5 without such a block begins with.
HDF5 = b"\x89HDF\r\n\x1a\n"
#: Volumes are those of the cells to this part of them: sums in another order.
TOLERANCE = 1e-6
#: Lengths beyond this are none of grains [m].
FAR = 1e6
#: What h5py raises for files that are damaged.
DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, OverflowError,
          MemoryError)  # fmt: skip
NUMBERS, FRACTIONS = "iu", "f"


class GrainFile:
    """A file of grains that is open for reading; a context.

    Args:
        folder_or_h5: The folder that `mufe mesh` wrote, or its `grains.h5`.
        compare: Compare the checksum, for which all of the file is read.

    Raises:
        InputError: No such file, no file of grains, or one that is damaged.

    Attributes:
        labels: Label of each grain, shape (num_grains,).
        node_offset, cell_offset: First node and cell of each grain, shape (num_grains + 1,).
        centroids: Centres of volume [m], shape (num_grains, 3).
        volumes: [m³], shape (num_grains,).
        element_size: Wanted length of edges [m].
        box: Corners of the image domain [m], shape (2, 3), or None.
        cylinder: x and y of the axis and the radius of a cylinder that cuts them [m], or None.
    """

    def __init__(self, folder_or_h5, compare=True):
        path = Path(folder_or_h5)
        self.path = path / "grains.h5" if path.is_dir() else path
        if not self.path.is_file():
            raise InputError(f"no file {self.path}, expected the grains.h5 that `mufe mesh` writes")
        try:
            self._version = self._compare() if compare else None
            self._file = h5py.File(self.path, "r")
        except InputError:
            raise
        except DAMAGE as error:
            raise InputError(
                f"{self.path} cannot be read as HDF5: {_one_line(error)}, expected the grains.h5 "
                "that `mufe mesh` writes"
            ) from error
        try:
            self._careful(self._read_table)
        except InputError:
            self._file.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._file.close()

    def grain(self, g):
        """Nodes of a grain [m] and its cells, numbered from 0 within it.

        Raises:
            InputError: They are none of a grain, or not those that were written.
        """
        return self._careful(lambda: self._read_grain(g))

    def check_room(self, num_nodes, num_cells):
        """Raise InputError unless there is memory for so many nodes and cells."""
        self._check_room(24 * int(num_nodes) + 32 * int(num_cells), "nodes and cells")

    def _careful(self, read):
        try:
            return read()
        except InputError:
            raise
        except DAMAGE as error:
            raise InputError(
                f"{self.path} is damaged ({_one_line(error)}), expected it as `mufe mesh` wrote it"
            ) from error

    def _compare(self):
        """Version of the file, by whether it has a checksum, which is compared."""
        with self.path.open("rb") as file:
            start = file.read(BLOCK)
            if start.startswith(HDF5):
                return WITHOUT_CHECKSUM
            if not start.startswith(SIGN):
                raise ValueError("no signature")
            found = hashlib.file_digest(file, "blake2b").hexdigest()
        self._require(start == _block(found), "its checksum differs")
        return VERSION

    def _read_table(self):
        file = self._file
        version = file.attrs.get("version")
        wanted = (WITHOUT_CHECKSUM, VERSION) if self._version is None else (self._version,)
        if file.attrs.get("format") != FORMAT or version not in wanted:
            found = _one_line(f"{file.attrs.get('format')} {version}")
            raise InputError(f"format of {self.path} is {found}, expected {FORMAT} {VERSION}")
        size = np.asarray(file.attrs["element_size"])
        self._require(size.size == 1 and size.dtype.kind in "fiu", "element_size is no number")
        self.element_size = float(size)
        self._require(0 < self.element_size < FAR, f"element_size = {self.element_size:g}")
        self.labels = self._read("labels", (None,), NUMBERS)
        n = self.labels.size
        self._require(n > 0, "labels is empty")
        low, high = int(self.labels.min()), int(self.labels.max())
        self._require(low > 0, f"labels has {low}")
        self._require(high < 2**31, f"labels has {high}")
        self._require(np.unique(self.labels).size == n, "labels has one twice")
        self._points = self._dataset("points", (None, 3), FRACTIONS)
        self._cells = self._dataset("cells", (None, 4), NUMBERS)
        self.node_offset = self._offsets("node_offset", n, len(self._points), 4)
        self.cell_offset = self._offsets("cell_offset", n, len(self._cells), 1)
        self.centroids = self._read("centroids", (n, 3), FRACTIONS)
        self.volumes = self._read("volumes", (n,), FRACTIONS)
        self._require(bool((np.abs(self.centroids) < FAR).all()), "centroids has one far away")
        self._require(bool(((self.volumes > 0) & (self.volumes < FAR)).all()),
                      "volumes has one that is not > 0")  # fmt: skip
        self.box = None
        if "box" in file:
            self.box = self._read("box", (2, 3), FRACTIONS)
            wide = (np.abs(self.box) < FAR).all() and (self.box[1] > self.box[0]).all()
            self._require(bool(wide), "box is none")
        self.cylinder = None
        if "cylinder" in file:
            self.cylinder = self._read("cylinder", (3,), FRACTIONS)
            good = (np.abs(self.cylinder) < FAR).all() and self.cylinder[2] > 0
            self._require(bool(good), "cylinder is none")

    def _read_grain(self, g):
        label = int(self.labels[g])
        first, last = (int(k) for k in self.node_offset[g : g + 2])
        points = self._points[first:last].astype(np.float64, copy=False)
        cells = self._cells[self.cell_offset[g] : self.cell_offset[g + 1]]
        low, high = int(cells.min()), int(cells.max())
        self._require(
            first <= low and high < last, f"cells of grain {label} have nodes {low} to {high}"
        )
        cells = cells.astype(np.int64, copy=False) - first
        self._require(bool((np.abs(points) < FAR).all()), f"grain {label} has a node far away")
        volumes, volume = tet_volumes(points, cells), float(self.volumes[g])
        self._require(bool((volumes > 0).all()), f"grain {label} has a cell without volume")
        self._require(
            abs(volumes.sum() - volume) <= TOLERANCE * volume,
            f"volume of grain {label} = {volume:.6g}, that of its cells {volumes.sum():.6g}",
        )
        return points, cells

    def _offsets(self, name, n, end, least):
        offset = self._read(name, (n + 1,), NUMBERS)
        ends = int(offset[0]), int(offset[-1])
        self._require(ends == (0, end), f"{name} goes from {ends[0]} to {ends[1]}")
        self._require(bool((np.diff(offset) >= least).all()), f"{name} has a grain of too few")
        return offset

    def _read(self, name, shape, kinds):
        values = self._dataset(name, shape, kinds)[()]
        if kinds == FRACTIONS:
            return values.astype(np.float64, copy=False)
        if values.dtype.kind == "u" and values.size:
            self._require(int(values.max()) < 2**62, f"{name} has {int(values.max())}")
        return values.astype(np.int64, copy=False)

    def _dataset(self, name, shape, kinds):
        """A dataset of this file, of that kind and shape (None: any), not read yet."""
        link = self._file.get(name, getlink=True)
        self._require(link is not None, f"{name} is missing")
        self._require(isinstance(link, h5py.HardLink), f"{name} is a link")
        found = self._file[name]
        self._require(isinstance(found, h5py.Dataset), f"{name} is no array")
        self._require(not found.external and not found.is_virtual, f"{name} is in another file")
        self._require(
            found.dtype.kind in kinds and found.dtype.itemsize <= 8, f"{name} has {found.dtype}"
        )
        wanted = [len(found.shape) == len(shape)]
        wanted += [b in (None, a) for a, b in zip(found.shape, shape, strict=False)]
        self._require(all(wanted), f"{name} has the shape {found.shape}")
        if shape[0] is None and len(shape) == 1:
            self._check_room(found.size * found.dtype.itemsize, name)
        return found

    def _check_room(self, size, what):
        room = available_memory()
        if size > room:
            raise InputError(
                f"{self.path}: {what} take {size / 1e9:.3g} GB, expected less than the memory "
                f"there is, {room / 1e9:.3g} GB"
            )

    def _require(self, holds, what):
        if not holds:
            raise InputError(
                f"{self.path} is damaged ({what}), expected it as `mufe mesh` wrote it"
            )


def write_checksum(path):
    """Put the checksum of a file that was made with a block of :data:`BLOCK` bytes there."""
    with open(path, "r+b") as file:
        file.seek(BLOCK)
        text = hashlib.file_digest(file, "blake2b").hexdigest()
        file.seek(0)
        file.write(_block(text))


def _block(text):
    return (SIGN + text.encode() + b"\n").ljust(BLOCK, b"\0")


def available_memory():
    """Memory that can be had [bytes]."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    return 1 << 40


def _one_line(error):
    return " ".join(str(error).split())[:200]
