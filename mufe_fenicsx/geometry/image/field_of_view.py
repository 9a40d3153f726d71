"""The part of an image that was measured: scans are round, files are not.

What lies outside the field of view is filled up with one value, which is neither void nor solid.
"""

import numpy as np
import scipy.ndimage

from ...errors import InputError
from .image_files import read_with_size
from .threshold import has_valley

#: Shares of voxels: the least padding that is looked for, and the most of its value inside.
LEAST_PADDING, MOST_HOLES = 2e-3, 1e-3
#: Slices at whose rim levels are compared, and the least number that make a cylinder.
RIM_SLICES, LEAST_SLICES = 32, 8
#: Voxels whose histogram is looked at.
SAMPLE = 10**6


def field_of_view(image, mask=None, *, source="image", axes=None, crop=None):
    """Voxels that were measured, and a line that says so.

    Args:
        image: Grey levels, (z, y, x); NaN counts as a value.
        mask: None: what is recognised; "none"; "cylinder": the largest upright cylinder in the
            image; a grey level: all voxels that have another; or the path of an image of
            the same size, 0 outside.
        source: Name of the image in messages.
        axes, crop: Of the image, for the file of a mask.

    Returns:
        True inside, (z, y, x), or None where that is the whole image; and the line, or None.

    Raises:
        InputError: no voxel or every voxel is outside, the file cannot be used, or voxels
            inside are NaN.
    """
    how, inside = "", None
    if mask is None:
        inside, value = padding(image)
        how = f"constant at {value:g}" if inside is not None else ""
    elif mask == "cylinder":
        inside, how = _cylinder(image.shape), "outside the largest upright cylinder"
    elif isinstance(mask, int | float):
        inside, how = _differs(image, mask), f"at mask = {mask:g}"
    elif mask != "none":
        read, _ = read_with_size(mask, axes=axes, crop=crop)
        if read.shape != image.shape:
            raise InputError(f"mask {mask} has shape {read.shape}, expected {image.shape}")
        inside, how = read != 0, f"outside by {mask}"
    num_inside = image.size if inside is None else np.count_nonzero(inside)
    if mask not in (None, "none") and num_inside in (0, image.size):
        raise InputError(
            f"mask = {mask!r}: {num_inside} of {image.size} voxels of {source} are inside, "
            "expected a part of them"
        )
    if image.dtype.kind == "f":
        bad = np.isnan(image) if inside is None else np.isnan(image) & inside
        if bad.any():
            first = np.unravel_index(int(np.argmax(bad)), bad.shape)
            raise InputError(
                f"image {source} has {np.count_nonzero(bad)} voxels that are NaN in its field of "
                f"view, the first at (z, y, x) = {tuple(int(k) for k in first)}, "
                "expected finite values"
            )
    if inside is None:
        return None, None
    return inside, f"{1 - num_inside / image.size:.1%} of the voxels left out: {how}"


def padding(image):
    """The field of view of an image that is constant around it, and that constant.

    Recognised is a value that two corners share, around a convex field in which it hardly occurs
    and at whose rim levels are as farther inside. Voids that were clipped to one value are none:
    they lie between grains as well, or grains grow brighter from their rim inwards. Either the
    field is the same in all slices, or it has two phases.

    Returns:
        True inside, (z, y, x), and the value; None and None where there is no padding.
    """
    corners = image[
        :: max(len(image) - 1, 1), :: image.shape[1] - 1 or 1, :: image.shape[2] - 1 or 1
    ]
    values, counts = np.unique(corners, return_counts=True)
    value = values[np.argmax(counts)]
    if counts.max() < 2 or image.dtype == bool:
        return None, None
    other = _differs(image, value)
    num_other = np.count_nonzero(other)
    if not LEAST_PADDING * image.size < image.size - num_other < image.size:
        return None, None
    inside = np.zeros(image.shape, dtype=bool)
    for part, seen in zip(inside, other, strict=True):
        part[:] = _between(seen, 0) & _between(seen, 1)
    holes = np.count_nonzero(inside) - num_other
    if holes > MOST_HOLES * num_other or inside.all():
        return None, None
    if not _abrupt(image, inside, value):
        return None, None
    if not (len(image) >= LEAST_SLICES and (inside == inside[0]).all()):
        if not _two_phases(image[inside]):
            return None, None
    return inside, float(value)


def filled(image, inside):
    """The image with each voxel outside as the nearest one inside in its slice.

    A slice without one is as the nearest slice that has one.
    """
    result = image.copy()
    seen = np.flatnonzero(inside.any(axis=(1, 2)))
    last, at = None, None
    for k in seen:
        if last is None or not np.array_equal(inside[k], last):
            last = inside[k]
            at = scipy.ndimage.distance_transform_edt(
                ~last, return_distances=False, return_indices=True
            )
        result[k] = image[k][tuple(at)]
    for k in np.setdiff1d(np.arange(len(image)), seen):
        result[k] = result[seen[np.argmin(np.abs(seen - k))]]
    return result


def _differs(image, value):
    return ~np.isnan(image) if np.isnan(value) else image != value


def _between(seen, axis):
    """Pixels between the first and the last seen one of each row."""
    n = seen.shape[axis]
    first = np.argmax(seen, axis=axis)
    last = n - 1 - np.argmax(np.flip(seen, axis=axis), axis=axis)
    place = np.arange(n).reshape((-1, 1) if axis == 0 else (1, -1))
    first, last = np.expand_dims(first, axis), np.expand_dims(last, axis)
    return (place >= first) & (place <= last) & np.expand_dims(seen.any(axis=axis), axis)


def _abrupt(image, inside, value):
    """Whether levels at the rim of the field are as three voxels farther inside."""
    rim, deep = [], []
    for k in np.unique(np.linspace(0, len(image) - 1, RIM_SLICES).astype(int)):
        # The border of the image is no rim.
        depth = scipy.ndimage.distance_transform_cdt(
            np.pad(inside[k], 5, mode="edge"), metric="taxicab"
        )[5:-5, 5:-5]
        rim.append(image[k][depth == 1])
        deep.append(image[k][depth == 4])
    rim, deep = np.concatenate(rim), np.concatenate(deep)
    if not (rim.size and deep.size):
        return False
    # A bright ring of the reconstruction is still far from the constant; a constant near the levels
    # is told by how many of them are as at the rim.
    means = [float(np.mean(part, dtype=float)) for part in (rim, deep)]
    away = abs(means[1] - value) if np.isfinite(value) else np.inf
    return abs(means[0] - means[1]) < 0.25 * away or _distance(rim, deep) < 0.5


def _distance(a, b):
    """Largest difference of two distributions (Kolmogorov and Smirnov)."""
    a, b = np.sort(a), np.sort(b)
    levels = np.concatenate([a, b])
    parts = [np.searchsorted(part, levels, side="right") / part.size for part in (a, b)]
    return float(np.abs(parts[0] - parts[1]).max())


def _two_phases(level):
    """Whether levels have two modes with a valley between them."""
    level = level[:: max(1, level.size // SAMPLE)]
    if level.min() == level.max():
        return False
    if level.dtype.kind in "iu":  # bins between whole numbers would be empty
        level = level + np.random.default_rng(1).uniform(-0.5, 0.5, level.shape)
    return has_valley(level)


def _cylinder(shape):
    """The largest upright cylinder in the middle of an image."""
    y, x = (np.arange(n) - (n - 1) / 2 for n in shape[1:])
    radius = min(shape[1:]) / 2
    circle = y[:, None] ** 2 + x[None, :] ** 2 <= radius**2
    return np.broadcast_to(circle, shape).copy()
