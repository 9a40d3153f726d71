"""Rigid motion of a grain between two scans: the six numbers that lay one image on the other.

Both grains are their indicators, smoothed by a Gaussian, so that they have a slope at the surface.
The motion x → c + R (x - c) + t is that of the least sum of squares of their difference over
places near the surface, coarse first and fine then. Where grains touch, labels end by the
watershed and not by the surface: places that fit badly are left out, and the motion is found again.

Source: B. D. Lucas & T. Kanade, Proc. 7th IJCAI, 1981, 674-679, on labels instead of grey levels;
least squares by J. J. Moré's Levenberg-Marquardt method (MINPACK, by SciPy).
"""

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

#: Standard deviations of the filter, coarse and fine [voxels], places that are looked at, and how
#: often those that fit badly are left out.
STAGES = ((2.5, 1000, 0), (1.0, 5000, 2))
#: A place is near the surface if the smoothed indicator is between this and one less this.
NEAR = 0.03
#: A place fits badly if its difference is so many times the median; where more than this share of
#: them do, it is the grain that has changed its form, and all count.
BAD, BAD_SHARE = 4.0, 0.12
#: Misfit above which other rotations are tried as a start, too, and the part of it that theirs has
#: to be below.
POOR, BETTER = 0.05, 0.5
#: Voxels beside the border of an image where no surface is known.
RIM = 2


def smoothed(bodies, number, sigma, pad):
    """Smoothed indicator of a grain in its box, and the box's corner (z, y, x).

    Args:
        bodies: :class:`~.bodies.Bodies`.
        number: Of the grain among them.
        sigma: Of the Gaussian [voxels].
        pad: Voxels around the grain.
    """
    shape, box = bodies.image.shape, bodies.boxes[number]
    around = tuple(
        slice(max(s.start - pad, 0), min(s.stop + pad, n)) for s, n in zip(box, shape, strict=True)
    )
    mask = (bodies.image[around] == bodies.label[number]).astype(float)
    return gaussian_filter(mask, sigma, mode="nearest"), np.array([s.start for s in around])


def register(first, i, second, j, start):
    """Rigid motion of grain ``i`` of a scan to grain ``j`` of a later one.

    Args:
        first, second: :class:`~.bodies.Bodies`.
        i, j: Numbers of the grain in both.
        start: Rotation to begin with.

    Returns:
        Displacement of the centre in the first scan [voxels], (x, y, z); the rotation; and the
        misfit, the squares of the difference over those of the variation of the first.
    """
    best = _best_of(first, i, second, j, [start])
    if best[2] > POOR:
        turns = [first.axes[i], second.axes[j]]
        signs = [np.diag(d) for d in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))]
        others = [Rotation.from_matrix(turns[1] @ sign @ turns[0].T) for sign in signs]
        other = _best_of(first, i, second, j, others)
        best = other if other[2] < BETTER * best[2] else best
    return best


def _best_of(first, i, second, j, starts):
    """The motion of the least misfit from several rotations to begin with."""
    shift = second.centre[j] - first.centre[i]
    found = [(shift, start, 0.0) for start in starts]
    for stage in STAGES:
        pair = _Pair(first, i, second, j, *stage)
        found = [pair.fitted(*motion[:2]) for motion in found]
        found = [min(found, key=lambda motion: motion[2])]
    return found[0]


class _Pair:
    """Images of a grain in both scans, smoothed by ``sigma``, and places near its surface."""

    def __init__(self, first, i, second, j, sigma, num_places, again):
        pad = int(np.ceil(3 * sigma)) + 1
        image, corner = smoothed(first, i, sigma, pad)
        chosen = np.argwhere((image > NEAR) & (image < 1 - NEAR))
        inside = _within(chosen + corner + 0.5, first.image.shape)
        chosen = chosen[inside] if inside.any() else chosen
        chosen = chosen[:: max(1, len(chosen) // num_places)]
        self.value, self.again = image[tuple(chosen.T)], again
        self.centre = first.centre[i]
        self.away = (chosen + corner + 0.5)[:, ::-1] - self.centre
        self.target, self.corner = smoothed(second, j, sigma, pad)
        self.shape = first.image.shape
        # Turns are counted as motions of the surface, as long as shifts.
        self.radius = np.sqrt(first.moments[i].sum())
        self.variation = ((self.value - 0.5) ** 2).mean()

    def fitted(self, shift, start):
        """Displacement, rotation and misfit from a start."""
        known = _within(self._moved(shift, start)[:, ::-1], self.shape)
        for left in range(self.again, -1, -1):
            if known.sum() < 6:  # as many numbers as there are
                return shift, start, np.inf
            found = least_squares(
                self._difference, np.zeros(6), method="lm", xtol=1e-4, ftol=1e-4,
                args=(shift, start, known),
            )  # fmt: skip
            shift = shift + found.x[:3]
            start = Rotation.from_rotvec(found.x[3:] / self.radius) * start
            off = np.abs(found.fun)
            good = off <= BAD * np.median(off)
            if not left or good.mean() < 1 - BAD_SHARE:
                break
            known[known] = good
        off = self._difference(np.zeros(6), shift, start, _within(
            self._moved(shift, start)[:, ::-1], self.shape))  # fmt: skip
        return shift, start, float((off**2).mean() / self.variation)

    def _difference(self, numbers, shift, start, known):
        """Of both images at the known places, after a motion beyond a start."""
        turn = Rotation.from_rotvec(numbers[3:] / self.radius) * start
        moved = self._moved(shift + numbers[:3], turn, known)[:, ::-1]
        at = (moved - self.corner - 0.5).T
        return map_coordinates(self.target, at, order=1, mode="nearest") - self.value[known]

    def _moved(self, shift, turn, chosen=slice(None)):
        """The chosen places as the motion takes them [voxels], (x, y, z)."""
        return self.centre + shift + turn.apply(self.away[chosen])


def _within(place, shape):
    """Which places (z, y, x) are not beside the border of an image."""
    return ((place > RIM) & (place < np.array(shape) - RIM)).all(axis=1)
