"""Lumpy balls as labels of two scans, between which each has moved and turned as is known."""

import numpy as np
from scipy.spatial.transform import Rotation

from mufe_fenicsx.kernels.geometry.voxels import label_cells
from tests.made_up_run import ball

#: Distance of the balls, and the mean of their radii [voxels].
PITCH, RADIUS = 24.0, 10.0


def moved_balls(counts=(2, 2, 3), angle=20.0, shift=0.5, seed=0):
    """Labels of both scans, (z, y, x), and the motion in between.

    Returns:
        Two label images, numbered by chance; of each ball its label in both; its centre before,
        its displacement [voxels] and its rotation.
    """
    rng = np.random.default_rng(seed)
    places = PITCH * (np.array(list(np.ndindex(*counts))) + 0.5) + 2
    n = len(places)
    axis = rng.standard_normal((n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turn = Rotation.from_rotvec(axis * np.radians(angle) * rng.random((n, 1)))
    moved = rng.uniform(-shift, shift, (n, 3))
    images = [np.zeros(tuple(int(PITCH * c) + 4 for c in counts[::-1]), np.int32) for _ in "ab"]
    numbers = [1 + rng.permutation(n) for _ in images]
    for k in range(n):
        x, cells = ball(8, RADIUS * rng.uniform(0.85, 1.0), rng)
        x = x * [1.0, 0.9, 0.75]
        for image, label, y in zip(
            images, numbers, (x + places[k], turn[k].apply(x) + places[k] + moved[k]), strict=True
        ):
            labels = np.full(len(cells), label[k], np.int32)
            label_cells(image, np.ascontiguousarray(y), cells.astype(np.int64), labels)
    return images, numbers, places, moved, turn
