"""TIFF: stacks of pages, and folders of slices."""

import logging
import math
import re
from collections import Counter

import numpy as np
import tifffile

from ...errors import InputError
from .picture_file import PICTURES, Picture
from .stored_image import Stored, check_regular, errors_of_readers, only_one, three_axes
from .voxel_size import tiff_voxel_size

# What is wrong with a file is said in our own line.
logging.getLogger("tifffile").setLevel(logging.CRITICAL)

TIFF = (".tif", ".tiff")


def open_tiff(file, path, key=None):
    """The voxels of an open `tifffile.TiffFile`, with what it says of them: `Stored`.

    A file holds series of pages. One of three axes is the image; flat ones of one shape, a page
    each, are its slices. Of several with three axes ``key`` is the number of one.

    Raises:
        InputError: no page, none or several images of three axes, colours, or missing pages.
    """
    series = list(file.series)
    if not series:
        raise InputError(f"image {path} holds no page, expected a TIFF stack")
    notices = ()
    if key is not None:
        if not (str(key).isdecimal() and int(key) < len(series)):
            raise InputError(f"key = {key!r} for {path}, expected 0 to {len(series) - 1}: a series")
        voxels = three_axes(_Series(series[int(key)], path, file))
    elif len(series) == 1:
        voxels = three_axes(_Series(series[0], path, file))
    else:
        voxels, notices = _of_several(series, path, file)
    return Stored(voxels, tiff_voxel_size(file), _white_is_zero(series[0]), notices=notices)


def _of_several(series, path, file):
    """The volume of a file with several series, and lines on what else it holds."""
    parts = {k: three_axes(_Series(s, path, file)) for k, s in enumerate(series)}
    solid = {k: part for k, part in parts.items() if len(part.shape) == 3}
    if not solid and len({(part.shape, part.dtype) for part in parts.values()}) == 1:
        return _Stacked(list(parts.values())), ()
    if len(solid) != 1:
        sizes = Counter(part.shape for part in parts.values())
        shapes = [f"{n} of {' x '.join(map(str, size))}" for size, n in sizes.items()]
        raise InputError(
            f"image {path} holds {len(series)} series of pages ({', '.join(shapes[:6])}"
            f"{', …' if len(shapes) > 6 else ''}), expected one with three axes, slices of one "
            "size, or the number of a series as key, from 0"
        )
    volume = only_one(solid, path, "series")
    slices = [k for k, part in parts.items() if part.shape == volume.shape[1:]]
    if slices:
        raise InputError(
            f"image {path} holds a series of {volume.shape[0]} slices and {len(slices)} single "
            "ones of the same size, expected all in one series, or the number of one as key"
        )
    return volume, (f"{len(series) - 1} smaller series of {path} left out",)


class _Series:
    """A series of pages; read where it lies if it is not compressed, else page by page."""

    def __init__(self, series, path, file):
        self.series, self.path = series, path
        self.size = file.filehandle.size
        self.shape, self.dtype = tuple(int(n) for n in series.shape), series.dtype
        self.letters = series.axes
        colour = series.axes.find("S")
        # tifffile itself writes three or four slices as planes of colours, and says their shape.
        slices = colour == 0 and file.is_shaped
        if colour >= 0 and self.shape[colour] > 1 and not slices:
            raise InputError(
                f"image {path} has {self.shape[colour]} colours a voxel, expected grey levels"
            )
        if self.dtype is None or min(self.shape, default=0) < 1:
            raise InputError(f"image {path} has shape {self.shape}, type {self.dtype}")
        stated = (file.imagej_metadata or {}).get("images") if file.is_imagej else None
        slices = math.prod(self.shape[:-2])
        if isinstance(stated, int) and len(file.series) == 1 and stated != slices:
            raise InputError(f"image {path} has {slices} of {stated} slices, expected all")

    def __getitem__(self, where):
        series = self.series
        if series.dataoffset is not None:
            end = series.dataoffset + math.prod(self.shape) * self.dtype.itemsize
            if end > self.size:
                raise InputError(f"image {self.path} has {self.size} bytes, expected {end}")
            order = series.parent.byteorder
            voxels = np.memmap(
                self.path, self.dtype.newbyteorder(order), "r", series.dataoffset, self.shape
            )
            return np.array(voxels[where]).astype(self.dtype, copy=False)
        if len(self.shape) != 3 or len(series.pages) != self.shape[0]:
            for k in range(len(series.pages)):
                self._page(k)
            return series.asarray(maxworkers=1)[where]
        pages = range(*where[0].indices(self.shape[0]))
        return np.stack([self._page(k).asarray()[where[1:]] for k in pages])

    def _page(self, k):
        """A page all of whose bytes are there."""
        page = self.series.pages[k]
        if page is None:
            raise InputError(f"image {self.path} lacks page {k}, expected {len(self.series.pages)}")
        sizes = page.databytecounts
        ends = [start + n for start, n in zip(page.dataoffsets, sizes, strict=True)]
        if not sizes or min(sizes) == 0 or max(ends) > self.size:
            raise InputError(
                f"image {self.path} ends at {self.size} bytes, page {k} at "
                f"{max(ends, default=0)} with {sum(n == 0 for n in sizes)} empty parts, "
                "expected all of its bytes"
            )
        return page


class _Stacked:
    """Flat parts of one shape as the slices of an image."""

    def __init__(self, parts):
        self.parts, self.dtype = parts, parts[0].dtype
        self.shape = (len(parts), *parts[0].shape)

    def __getitem__(self, where):
        return np.stack([part[where[1:]] for part in self.parts[where[0]]])


class _Slice:
    """One file of a folder of slices, opened when it is read."""

    def __init__(self, path, folder):
        check_regular(path, folder)
        self.path = path
        with errors_of_readers(path), tifffile.TiffFile(path) as file:
            part = open_tiff(file, path)
            self.shape, self.dtype = part.shape, part.voxels.dtype
            self.white_is_zero, self.voxel_size = part.white_is_zero, part.voxel_size

    def __getitem__(self, where):
        with errors_of_readers(self.path), tifffile.TiffFile(self.path) as file:
            return open_tiff(file, self.path).voxels[where]


def open_slices(folder, names):
    """A folder of slices, of which only those that are asked for are read: `Stored`.

    Args:
        folder: The folder.
        names: Its files in the order of the slices.

    Raises:
        InputError: no slice, or slices that differ in size, type or in what their zeros mean.
    """
    if not names:
        raise InputError(f"folder {folder} holds no .tif or .png, expected slices of an image")
    slices = [
        (Picture if name.suffix.lower() in PICTURES else _Slice)(name, folder) for name in names
    ]
    first = slices[0]
    for part in slices:
        if len(part.shape) != 2 or part.shape != first.shape:
            raise InputError(
                f"slice {part.path.name} has shape {part.shape}, expected {first.shape[:2]} "
                f"as the first slice, {first.path.name}"
            )
        if (part.dtype, part.white_is_zero) != (first.dtype, first.white_is_zero):
            raise InputError(
                f"slice {part.path.name} has type {part.dtype}, white is zero: "
                f"{part.white_is_zero}, expected {first.dtype}, {first.white_is_zero} as the "
                f"first slice, {first.path.name}"
            )
    size = first.voxel_size
    if isinstance(size, tuple):  # the distance of slices is none that a slice may state
        size = f"nothing along z, {size[1]:.6g} m along y, {size[2]:.6g} m along x"
    return Stored(
        _Stacked(slices), size, first.white_is_zero, notices=_doubts_about_names(folder, names)
    )


def _doubts_about_names(folder, names):
    """Lines on slices that their numbers say are missing, and on files that are named otherwise."""
    forms = Counter(re.sub(r"\d+", "#", name.name) for name in names)
    usual, _ = forms.most_common(1)[0]
    numbers = [
        [int(n) for n in re.findall(r"\d+", name.name)]
        for name in names
        if re.sub(r"\d+", "#", name.name) == usual
    ]
    lines = []
    others = [name.name for name in names if re.sub(r"\d+", "#", name.name) != usual]
    if others and len(others) < len(names) / 2:
        lines.append(
            f"{folder}: {len(others)} of {len(names)} slices have other names than the rest, such "
            f"as {others[0]}: taken as slices too"
        )
    table = np.array(numbers)
    varying = [column for column in table.T if len(set(column.tolist())) > 1]
    if len(varying) == 1:
        steps = np.diff(varying[0])
        step = Counter(steps.tolist()).most_common(1)[0][0]
        gaps = np.flatnonzero(steps != step)
        if len(gaps):
            before, after = varying[0][gaps[0]], varying[0][gaps[0] + 1]
            lines.append(
                f"{folder}: {len(gaps)} gaps in the numbers of slices, the first between "
                f"{before} and {after}: taken as neighbours"
            )
    return tuple(lines)


def _white_is_zero(series):
    return int(getattr(series.keyframe, "photometric", 1) or 0) == 0
