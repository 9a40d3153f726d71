"""What tracking needs of the grains of a scan: places, volumes, moments, and who is cut."""

from dataclasses import dataclass

import numpy as np
import scipy.ndimage

from ...errors import InputError

#: A grain is round if its principal second moments differ by less than this part: its diameters by
#: half of it, which is what voxels and cuts between neighbours do to labels of balls.
ROUND = 0.05


@dataclass(frozen=True)
class Bodies:
    """Grains of one scan; lengths in voxels, positions (x, y, z) from the image's corner."""

    image: np.ndarray  #: labels, (z, y, x)
    label: np.ndarray  #: of each grain, increasing, shape (num_grains,)
    volume: np.ndarray  #: [voxels], shape (num_grains,)
    centre: np.ndarray  #: of volume [voxels], shape (num_grains, 3)
    moments: np.ndarray  #: principal second ones, smallest first [voxels²], (num_grains, 3)
    axes: np.ndarray  #: their directions in columns, a right-handed set, (num_grains, 3, 3)
    cut: np.ndarray  #: whether the border of the image cuts it, shape (num_grains,)
    boxes: list  #: slices (z, y, x) around each

    @property
    def round(self):
        """Which grains are nearly balls: labels do not tell how they turn, shape (num_grains,)."""
        return self.moments[:, 2] < (1 + ROUND) * self.moments[:, 0]

    @property
    def diameter(self):
        """Median diameter of balls of the same volumes [voxels]."""
        return float(np.cbrt(6 / np.pi * np.median(self.volume)))


def bodies_of(labels, source="labels"):
    """The :class:`Bodies` of labels.

    Args:
        labels: Integers, 0 is void, (z, y, x).
        source: Their name in messages.

    Raises:
        InputError: There is no grain.
    """
    at = np.flatnonzero(labels)
    if at.size == 0:
        raise InputError(f"{source}: no grain, all voxels are 0, expected at least one")
    label, grain = np.unique(labels.ravel()[at], return_inverse=True)
    place = np.column_stack(np.unravel_index(at, labels.shape)[::-1]) + 0.5
    volume = np.bincount(grain).astype(float)
    centre = np.column_stack([np.bincount(grain, c) for c in place.T]) / volume[:, None]
    away = place - centre[grain]
    second = np.empty((len(label), 3, 3))
    for i in range(3):
        for j in range(i + 1):
            second[:, i, j] = np.bincount(grain, away[:, i] * away[:, j]) / volume
            second[:, j, i] = second[:, i, j]
    moments, axes = np.linalg.eigh(second + np.eye(3) / 12)  # that of the voxels themselves
    axes[:, :, 2] *= np.linalg.det(axes)[:, None]
    boxes = scipy.ndimage.find_objects(labels)
    boxes = [boxes[k - 1] for k in label.tolist()]
    cut = [
        any(s.start == 0 or s.stop == n for s, n in zip(box, labels.shape, strict=True))
        for box in boxes
    ]
    return Bodies(labels, label, volume, centre, moments, axes, np.array(cut), boxes)
