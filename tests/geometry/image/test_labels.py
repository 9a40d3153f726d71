"""Grains are told apart, and labels that cannot be meshed are refused."""

import numpy as np
import pytest
import scipy.ndimage

from mufe_fenicsx.cli.main import main
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image.label_files import grain_table, read_labels, write_labels
from mufe_fenicsx.geometry.image.labels import checked_labels, fill_pores
from mufe_fenicsx.geometry.image.segmentation import distance_map, distance_to_void, separate_grains
from mufe_fenicsx.geometry.mesh import mesh_labels
from mufe_fenicsx.geometry.settings import MeshSettings, SegmentSettings
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


def test_distances_are_those_of_scipy():
    """Squares of distances are whole numbers: equal to the last bit; in the void they are zero."""
    solid = np.random.default_rng(0).random((9, 30, 40)) < 0.97
    solid[3:8, 4:20, 5:30] = True
    expected = scipy.ndimage.distance_transform_edt(solid).astype(np.float32)
    assert np.array_equal(distance_to_void(solid), expected)
    assert np.all(distance_to_void(np.ones((3, 4, 12), bool)) == 13)


def test_distances_ignore_what_was_not_measured():
    """A ball cut by the field of view is as deep as one cut by the border of the image."""
    solid = ball((30, 30, 30), (15, 15, 15), 11)
    outside = np.zeros(solid.shape, dtype=bool)
    outside[:, :, 15:] = True
    part = distance_map(solid & ~outside, outside=outside, smoothing=0)
    cut = distance_map(solid[:, :, :15], smoothing=0)
    assert np.array_equal(part[:, :, :15], cut) and part[:, :, 15:].max() == 0
    # The middle of the ball, as far from the void as before it was cut.
    assert part[15, 15, 14] == distance_map(solid, smoothing=0)[15, 15, 14]


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
        (two_balls().astype(np.int64) * 10**9, "largest label is 2000000000, expected at most"),
        (changed(2, np.s_[1:4, 1:4, 1:4]), "grain 2 is in 2 pieces of .* 27 voxels"),
        (changed(7, np.s_[1, 1:9, 1:9]), "grain 7 of 64 voxels within 1 x 8 x 8 is thinner"),
    ],
)
def test_labels_that_cannot_be_meshed_are_refused(labels, message):
    with pytest.raises(InputError, match=message) as caught:
        checked_labels(labels)
    assert "\n" not in str(caught.value)


def test_one_grain_alone_is_taken():
    assert checked_labels(np.minimum(two_balls(), 1) * 5)[0].max() == 5


def test_large_labels_are_numbered_anew(tmp_path):
    """Tables by label would have a row for each number up to the largest one."""
    labels = two_balls().astype(np.int64) * 10**12
    np.save(tmp_path / "a.npy", labels)
    numbers = []
    found, _ = read_labels(tmp_path / "a.npy", voxel_size=1e-5, numbers=numbers)
    assert np.array_equal(found, two_balls()) and numbers == [10**12, 2 * 10**12]


def test_labels_of_fiji_are_floating_point_numbers():
    labels, _ = checked_labels(two_balls().astype(np.float32))
    assert labels.dtype == np.int32 and np.array_equal(labels, two_balls())


def test_largest_piece_is_kept_on_request():
    labels, left = checked_labels(changed(2, np.s_[1:4, 1:4, 1:4]), keep_largest_piece=True)
    assert np.array_equal(labels, two_balls()) and left == {2: ([27], False)}


def three_balls(*centres):
    """Balls of 9 voxels on a line along x, with the labels 1, 2, 1."""
    z, y, x = np.ogrid[:24, :24, :67]
    labels = np.zeros((24, 24, 67), dtype=np.int32)
    for centre, label in zip(centres, (1, 2, 1), strict=True):
        labels[(z - 12) ** 2 + (y - 12) ** 2 + (x - centre) ** 2 < 81] = label
    return labels


@pytest.mark.parametrize(
    ("centres", "hint"),
    [
        ((12.5, 32.5, 54.5), "as large as grains: has the number been used twice?"),
        ((3, 32.5, 63), "they lie on opposite faces: was the image periodic?"),
    ],
)
def test_pieces_left_out_are_told(tmp_path, no_workers, centres, hint):
    """Half of a number used twice was gone, and the volume of all meshes 0.99996 of that given."""
    np.save(tmp_path / "a.npy", three_balls(*centres))
    made = mesh_labels(
        tmp_path / "a.npy",
        MeshSettings(size=5e-5, voxel_size=1e-5, keep_largest_piece=True),
        tmp_path / "grains",
    )
    where, line = made["notices"]
    assert "label 1 is in 2 pieces of" in where
    assert line.startswith("grain 1: 1 pieces of ") and line.endswith(hint)
    assert made["smallest_volume_ratio"] == pytest.approx(0.5, abs=0.03)
    assert made["volume_ratio"] < 0.75 and made["warnings"][0].startswith("grain 1: the mesh has")


def test_pieces_that_a_cylinder_leaves_are_told(tmp_path, no_workers):
    """A number used twice, at the rim of a round sample: its other ball was gone without a word."""
    labels = np.pad(three_balls(12.5, 32.5, 50.5), ((0, 0), (20, 23), (0, 0)))
    np.save(tmp_path / "a.npy", labels)
    settings = MeshSettings(size=5e-5, voxel_size=1e-5, cylinder_radius=2.4e-4)
    made = mesh_labels(tmp_path / "a.npy", settings, tmp_path / "grains")
    where, line = made["notices"]
    assert "label 1 is in 2 pieces of" in where
    assert line.startswith("grain 1: 1 pieces of ") and made["smallest_volume_ratio"] < 0.7


def with_lines():
    labels = two_balls()
    labels[:, :, 22] = 0
    return labels


@pytest.mark.parametrize(
    ("labels", "said"),
    [
        (two_balls() + 1, "label 1 is on all six faces of the image and surrounds 2 of 2"),
        (two_balls() > 0, "one label, one grain; a mask of many is parted by `mufe segment`"),
        (with_lines(), "1 pairs of labels are one voxel of void apart, and 0 touch"),
        (two_balls(), None),
    ],
)
def test_labels_that_are_hardly_meant_are_told(capfd, tmp_path, labels, said):
    """Voids with a number, masks, watershed lines: grains of another kind without a word."""
    np.save(tmp_path / "a.npy", labels)
    words = ["-o", str(tmp_path / "s"), "--voxel-size", "2 um,1 um,1 um"]
    with pytest.raises(SystemExit):
        main(["shapes", str(tmp_path / "a.npy"), *words])
    lines = [line for line in capfd.readouterr().out.splitlines() if line.startswith(str(tmp_path))]
    assert [said in line for line in lines] == [True] if said else not lines


def test_pieces_as_large_as_grains_are_no_crumbs():
    """A number used twice, or wrapped at 255: the largest piece would be half of the grains."""
    with pytest.raises(InputError, match="expected one: has the number been used twice, or is"):
        checked_labels(three_balls(12.5, 32.5, 54.5))
    with pytest.raises(InputError, match="expected one; or ask to keep the largest piece"):
        checked_labels(changed(2, np.s_[1:4, 1:4, 1:4]))
