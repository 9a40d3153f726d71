"""Balls in a cylinder, as a scan shows them: a mould around, a round field of view, noise."""

import numpy as np
import scipy.ndimage

VOID, SOLID = 80.0, 160.0


def balls_in_cylinder(shape, x, y, radius, seed=1, sizes=(5.5, 7.5), lean=(0.0, 0.0)):
    """True labels of balls that neither overlap nor leave a cylinder; some touch it.

    Args:
        shape: Voxels, (z, y, x).
        x, y, radius: Cylinder [voxels], its axis at half height.
        seed: Of places and radii.
        sizes: Least and largest radius of balls [voxels].
        lean: dx/dz and dy/dz of the axis.
    """
    rng = np.random.default_rng(seed)
    labels, places = np.zeros(shape, dtype=np.int32), np.empty((0, 4))
    for turn in range(3000):
        r = rng.uniform(*sizes)
        # Every third one touches the wall.
        away = (radius - r) * (1 if turn % 3 == 0 else rng.uniform() ** 0.5)
        angle, z = rng.uniform(0, 2 * np.pi), rng.uniform(r, shape[0] - r)
        at = [z, y + lean[1] * (z - shape[0] / 2) + away * np.sin(angle),
              x + lean[0] * (z - shape[0] / 2) + away * np.cos(angle)]  # fmt: skip
        apart = np.linalg.norm(places[:, :3] - at, axis=1) - places[:, 3] - r
        if (apart > 1.5).all():
            places = np.vstack([places, [*at, r]])
    for number, (z, j, i, r) in enumerate(places, start=1):
        low = np.maximum(np.floor([z - r, j - r, i - r]).astype(int), 0)
        part = tuple(slice(a, int(a + 2 * r + 3)) for a in low)
        view = labels[part]
        axes = [np.arange(a, a + n) + 0.5 for a, n in zip(low, view.shape, strict=True)]
        d = (
            (axes[0] - z)[:, None, None] ** 2
            + (axes[1] - j)[None, :, None] ** 2
            + (axes[2] - i)[None, None, :] ** 2
        )
        view[d < r * r] = number
    return labels


def scan_of(labels, distance, radius, *, mould=None, field=None, noise=8.0, wall=8.0):
    """A grey image of labels, blurred and noisy.

    Args:
        labels: True ones, (z, y, x).
        distance: Of voxels from the axis, as broadcast to them.
        radius: Of the inner wall [voxels].
        mould: Grey level of a ring of thickness ``wall`` around the sample, or None.
        field: True where something is measured, or None; elsewhere the image is 0.
    """
    grey = np.where(labels > 0, SOLID, VOID)
    if mould is not None:
        grey = np.where((distance > radius) & (distance < radius + wall), mould, grey)
    grey = scipy.ndimage.gaussian_filter(grey, 0.8)
    grey = grey + np.random.default_rng(2).normal(0, noise, grey.shape)
    grey = np.clip(np.rint(grey), 1, 255).astype(np.uint8)
    return grey if field is None else np.where(field, grey, 0).astype(np.uint8)
