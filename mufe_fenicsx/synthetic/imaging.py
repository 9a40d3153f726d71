"""From grains in place to voxels, and from solid fractions to grey levels as of a scanner."""

from dataclasses import dataclass

import numpy as np
import scipy.ndimage

from ..kernels.packing import radial


@dataclass
class Voxels:
    """What of each grain lies in the image; axes of arrays are (z, y, x)."""

    labels: np.ndarray  #: grain + 1 at the voxel's middle, 0 void, int32
    solid: np.ndarray  #: solid part of each voxel, 0 to 1, float32
    volume: np.ndarray  #: of each grain within the image [m³], (n,)
    centroid: np.ndarray  #: of that part, x, y, z [m] from the image's corner, (n, 3)
    low: np.ndarray  #: corner of the image in the packing, x, y, z [m]
    high: np.ndarray  #: the other corner


def voxelise(packing, shape, voxel_size, supersampling):
    """The middle part of a packing as voxels.

    Args:
        packing: `packing.Packing`.
        shape: Voxels (z, y, x).
        voxel_size: [m].
        supersampling: Points along each edge of a voxel that a surface cuts.

    Returns:
        `Voxels`.
    """
    size = np.array(shape[::-1]) * voxel_size
    low = (packing.low + packing.high - size) / 2
    n = packing.grains.num_grains
    labels = np.zeros(shape, dtype=np.int32)
    distance = np.full(shape, np.inf, dtype=np.float32)
    solid = np.zeros(shape, dtype=np.float32)
    volume, moment = np.zeros(n), np.zeros((n, 3))
    radial.voxelise(
        labels, distance, solid, volume, moment, low, voxel_size, supersampling, *packing.arrays
    )
    np.minimum(solid, 1, out=solid)
    centroid = moment / np.maximum(volume, 1e-300)[:, None] - low
    return Voxels(labels, solid, volume, centroid, low, low + size)


def grey_image(solid, rng, settings):
    """Grey levels of a scan, uint16.

    The level between that of void and of grains by the solid part of the voxel (partial
    volume), a Gaussian point-spread function, rings about the axis of rotation, which is z
    through the middle, then noise: an even part and one whose variance grows with
    the level, as of counted photons.

    Args:
        solid: Solid part of each voxel, (z, y, x).
        rng: NumPy generator.
        settings: `SynthesisSettings`.
    """
    contrast = settings.solid_grey - settings.void_grey
    grey = settings.void_grey + contrast * solid
    if settings.blur > 0:
        grey = scipy.ndimage.gaussian_filter(grey, settings.blur, mode="nearest")
    deviation = np.sqrt(
        settings.noise**2 + settings.shot_noise**2 * np.maximum(grey, 0) / settings.solid_grey
    )
    grey += contrast * deviation * rng.standard_normal(grey.shape, dtype=np.float32)
    if settings.rings > 0:
        grey += contrast * settings.rings * ring_pattern(solid.shape[1:], rng)
    return np.clip(np.round(grey), 0, 65535).astype(np.uint16)


def ring_pattern(shape, rng):
    """Rings one voxel wide about the middle of slices (y, x), of unit variance over radii."""
    y, x = (np.arange(n) - (n - 1) / 2 for n in shape)
    radius = np.hypot(y[:, None], x[None, :])
    height = rng.standard_normal(int(radius.max()) + 2).astype(np.float32)
    return np.interp(radius, np.arange(len(height)), height).astype(np.float32)
