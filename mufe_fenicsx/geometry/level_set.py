"""The smoothed body of a grain: a field that is positive inside, whose zero is its surface.

One Gaussian smooths the indicator of every grain and of the void, so that the
smoothed indicators phi add up to 1 everywhere. Grain i is where

    psi_i = phi_i + beta_i phi_0 - 1/2 > 0,    beta_i < 1/2,

with phi_0 the void's. No two grains overlap: psi_i > 0 and psi_j > 0 would
need phi_i + phi_j + (beta_i + beta_j) phi_0 > 1, more than all there is. Faces
between grains (phi_0 = 0) stay where phi_i = 1/2 whatever beta is; free faces
move outward with beta, which gives back the volume that smoothing takes.
"""

from dataclasses import dataclass

import numpy as np
import scipy.ndimage

from ..kernels.spline import spline_value_and_gradient

#: Range of beta; its upper end leaves a margin to the 1/2 at which voids close.
BETA = (-0.4, 0.4)


@dataclass
class LevelSet:
    """psi on the voxels around one grain; positions in voxels, order (z, y, x).

    A position is counted from the centre of voxel (0, 0, 0) of the whole
    image; its domain reaches from -1/2 to shape - 1/2.
    """

    grain: np.ndarray  #: smoothed indicator of the grain
    void: np.ndarray  #: smoothed indicator of the void
    offset: np.ndarray  #: index of the first voxel within the image
    shape: np.ndarray  #: voxels of the image
    beta: float = 0.0

    def __post_init__(self):
        self._splines = self._psi = self._psi_beta = None

    @property
    def lower(self):
        return np.full(3, -0.5)

    @property
    def upper(self):
        return np.asarray(self.shape) - 0.5

    def nodes(self):
        """psi at the centres of voxels, cut off at the faces of the image."""
        psi = self.grain + self.beta * self.void - 0.5
        for axis in range(3):
            position = self.offset[axis] + np.arange(psi.shape[axis])
            # Linear interpolation puts the zero of this on the face exactly.
            inside = np.minimum(position - self.lower[axis], self.upper[axis] - position)
            psi = np.minimum(psi, 0.02 * inside.reshape([-1 if a == axis else 1 for a in range(3)]))
        return psi

    def value_and_gradient(self, x):
        """psi and its gradient [1/voxel] at positions x, shape (n, 3); not cut off."""
        value, gradient = np.empty(len(x)), np.empty((len(x), 3))
        spline_value_and_gradient(value, gradient, self._spline(), x - self.offset)
        return value - 0.5, gradient

    def _spline(self):
        """Coefficients of psi + 1/2: linear in the fields, and so in beta."""
        if self._splines is None:
            self._splines = [
                scipy.ndimage.spline_filter(f, order=3, mode="nearest", output=np.float64)
                for f in (self.grain, self.void)
            ]
        if self._psi_beta != self.beta:
            self._psi, self._psi_beta = self._splines[0] + self.beta * self._splines[1], self.beta
        return self._psi


def margin(sigma):
    """Voxels that have to be known around a grain."""
    return int(np.ceil(3 * sigma)) + 3


def crop_around(labels, where, sigma, more=0):
    """The labels around a grain and the index of their first voxel.

    Beyond the border of the image is void: the flat face of a cut grain then comes
    to lie on the border, half-way between two voxels, with its edge rounded a little.

    Args:
        labels: The whole image.
        where: Slices of the box around the grain.
        sigma: Standard deviation of the Gaussian [voxels].
        more: Voxels around that.
    """
    pad = margin(sigma) + more
    low = np.array([s.start - pad for s in where])
    high = np.array([s.stop + pad for s in where])
    first, last = np.maximum(low, 0), np.minimum(high, labels.shape)
    part = labels[tuple(slice(a, b) for a, b in zip(first, last, strict=True))]
    return np.pad(part, np.column_stack([first - low, high - last])), low


def without_clefts(crop, width):
    """A crop around grain 1 whose clefts, void narrower than ``width`` voxels, are filled."""
    r = int(np.ceil(width / 2))
    z, y, x = np.ogrid[-r : r + 1, -r : r + 1, -r : r + 1]
    ball = z * z + y * y + x * x <= r * r
    padded = np.pad(crop == 1, r)
    closed = scipy.ndimage.binary_closing(padded, ball)[r:-r, r:-r, r:-r]
    return np.where(closed & (crop == 0), 1, crop).astype(crop.dtype)


def smoothed(crop, label, offset, shape, sigma):
    """The level set of one grain with beta = 0."""
    fields = [
        scipy.ndimage.gaussian_filter(
            (crop == number).astype(np.float32), sigma, mode="nearest", truncate=3.0
        )
        for number in (label, 0)
    ]
    return LevelSet(*fields, np.asarray(offset), np.asarray(shape))
