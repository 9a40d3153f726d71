"""Grains and labels that the tests of exchange use."""

import numpy as np
from scipy.spatial.transform import Rotation

from mufe_fenicsx.geometry.bodies.shapes import box, sphere
from mufe_fenicsx.geometry.grains import Grains

#: Edges of a brick, its turn in the sample, and its place.
EDGES = np.array([3e-4, 2e-4, 1e-4])
TURN = Rotation.from_rotvec([0.4, -1.1, 0.7])
PLACE = np.array([5e-4, -2e-4, 8e-4])
RADIUS = 1e-4


def turned_brick():
    """Nodes and cells of a brick that is neither at the origin nor along the axes."""
    points, cells = box(EDGES, (6, 4, 2), -EDGES / 2)
    return TURN.apply(points) + PLACE, cells


def brick_distance(at):
    """Signed distance of positions in the sample from that brick, in closed form [m]."""
    beyond = np.abs(TURN.inv().apply(np.asarray(at) - PLACE)) - EDGES / 2
    outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
    return outside + np.minimum(beyond.max(axis=1), 0)


def ball_and_brick():
    """:class:`Grains` of a ball at the origin, label 3, and of that brick, label 12."""
    return Grains.from_list([12, 3], [turned_brick(), sphere(RADIUS, 0.25 * RADIUS)], 5e-5)


def packed_labels(shape=(24, 22, 20), num_grains=18, largest=None):
    """Cells about random points with voids between, labels with gaps in their numbers."""
    rng = np.random.default_rng(4)
    seeds = rng.uniform(0, 1, (num_grains, 3)) * shape
    at = np.stack(np.indices(shape), axis=-1) + 0.5
    distance = np.linalg.norm(at[..., None, :] - seeds, axis=-1)
    numbers = np.arange(1, num_grains + 1) * 2
    if largest is not None:
        numbers[-1] = largest
    void = distance.min(axis=-1) > 5.0
    return np.where(void, 0, numbers[distance.argmin(axis=-1)]).astype(np.int32)
