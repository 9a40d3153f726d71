"""Grains that a cylinder along z cuts: their round faces lie on it, and have sharp edges."""

import numpy as np
import scipy.ndimage

from .level_set import blurred, face_tag
from .remesh import SurfaceError

#: Tag of triangles in the round face, after those of the faces of an image.
ROUND = face_tag(3, 0)
#: How far a grain may reach sideways from the middle of its round face [radius].
REACH = 0.85
#: Layers around a grain beyond its last voxels, more than smoothing moves its surface by [voxels].
AROUND = 3
#: A voxel whose middle is so near to the cylinder is at its rim [voxels].
RIM = 1.5
#: Places where less than this part of the Gaussian lies within the cylinder have no fit.
LEAST_WEIGHT = 0.02
#: Added to variances of the radius, which vanish for the narrowest Gaussians [voxels²].
LEAST_VARIANCE = 1e-2


class RoundCut:
    """The cylinder; positions (z, y, x) in voxels, counted as those of a `LevelSet`.

    Args:
        middle: Of the axis, (y, x).
        radius: [voxels].
    """

    def __init__(self, middle, radius):
        self.middle, self.radius = np.asarray(middle, dtype=float), float(radius)

    def distance(self, x):
        """Distances of positions from the axis, shape (n,)."""
        return np.linalg.norm(x[:, 1:] - self.middle, axis=1)

    def without_radial(self, vectors, x, which):
        """Vectors at positions, where ``which`` without their part along the radius."""
        result = vectors.copy()
        out = x[which, 1:] - self.middle
        out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
        result[which, 1:] -= np.einsum("ij,ij->i", vectors[which, 1:], out)[:, None] * out
        return result

    def fit(self, fields, offset, sigma):
        """Fields smoothed by a Gaussian, of which voxels beyond the cylinder are no part.

        Near it they are the value of a local fit, linear in the radius r, by the least squares of
        the Gaussian's weights w. With the moments M_k = sum w (r - r0)^k and
        N_k = sum w f (r - r0)^k over voxels within, it is

            f(r0) = (M_2 N_0 - M_1 N_1) / (M_0 M_2 - M_1^2),

        a fit that has no error of the first order at an edge (J. Fan, I. Gijbels, Local Polynomial
        Modelling and Its Applications, 1996, 3.2). It is linear in the fields: those that add up to
        1 still do.

        Args:
            fields: List of arrays (z, y, x).
            offset: Position of their first voxel.
            sigma: Standard deviation of the Gaussian [voxels].
        """
        y, x = (offset[i] + np.arange(fields[0].shape[i]) for i in (1, 2))
        r = np.hypot(y[:, None] - self.middle[0], x[None] - self.middle[1]) - self.radius
        inside = r <= 0
        M0, M1, M2 = (blurred(inside * r**k, sigma) for k in range(3))
        M2 += LEAST_VARIANCE * M0 + r * (r * M0 - 2 * M1)
        M1 -= r * M0
        known = M0 > LEAST_WEIGHT
        linear = known & (M0 < 1 - 1e-6)
        below = np.where(linear, M0 * M2 - M1**2, 1.0)
        near = scipy.ndimage.distance_transform_edt(
            ~known, return_distances=False, return_indices=True
        )
        found = []
        for field in fields:
            N0 = blurred(field * inside, sigma)
            N1 = blurred(field * (inside * r), sigma) - r * N0
            value = np.where(linear, (M2 * N0 - M1 * N1) / below, N0)
            found.append(value[:, near[0], near[1]])
        return found

    def kept(self, x, on, clearance):
        """Positions put onto the cylinder where ``on``, and elsewhere kept within it.

        Args:
            x: Shape (n, 3).
            on: Shape (n,).
            clearance: Least distance of the others from it, shape (n,).
        """
        out = x[:, 1:] - self.middle
        length = np.maximum(np.linalg.norm(out, axis=1), 1e-12)
        wanted = np.where(on, self.radius, np.minimum(length, self.radius - clearance))
        result = x.copy()
        change = wanted != length
        result[change, 1:] = self.middle + out[change] * (wanted / length)[change, None]
        return result


def reaches_cut(level_set):
    """Whether a cylinder cuts the grain of a `LevelSet`."""
    if level_set.cut is None:
        return False
    beyond = np.argwhere(level_set.grain > 0.5) + level_set.offset
    return bool((level_set.cut.distance(beyond) > level_set.cut.radius).any())


class RoundGrid:
    """A grid around a grain whose last layer is the cylinder that cuts it.

    Its axes are z, m and t: with the unit vector e from the axis towards the grain's face and f at
    right angles to it, a place is

        middle + e (√(R² - t²) + m) + f t,

    so that m = 0 is the cylinder, and m < 0 within it.

    Args:
        level_set: `LevelSet` with a ``cut``.

    Raises:
        SurfaceError: The grain is too wide for the cylinder.
    """

    def __init__(self, level_set):
        self.level_set, self.cut = level_set, level_set.cut
        grain = np.argwhere(level_set.grain > 0.3) + level_set.offset
        away = grain[:, 1:] - self.cut.middle
        distance = np.linalg.norm(away, axis=1)
        grain, away = grain[distance < self.cut.radius + 1], away[distance < self.cut.radius + 1]
        rim = away[np.linalg.norm(away, axis=1) > self.cut.radius - RIM]
        if len(rim) == 0:
            raise SurfaceError("grain vanishes when its surface is smoothed")
        middle, radius = rim.mean(axis=0), self.cut.radius
        self.e = middle / max(np.linalg.norm(middle), 1e-12)
        self.f = np.array([-self.e[1], self.e[0]])
        t, ahead = away @ self.f, away @ self.e
        # A grain all around the axis has no side.
        one_sided = np.linalg.norm(middle) > 0.5 * radius and (rim @ self.e).min() > 0
        if not one_sided or np.abs(t).max() + AROUND > REACH * radius:
            raise SurfaceError(
                "grain is too wide for the cylinder that cuts it, expected at most "
                f"{REACH * radius - AROUND:.3g} voxels to each side of the middle of its round face"
            )
        depth = (np.sqrt(radius**2 - t**2) - ahead).max() + AROUND
        self._t = np.arange(np.floor(t.min()) - AROUND, t.max() + AROUND + 1)
        self._m = -np.arange(np.ceil(depth) + 1)[::-1]

    def nodes(self):
        """psi on the grid, positions along its axes and tags of ends, as `LevelSet.nodes`."""
        body = self.level_set
        _, (z, *_), faces = body.nodes()
        faces = np.stack([faces[0], [0, ROUND], [0, 0]])
        m, t = np.append(self._m, 0.0), self._t
        at = np.stack(np.meshgrid(z, m, t, indexing="ij"), axis=-1).reshape(-1, 3)
        x = self.placed(at)
        psi = body.value_and_gradient(x)[0]
        index = x - body.offset
        known = ((index >= 0) & (index <= np.array(body.grain.shape) - 1)).all(axis=1)
        psi = np.where(known, psi, -0.5).reshape(len(z), len(m), len(t))
        # Layers at the ends are outside; those of faces stand in the place of the last within.
        psi[:, 0], psi[:, :, [0, -1]] = -0.5, -0.5
        psi[:, -1], psi[[0, -1]] = -1.0, -1.0
        return psi, [z, m, t], faces

    def placed(self, at):
        """Positions (z, y, x) of places (z, m, t), shape (n, 3)."""
        z, m, t = at.T
        ahead = np.sqrt(self.cut.radius**2 - t**2) + m
        plane = self.cut.middle + ahead[:, None] * self.e + t[:, None] * self.f
        return np.column_stack([z, plane])
