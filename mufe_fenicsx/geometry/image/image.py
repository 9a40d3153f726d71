"""Resample and smooth a three-dimensional grey image.

Axes are (z, y, x): slice, row, column.
"""

import math

import numpy as np
import scipy.ndimage

from ...errors import InputError
from ...machine.memory import check_room


def to_cubes(image, voxel_size, *, labels=False):
    """The image on cubes as wide as the shortest edge of its voxels; the domain stays the same.

    Args:
        image: Grey levels or labels, (z, y, x).
        voxel_size: Edges of a voxel (z, y, x) [m].
        labels: Take the nearest voxel instead of a cubic spline.

    Returns:
        The image, and the edge of its voxels [m].
    """
    edge = min(voxel_size)
    factors = [size / edge for size in voxel_size]
    if max(factors) < 1 + 1e-6:
        return image, edge
    if not labels:
        image = image.astype(np.float32)
    voxels = [round(n * factor) for n, factor in zip(image.shape, factors, strict=True)]
    check_room(
        math.prod(voxels) * (8 if labels else 16),
        f"voxel_size = {tuple(voxel_size)}: an image of {' x '.join(map(str, voxels))} cubes",
    )
    order = 0 if labels else 3
    return scipy.ndimage.zoom(image, factors, order=order, mode="nearest", grid_mode=True), edge


def resample(image, factor):
    """The grey image on voxels ``factor`` times finer; the domain stays the same.

    Values are interpolated by cubic splines; before coarsening they are averaged by a Gaussian.
    """
    if not factor > 0:
        raise InputError(f"upsample = {factor}, expected > 0")
    if factor == 1:
        return image
    if min(round(n * factor) for n in image.shape) < 1:
        raise InputError(f"upsample = {factor} leaves no voxel of an image of {image.shape}")
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
