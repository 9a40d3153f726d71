"""Grains are found again by their form and place, and their rigid motion by their surface."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.tracking.bodies import bodies_of
from mufe_fenicsx.geometry.tracking.matching import common_shift, match
from mufe_fenicsx.geometry.tracking.track import Track, track_bodies, track_labels
from tests.moved_balls import PITCH, moved_balls


@pytest.fixture(scope="module")
def balls():
    return moved_balls()


def errors(track, numbers, places, moved, turn):
    """Errors of displacement [voxels] and rotation [degrees] of the tracked balls."""
    at = np.searchsorted(track.label, numbers[0])
    assert (track.label_now[at] == numbers[1]).all()
    off = track.centre[at] - places
    true = moved + turn.apply(off) - off
    angle = (Rotation.from_matrix(track.rotation[at]) * turn.inv()).magnitude()
    return np.linalg.norm(track.displacement[at] - true, axis=1), np.degrees(angle)


def test_motions_of_lumpy_balls(balls):
    """A surface voxel is off by 0.29 at random; some 900 of them leave 0.02 of a shift.

    Of a turn they leave 0.29/(900^½ · slope), the slope of these forms being 1 to 2 voxels a
    radian: 0.3 to 0.6 degrees about each axis. Three times these are allowed.
    """
    images, numbers, *motion = balls
    error, angle = errors(track_labels(*images, 1.0), numbers, *motion)
    assert error.max() < 0.1 and np.sqrt((angle**2).mean()) < 1.5


def test_moments_are_those_of_a_box():
    """A box of 4 x 6 x 8 voxels has a²/12 along each axis, exactly."""
    labels = np.zeros((10, 10, 10), np.int32)
    labels[1:9, 2:8, 3:7] = 5
    found = bodies_of(labels)
    assert found.label.tolist() == [5] and found.volume.tolist() == [192] and not found.cut[0]
    assert np.allclose(found.centre, [[5, 5, 5]]) and np.allclose(
        found.moments * 12, [[16, 36, 64]]
    )


def test_a_sample_that_was_mounted_anew(balls):
    """All is nearer to another place of the lattice than to its own: only the whole tells."""
    images, numbers, places, moved, turn = balls
    images = [np.pad(images[0], 24), np.pad(images[1], ((44, 4), (24, 24), (8, 40)))]
    shift = np.array([-16.0, 0, 20])
    first, second = map(bodies_of, images)
    assert common_shift(first, second) == pytest.approx(shift, abs=1)
    track = track_labels(*images, 1.0)
    error, _ = errors(track, numbers, places + 24, moved + shift, turn)
    assert error.max() < 0.1
    # Expected where they were, all that are found are others.
    at = np.searchsorted(first.label, numbers[0])
    found = match(first, second, np.zeros((12, 3)))[at]
    assert not (second.label[found] == numbers[1])[found >= 0].any()


def test_form_tells_grains_where_place_misleads(balls):
    """Expected two thirds of a pitch up, each ball is nearer to the one above than to itself."""
    images, numbers, *_ = balls
    lower = np.arange(12) % 3 < 2  # of three layers; all are there in the second scan
    first = bodies_of(np.where(np.isin(images[0], numbers[0][lower]), images[0], 0))
    second = bodies_of(images[1])
    found = match(first, second, np.tile([0.0, 0.0, 2 / 3 * PITCH], (8, 1)))
    at = np.searchsorted(first.label, numbers[0][lower])
    assert second.label[found[at]].tolist() == numbers[1][lower].tolist()


def test_a_grain_that_is_gone_is_lost(balls):
    images, numbers, *_ = balls
    later = np.where(images[1] == numbers[1][3], 0, images[1])
    track = track_labels(images[0], later, 1.0)
    assert track.label[~track.found].tolist() == [numbers[0][3]]
    assert np.isnan(track.rotation[~track.found]).all()


def test_a_large_turn_needs_a_scan_in_between_or_a_form():
    """Up to 120 degrees. A turn that is looked for from none is off by 180 for some balls.

    Of the first sample axes of inertia tell; of the second one a scan in between, at half of it:
    there wrong turns fit as well, balls being nearly ellipsoids.
    """
    images, numbers, *motion = moved_balls((2, 1, 2), angle=120.0, seed=5)
    error, angle = errors(track_labels(*images, 1.0), numbers, *motion)
    assert error.max() < 0.2 and angle.max() < 5

    images, numbers, places, moved, turn = moved_balls((2, 1, 2), angle=120.0, seed=6)
    at = np.argsort(numbers[0])
    half = Rotation.from_rotvec(0.5 * turn.as_rotvec()).as_matrix()
    between = Track(np.sort(numbers[0]), numbers[0][at], places[at], 0.5 * moved[at], half[at],
                    np.zeros(4))  # fmt: skip
    old, new = map(bodies_of, images)
    track = track_bodies(old, new, 1.0, ("a", "b"), between)
    error, angle = errors(track, numbers, places, moved, turn)
    assert error.max() < 0.2 and angle.max() < 5


def test_scans_that_do_not_belong_together(balls):
    images, *_ = balls
    with pytest.raises(InputError, match=r"labels b have shape .*, expected .* as a"):
        track_labels(images[0], images[1][1:], 1.0, names=("a", "b"))
    with pytest.raises(InputError, match="b: no grain, all voxels are 0"):
        track_labels(images[0], 0 * images[1], 1.0, names=("a", "b"))
    other = np.zeros_like(images[0])
    other[2:6, 2:6, 2:6] = 1  # of another size
    with pytest.raises(InputError, match="labels b: none of the 12 grains of a is found again"):
        track_labels(images[0], other, 1.0, names=("a", "b"))


def test_how_balls_turn_is_not_told():
    """Three balls of 18 voxels move; an ellipsoid beside them, longer by a fifth, has its turn."""
    place = np.array([[12.0, 12, 12], [12, 34, 13], [34, 12, 12], [34, 34, 12]])
    moved = np.array([[0.5, -0.3, 1.0], [0.2, 0.4, 0.8], [-0.4, 0.1, 0.7], [0.3, 0.3, 0.6]])
    stretch = np.array([[1.0, 1, 1]] * 3 + [[1.2, 1.0, 0.75]])
    voxel = np.moveaxis(np.indices((26, 46, 46))[::-1], 0, -1) + 0.5
    first, later = np.zeros((2, 26, 46, 46), np.int32)
    for k in range(4):
        for image, at in ((first, place[k]), (later, place[k] + moved[k])):
            image[np.linalg.norm((voxel - at) / stretch[k], axis=-1) < 9] = k + 1
    track = track_labels(first, later, 1.0)
    # A tenth of a voxel, as of all grains.
    assert track.displacement == pytest.approx(moved, abs=0.1)
    assert np.isfinite(track.rotation).all(axis=(1, 2)).tolist() == [False] * 3 + [True]
    assert np.degrees(Rotation.from_matrix(track.rotation[3]).magnitude()) < 1.5
