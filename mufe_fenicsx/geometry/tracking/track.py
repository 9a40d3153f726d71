"""Tracks of the grains of a scan: where each is in a later scan, and how it has turned."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ...errors import InputError
from .bodies import bodies_of
from .matching import match
from .registration import register


@dataclass(frozen=True)
class Track:
    """Motion of grains from a first scan to a later one; nan where a grain is lost."""

    label: np.ndarray  #: in the first scan, increasing, shape (num_grains,)
    label_now: np.ndarray  #: in the later one, 0 where it is lost or not known, (num_grains,)
    centre: np.ndarray  #: in the first scan [m], (x, y, z), shape (num_grains, 3)
    displacement: np.ndarray  #: of that centre [m], shape (num_grains, 3)
    rotation: np.ndarray  #: matrices, nan of round grains and by places alone, (num_grains, 3, 3)
    misfit: np.ndarray  #: of the registration [-], nan where others tracked, shape (num_grains,)

    @property
    def found(self):
        """Which grains are not lost, shape (num_grains,)."""
        return np.isfinite(self.displacement).all(axis=1)


def track_labels(first, second, voxel_size, names=("", "")):
    """:func:`track_bodies` of labels on the same voxels, (z, y, x), 0 is void.

    Raises:
        InputError: The scans have different shapes, or one has no grain, or none is found again.
    """
    if first.shape != second.shape:
        raise InputError(
            f"labels {names[1]} have shape {second.shape}, expected {first.shape} as {names[0]}"
        )
    old, new = (bodies_of(x, name) for x, name in zip((first, second), names, strict=True))
    return track_bodies(old, new, voxel_size, names)


def track_bodies(old, new, voxel_size, names, before=None, progress=None):
    """Find the grains of a first scan in a later one.

    Args:
        old, new: :class:`~.bodies.Bodies` of both scans.
        voxel_size: [m].
        names: Of the scans in messages.
        before: :class:`Track` to a scan in between, from which search begins; None: none.
        progress: Called with the numbers of grains done and of all.

    Returns:
        :class:`Track`. Grains that the border cuts have one too: by what is seen of them.

    Raises:
        InputError: No grain is found again.
    """
    n = len(old.label)
    start, expected = [Rotation.identity()] * n, None
    if before is not None and before.found.any():
        moved = before.displacement / voxel_size
        expected = np.where(before.found[:, None], moved, np.nanmedian(moved, axis=0))
        for k in np.flatnonzero(np.isfinite(before.rotation).all(axis=(1, 2))):
            start[k] = Rotation.from_matrix(before.rotation[k])
    found = match(old, new, expected)
    if (found < 0).all():
        raise InputError(
            f"labels {names[1]}: none of the {n} grains of {names[0]} is found again, expected "
            "scans of the same sample"
        )
    displacement, misfit = np.full((n, 3), np.nan), np.full(n, np.nan)
    rotation = np.full((n, 3, 3), np.nan)
    for k in np.flatnonzero(found >= 0):
        displacement[k], turn, misfit[k] = register(old, k, new, found[k], start[k])
        if not (old.round[k] or new.round[found[k]]):
            rotation[k] = turn.as_matrix()
        if progress:
            progress(int(k) + 1, n)
    return Track(
        label=old.label,
        label_now=np.where(found >= 0, new.label[found], 0),
        centre=old.centre * voxel_size,
        displacement=displacement * voxel_size,
        rotation=rotation,
        misfit=misfit,
    )
