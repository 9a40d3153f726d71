"""Small label images whose grains are known."""

import numpy as np


def positions(shape):
    """Centres of voxels (z, y, x) in voxels, counted from the corner of the image."""
    return np.stack(np.meshgrid(*[np.arange(n) + 0.5 for n in shape], indexing="ij"), axis=-1)


def ball(shape, centre, radius):
    """True within a ball; centre (z, y, x) and radius in voxels."""
    return np.linalg.norm(positions(shape) - np.asarray(centre), axis=-1) < radius


def two_balls():
    """Labels of two overlapping balls, parted by the plane half-way between their centres."""
    shape, a, b, radius = (28, 28, 44), (14, 14, 14), (14, 14, 30), 9.5
    first, second = ball(shape, a, radius), ball(shape, b, radius)
    left = positions(shape)[..., 2] < 22
    return np.where(first & left, 1, np.where(second & ~left, 2, 0)).astype(np.int32)


def grey_packing():
    """A noisy grey image of eight balls that touch, 36 voxels a side."""
    rng = np.random.default_rng(3)
    shape, image = (36, 36, 36), np.full((36, 36, 36), 60.0)
    for z in (10, 26):
        for y in (10, 26):
            for x in (10, 26):
                image[ball(shape, (z, y, x), 8.5)] = 180.0
    return (image + rng.normal(0, 8, shape)).clip(0, 255).astype(np.uint8)
