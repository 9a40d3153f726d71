"""Raw voxels: bare numbers, so what is said of them is held against what they look like."""

import math

import numpy as np

from ...errors import InputError

#: Voxels in a row that are looked at, and the largest row that is searched for among them.
SAMPLE, LONGEST_ROW = 2**20, 2**14


def open_raw(path, shape, dtype):
    """The voxels of a raw file as an array on disk, of the given shape.

    Raises:
        InputError: shape or dtype is missing, the size of the file is another, or neighbouring
            voxels are alike only in another order of bytes or with rows of another length.
    """
    if shape is None or dtype is None:
        raise InputError(f"raw image {path}: shape = {shape}, dtype = {dtype}, expected both")
    dtype = number_type(dtype)
    if len(shape) != 3 or min(shape) < 1:
        raise InputError(f"shape = {shape}, expected (z, y, x), each >= 1")
    expected, size = math.prod(shape) * dtype.itemsize, path.stat().st_size
    if size != expected:
        raise InputError(
            f"{path} has {size} bytes, expected {expected} = "
            f"{' x '.join(map(str, shape))} voxels of {dtype}{_what_fits(size, shape, dtype)}"
        )
    voxels = np.memmap(path, dtype=dtype, mode="r", shape=tuple(shape))
    _check_looks(path, voxels)
    return voxels


def number_type(dtype):
    """The NumPy type of voxels by its name.

    Raises:
        InputError: there is none, or it is no type of single numbers.
    """
    try:
        found = np.dtype(dtype)
    except (TypeError, ValueError, SyntaxError):  # SyntaxError: "u2,"
        found = None
    if found is None or found.kind not in "buif" or found.shape:
        raise InputError(f'dtype = {dtype!r}, expected a NumPy type of numbers such as "<u2"')
    return found


def _what_fits(size, shape, dtype):
    """What would fit the size of the file: text to add to the message."""
    fits = []
    num_bytes = size / math.prod(shape)
    if num_bytes in (1, 2, 4, 8):
        fits.append(f"{num_bytes:g} bytes a voxel")
    slices = size / (shape[1] * shape[2] * dtype.itemsize)
    if slices == int(slices) >= 1:
        fits.append(f"{slices:g} slices")
    edge = round((size / dtype.itemsize) ** (1 / 3))
    if edge**3 * dtype.itemsize == size:
        fits.append(f"a cube of {edge} voxels")
    header = size - math.prod(shape) * dtype.itemsize
    if 0 < header <= 2**16 and not fits:
        fits.append(f"a header of {header} bytes, to be cut off")
    return f"; {' or '.join(fits)} would fit" if fits else ""


def _check_looks(path, voxels):
    """Refuse voxels that are noise as read, but an image in another order of bytes or rows."""
    flat = voxels.reshape(-1)
    middle = max(0, flat.size // 2 - SAMPLE // 2)
    sample = np.array(flat[middle : middle + SAMPLE])
    swapped = sample.view(sample.dtype.newbyteorder())
    alike, alike_swapped = _likeness(sample, 1), _likeness(swapped, 1)
    if alike < 0.3 and alike_swapped > max(0.6, alike + 0.4):
        raise InputError(
            f'dtype = "{voxels.dtype.str}" for {path}: neighbouring voxels have a correlation of '
            f'{alike:.2f}, but {alike_swapped:.2f} as "{swapped.dtype.str}", expected that'
        )
    row = voxels.shape[2]
    if alike < 0.3 or row > LONGEST_ROW or sample.size < 8 * row:
        return
    below = _likeness(sample, row) / alike
    if below > 0.6:
        return
    other, likeness = _likely_row(sample)
    if likeness / alike > max(0.8, below + 0.3):
        raise InputError(
            f"shape = {voxels.shape} for {path}: voxels in neighbouring rows of {row} have a "
            f"correlation of {below * alike:.2f}, but {likeness:.2f} in rows of {other}, "
            f"expected x = {other}"
        )


def _likeness(values, lag):
    """Correlation of voxels ``lag`` apart; 0 where all are equal."""
    values = _plain(values)
    a, b = values[:-lag], values[lag:]
    deviation = a.std() * b.std()
    return float(((a - a.mean()) * (b - b.mean())).mean() / deviation) if deviation > 0 else 0.0


def _likely_row(values):
    """The distance beyond the first fall of correlation at which it is highest, and how high."""
    values = _plain(values)
    values = values - values.mean()
    n = len(values)
    spectrum = np.fft.rfft(values, 2 * n)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2)[: min(LONGEST_ROW, n // 4)]
    correlation = covariance / covariance[0]
    fallen = np.flatnonzero(correlation < 0.5 * correlation[1])
    if len(fallen) == 0:
        return 0, 0.0
    best = fallen[0] + int(np.argmax(correlation[fallen[0] :]))
    return best, float(correlation[best])


def _plain(values):
    """Numbers fit for a correlation: floating point ones of wrong bytes are wild."""
    with np.errstate(all="ignore"):
        values = values.astype(np.float64)
        if values.size and np.abs(np.nan_to_num(values)).max() > 1e12:
            values = np.sign(values) * np.log1p(np.abs(values))
    return np.nan_to_num(values, posinf=0.0, neginf=0.0)
