"""Grains are told apart, and labels that cannot be meshed are refused."""

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry import segmentation
from mufe_fenicsx.geometry.label_files import grain_table, read_labels, write_labels
from mufe_fenicsx.geometry.labels import checked_labels, fill_pores
from mufe_fenicsx.geometry.segmentation import distance_map, separate_grains
from mufe_fenicsx.geometry.settings import SegmentSettings
from tests.geometry.scenes import ball, two_balls


def separated(solid, **settings):
    """Labels of a solid, and what was dropped."""
    labels, done = separate_grains(solid, SegmentSettings(voxel_size=1e-5, **settings))
    return labels, done["dropped_fragments"], done["dropped_voxels"]


@pytest.mark.parametrize("how", ["depth", "level", "markers"])
def test_overlapping_balls_are_cut_at_their_neck(how):
    truth = two_balls()
    labels, dropped, dropped_voxels = separated(
        truth > 0, min_grain_voxels=0, separation=how, tightening=3.0
    )
    assert labels.max() == 2 and dropped == 0 and dropped_voxels == 0
    swapped = labels[14, 14, 14] == 2
    found = np.where(labels > 0, 3 - labels if swapped else labels, 0)
    # Both sides of the neck are as far from the void: all of one voxel's layer may go either way.
    assert np.count_nonzero(found != truth) <= np.count_nonzero(truth[:, :, 22])


def test_one_ball_stays_one_grain():
    solid = ball((30, 30, 30), (15, 15, 15), 11)
    labels, _, _ = separated(solid)
    assert np.array_equal(labels > 0, solid) and labels.max() == 1


def test_distances_do_not_depend_on_slabs(monkeypatch):
    solid = two_balls() > 0
    solid[2:26, 5:25, 15:40] = True
    whole = distance_map(solid)
    monkeypatch.setattr(segmentation, "SLAB", 3 * solid[0].size)
    assert np.array_equal(distance_map(solid), whole)


def test_crumbs_are_dropped_and_counted():
    solid = two_balls() > 0
    solid[1:3, 1:3, 1:4] = True
    solid[25, 1, 1] = True
    labels, dropped, dropped_voxels = separated(solid, min_grain_voxels=100)
    assert labels.max() == 2
    assert (dropped, dropped_voxels) == (2, 13)


def test_pores_are_filled_and_voids_are_not():
    solid = ball((30, 30, 30), (15, 15, 15), 11)
    hollow = solid & ~ball((30, 30, 30), (15, 15, 15), 3)
    assert np.array_equal(fill_pores(hollow), solid)


def test_table_of_a_box():
    labels = np.zeros((10, 12, 14), dtype=np.int32)
    labels[0:4, 2:6, 4:10] = 5
    labels[6:8, 6:8, 6:8] = 9
    first, second = grain_table(labels, 1e-5)
    assert first["label"] == 5 and first["voxels"] == 96
    assert first["touches_border"] and not second["touches_border"]
    assert first["volume_m3"] == pytest.approx(96e-15, rel=1e-12)
    centre = [first[f"centroid_{axis}_m"] for axis in "xyz"]
    assert centre == pytest.approx([7e-5, 4e-5, 2e-5], rel=1e-12)


def test_labels_keep_their_voxel_size(tmp_path):
    path = tmp_path / "labels.tif"
    write_labels(path, two_balls(), 5e-6)
    labels, voxel_size = read_labels(path)
    assert np.array_equal(labels, two_balls()) and voxel_size == 5e-6
    with pytest.raises(InputError, match=r"voxel_size = 1e-05 m.*states 5e-06 m"):
        read_labels(path, voxel_size=1e-5)


def test_foreign_labels_need_a_voxel_size(tmp_path):
    np.savez(tmp_path / "foreign.npz", solid=two_balls() > 0, labels=two_balls())
    labels, voxel_size = read_labels(tmp_path / "foreign.npz", voxel_size=2e-6)
    assert np.array_equal(labels, two_balls()) and voxel_size == 2e-6
    with pytest.raises(InputError, match=r"voxel_size of .*foreign.npz is not stated"):
        read_labels(tmp_path / "foreign.npz")


GREY_LEVELS = np.random.default_rng(1).normal(120, 20, (12, 12, 12)).astype(np.uint8)


def changed(value, where=np.s_[14, 14, 14], dtype=np.int32):
    labels = two_balls().astype(dtype)
    labels[where] = value
    return labels


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        (two_balls()[0], "2 axes"),
        (two_balls() + 0.25, r"float64, with 0.25 at \(z, y, x\) = \(0, 0, 0\)"),
        (
            two_balls().astype(np.float32) * np.float32(2e7),
            "largest label is 4e[+]07 as float32, expected up to 167",
        ),
        (GREY_LEVELS, r"[0-9]+ labels, and 9[0-9]% of neighbouring voxels .* like grey levels"),
        (changed(-3), "smallest label is -3"),
        (two_balls() * 0, "no grain, all voxels are 0"),
        (np.minimum(two_balls(), 1), "one grain only, label 1"),
        (changed(2, np.s_[1:4, 1:4, 1:4]), "grain 2 is in 2 pieces of .* 27 voxels"),
        (changed(7, np.s_[1, 1:9, 1:9]), "grain 7 of 64 voxels within 1 x 8 x 8 is thinner"),
    ],
)
def test_labels_that_cannot_be_meshed_are_refused(labels, message):
    with pytest.raises(InputError, match=message) as caught:
        checked_labels(labels)
    assert "\n" not in str(caught.value)


def test_labels_of_fiji_are_floating_point_numbers():
    labels, _ = checked_labels(two_balls().astype(np.float32))
    assert labels.dtype == np.int32 and np.array_equal(labels, two_balls())


def test_largest_piece_is_kept_on_request():
    labels, trimmed = checked_labels(changed(2, np.s_[1:4, 1:4, 1:4]), keep_largest_piece=True)
    assert np.array_equal(labels, two_balls()) and trimmed == [2]
