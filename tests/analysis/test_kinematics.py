"""A known motion is found again."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mufe_fenicsx.analysis.kinematics import grain_motion
from mufe_fenicsx.geometry.bodies.shapes import box, tetrahedron

#: Rotation vectors [rad]: none, tiny, some, nearly half a turn, half a turn.
TURNS = np.array(
    [[0, 0, 0], [3e-9, -2e-9, 1e-9], [0.3, -0.5, 0.2], [0, 0, np.pi - 1e-5], [0, np.pi, 0]]
)


def blocks():
    """Blocks beside each other, labels 2, 4, …; and the number of the block of each node."""
    x, tets = box((1.0, 0.7, 0.4), (3, 2, 2))
    count = len(TURNS)
    points = np.concatenate([x + np.array([2.0 * k, 0, 0]) for k in range(count)])
    cells = np.concatenate([tets + k * len(x) for k in range(count)])
    grain = 2 + 2 * np.repeat(np.arange(count), len(tets))
    return points, cells, grain, np.repeat(np.arange(count), len(x))


def test_a_rigid_motion_is_recovered():
    points, cells, grain, block = blocks()
    turns, moves = Rotation.from_rotvec(TURNS), np.outer(np.arange(5), [0.1, -0.2, 0.05])
    middle = np.array([[0.5 + 2 * k, 0.35, 0.2] for k in range(5)])
    now = np.einsum("nij,nj->ni", turns.as_matrix()[block], points - middle[block])
    found = grain_motion(points, now + middle[block] + moves[block], cells, grain)
    assert found.labels.tolist() == [2, 4, 6, 8, 10]
    # Round-off throughout: bodies of size 1 within 10 of the origin.
    assert found.rotation == pytest.approx(turns.as_matrix(), abs=1e-13)
    assert found.rotation_vector[:4] == pytest.approx(TURNS[:4], abs=1e-12)
    assert np.abs(found.rotation_vector[4]) == pytest.approx(TURNS[4], abs=1e-12)  # ± half a turn
    assert found.angle == pytest.approx(np.linalg.norm(TURNS, axis=1), abs=1e-12)
    assert found.axis[2] * found.angle[2] == pytest.approx(TURNS[2], abs=1e-12)
    assert np.abs(found.translation - moves).max() < 1e-12
    assert found.misfit.max() < 1e-13
    assert np.abs(found.remaining_strain).max() < 1e-12
    assert found.volume_ratio == pytest.approx(1, abs=1e-12)


def test_strain_remains_and_turns_back():
    """x = R (1 + e) X grows; a general homogeneous F is the mean deformation gradient."""
    points, cells, grain, _ = blocks()
    R, e = Rotation.from_rotvec(TURNS[2]).as_matrix(), 3e-3
    found = grain_motion(points, (1 + e) * points @ R.T, cells, grain)
    assert found.rotation == pytest.approx(np.tile(R, (5, 1, 1)), abs=1e-12)
    assert np.abs(found.remaining_strain - e * np.eye(3)).max() < 1e-12
    assert found.volume_ratio == pytest.approx((1 + e) ** 3, abs=1e-12)
    F = R @ np.array([[1.02, 0.03, 0], [0, 0.97, 0.01], [-0.01, 0, 1.01]])
    found = grain_motion(points, points @ F.T, cells, grain)
    assert np.abs(found.deformation - F).max() < 1e-12
    assert found.volume_ratio == pytest.approx(np.linalg.det(F), abs=1e-12)


def test_misfit_is_that_of_the_best_rotation_and_never_a_reflection():
    """A mirrored tetrahedron cannot be turned into place; no other rotation is nearer."""
    points, cells = tetrahedron(1.0)
    points = points * [1.0, 1.3, 0.6]
    now = points * [1, 1, -1] + 1e-3 * np.arange(12).reshape(4, 3) ** 2
    found = grain_motion(points, now, cells, np.ones(1, int))
    R = found.rotation[0]
    assert np.linalg.det(R) == pytest.approx(1, abs=1e-12)
    before, after = points - points.mean(axis=0), now - now.mean(axis=0)

    def distance(turn):
        return np.sqrt(((after - before @ turn.T) ** 2).sum(axis=1).mean())

    assert found.misfit[0] == pytest.approx(distance(R), rel=1e-12)
    others = Rotation.random(200, rng=np.random.default_rng(1)).as_matrix()
    small = Rotation.from_rotvec(0.01 * np.random.default_rng(2).normal(size=(50, 3))).as_matrix()
    assert all(distance(turn) > found.misfit[0] for turn in (*others, *(small @ R)))
