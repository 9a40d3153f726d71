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

from ...kernels.contact.spline import spline_value_and_gradient

#: Range of beta; its upper end leaves a margin to the 1/2 at which voids close.
BETA = (-0.4, 0.4)
#: The one that a surface has at first; later ones do not change how it hangs together.
FIRST_BETA = 0.5 * BETA[1]
#: Part of a grain's volume that may break off unnoticed.
LOST = 0.02


def face_tag(axis, side):
    """Number of a face of the image: normal to an axis, side 0 at its lower end; from 1 on."""
    return 1 + 2 * axis + side


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
    cut: object = None  #: `RoundCut` that the grain may reach, which holds in place of side faces

    def __post_init__(self):
        self._splines = self._psi = self._psi_beta = None

    @property
    def lower(self):
        """Corner of the image with the smallest coordinates, shape (3,)."""
        return np.full(3, -0.5)

    @property
    def upper(self):
        """The opposite corner, shape (3,)."""
        return np.asarray(self.shape) - 0.5

    def nodes(self):
        """psi on a grid within the image whose outermost layers are negative.

        The grid ends on the faces of the image, with two layers in the same place: psi there, and
        -1. An isosurface between these two lies in the face, and has a sharp edge where it ends.

        Returns:
            psi; the positions of its layers along each axis; the tags of the faces that its first
            and last layers lie in, shape (3, 2), 0 where they lie in none.
        """
        psi = self.grain + self.beta * self.void - 0.5
        positions, faces = [], np.zeros((3, 2), dtype=np.int64)
        for axis in range(3):
            at = self.offset[axis] + np.arange(psi.shape[axis], dtype=float)
            inside = np.flatnonzero((at >= 0) & (at <= self.upper[axis]))
            ends = []
            for side, end, face in ((0, inside[0], self.lower), (1, inside[-1], self.upper)):
                outer, here = end + (1 if side else -1), psi.take([end], axis)
                if 0 <= outer < len(at):
                    # Labels go on beyond the image: psi is known on both sides of the face.
                    layer = 0.5 * (here + psi.take([outer], axis))
                    ends.append(([layer, np.full_like(here, -1)], [face[axis]] * 2))
                    faces[axis, side] = face_tag(axis, side)
                else:
                    ends.append(([np.full_like(here, -0.5)], [at[end] + (1 if side else -1)]))
            (low, low_at), (high, high_at) = ends
            psi = np.concatenate([*low[::-1], psi.take(inside, axis), *high], axis)
            positions.append(np.concatenate([low_at[::-1], at[inside], high_at]))
        return psi, positions, faces

    def placed(self, at):
        """Positions of places on the grid of :meth:`nodes`: the same."""
        return at

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

    Beyond the border of the image is void.

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


def continued(crop, offset, shape):
    """A crop whose outermost voxels within the image go on beyond its border.

    Surfaces of smoothed labels then meet the border where the voxels do, and a slice of a grain
    that the border cuts off keeps its thickness.
    """
    before = np.maximum(-np.asarray(offset), 0)
    after = np.maximum(np.asarray(offset) + crop.shape - shape, 0)
    inside = tuple(slice(b, n - a) for b, n, a in zip(before, crop.shape, after, strict=True))
    return np.pad(crop[inside], np.column_stack([before, after]), mode="edge")


def volume_in_one_piece(body, crop, shares):
    """Volume of grain 1 without that of parts that break off where it is smoothed [voxels].

    The part that is left would otherwise grow to the volume of all.

    Args:
        body: `LevelSet` of the grain.
        crop: Its voxels, as `smoothed` had them.
        shares: Part of each voxel that counts, shape (y, x) of the crop, or 1.
    """
    mine = crop == 1
    weight = np.broadcast_to(shares, crop.shape)[mine]
    volume = float(weight.sum())
    inside, num_parts = scipy.ndimage.label(body.grain + FIRST_BETA * body.void > 0.5)
    if num_parts > 1:
        _, nearest = scipy.ndimage.distance_transform_edt(inside == 0, return_indices=True)
        voxels = np.bincount(inside[tuple(nearest)][mine], weight, minlength=num_parts + 1)
        if voxels.max() < (1 - LOST) * volume:
            return float(voxels.max())
    return volume


def smoothed(crop, label, offset, shape, sigma, cut=None):
    """The level set of one grain with beta = 0; ``cut`` as of `LevelSet`."""
    crop = continued(crop, offset, shape)
    fields = [(crop == number).astype(np.float32) for number in (label, 0)]
    fields = [blurred(f, sigma) for f in fields] if cut is None else cut.fit(fields, offset, sigma)
    return LevelSet(*fields, np.asarray(offset), np.asarray(shape), cut=cut)


def blurred(field, sigma):
    """A field smoothed by the Gaussian."""
    return scipy.ndimage.gaussian_filter(field, sigma, mode="nearest", truncate=3.0)
