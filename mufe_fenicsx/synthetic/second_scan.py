"""Two scans of one packing, before and after each grain has moved by a known rigid motion."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from .imaging import grey_image, voxelise
from .packing import pack

#: By which grains stand apart, so that they do not meet when they turn.
APART = 1.12


@dataclass(frozen=True)
class TwoScans:
    """Grey images and true labels of both scans, and the motion in between."""

    grey: tuple  #: of each scan, (z, y, x)
    grain: tuple  #: number of the grain + 1 in each voxel of each scan, 0 void
    centre: np.ndarray  #: in the first scan [m], (x, y, z) from the image's corner, (num_grains, 3)
    displacement: np.ndarray  #: [m], shape (num_grains, 3)
    rotation: Rotation  #: of all grains


def two_scans(grains, settings, rng, *, strain=0.03, shift=0.5, angle=20.0):
    """Pack grains and scan them twice, with noise of its own each time.

    Args:
        grains: `shapes.RadialGrains`.
        settings: `SynthesisSettings`, of the images; these are as large as the packing needs.
        rng: NumPy generator.
        strain: By which the packing is pressed along z between the scans.
        shift: Largest random displacement of a grain along each axis beside that [voxels].
        angle: Largest rotation of a grain [degrees]; axes are random, angles even from 0.

    Returns:
        :class:`TwoScans`.

    Raises:
        SolverError: As of `packing.pack`.
    """
    voxel, n = settings.voxel_size, grains.num_grains
    packing = pack(grains, rng, np.ones(3), settings.overlap * voxel)
    middle = 0.5 * (packing.low + packing.high)
    first = replace(packing, centre=middle + APART * (packing.centre - middle))
    axis = rng.standard_normal((n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turn = Rotation.from_rotvec(axis * np.radians(angle) * rng.random((n, 1)))
    moved = shift * voxel * rng.uniform(-1, 1, (n, 3))
    moved[:, 2] -= strain * (first.centre[:, 2] - packing.low[2])
    second = replace(
        first,
        centre=first.centre + moved,
        axes=np.einsum("gij,gjk->gik", turn.as_matrix(), first.axes),
    )
    edge = APART * (packing.high - packing.low) / voxel
    shape = tuple(int(np.ceil(e)) + 12 for e in edge[::-1])
    scans = [voxelise(p, shape, voxel, settings.supersampling) for p in (first, second)]
    return TwoScans(
        grey=tuple(grey_image(scan.solid, rng, settings) for scan in scans),
        grain=tuple(scan.labels for scan in scans),
        centre=first.centre - scans[0].low,
        displacement=moved,
        rotation=turn,
    )
