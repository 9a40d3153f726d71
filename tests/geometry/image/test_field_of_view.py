"""What was not measured takes part in nothing; voids that look like it are voids."""

import numpy as np
import pytest
import scipy.ndimage
import tifffile

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image.field_of_view import field_of_view, filled, padding
from mufe_fenicsx.geometry.image.image_files import read_image
from mufe_fenicsx.geometry.image.segmentation import segment
from mufe_fenicsx.geometry.image.threshold import find_threshold
from mufe_fenicsx.geometry.segment import segment_image
from mufe_fenicsx.geometry.settings import SegmentSettings
from tests.geometry.scenes import ball, grey_packing


def disc(n, radius):
    """A circle in the middle of n x n pixels."""
    away = np.arange(n) - (n - 1) / 2
    return np.hypot(away[:, None], away) < radius


def scan(dtype="<u2"):
    """Balls far brighter than zero, as of a 16-bit scan."""
    return (grey_packing() * 20.0 + 30000).astype(dtype)


TILTED = np.abs(np.add.outer(np.add.outer(np.arange(36) * 0.3, np.arange(36)), np.arange(36) * 0.6)
                - 34) < 26  # fmt: skip


@pytest.mark.parametrize("value", [0, 65535, 32001])
@pytest.mark.parametrize(
    "inside",
    [np.broadcast_to(disc(36, 17.5), (36, 36, 36)), TILTED, ball((36,) * 3, (18,) * 3, 17.8)],
    ids=["cylinder", "tilted", "ball"],
)
def test_constant_padding_is_recognised(inside, value):
    image = np.where(inside, scan(), np.uint16(value))
    found, line = field_of_view(image)
    assert np.array_equal(found, inside)
    assert line == f"{1 - inside.mean():.1%} of the voxels left out: constant at {value}"


@pytest.mark.parametrize("level", [33000, 36000])
def test_a_mould_is_within_the_field_of_view(level):
    image, inside = scan(), disc(36, 17.5)
    image[:, ~disc(36, 15.5)] = level
    image[:, ~inside] = 0
    assert np.array_equal(field_of_view(image)[0][0], inside)


def test_padding_may_be_no_number():
    image, inside = scan("f4"), disc(36, 17.5)
    image[:, ~inside] = np.nan
    assert np.array_equal(field_of_view(image)[0][3], inside)
    image[5, 18, 18] = np.nan
    with pytest.raises(InputError, match=r"1 voxels that are NaN in its field .* \(5, 18, 18\)"):
        field_of_view(image)


def blurred_ball():
    sharp = ball((36,) * 3, (18,) * 3, 15) * 200.0
    return scipy.ndimage.gaussian_filter(sharp, 1.0)


def one_phase():
    return np.random.default_rng(1).normal(210, 6, (36, 36, 36)).astype(np.uint8)


@pytest.mark.parametrize(
    "image",
    [
        scan(),
        grey_packing() > 120,
        (grey_packing() > 120) * np.uint8(255),
        np.where(grey_packing() < 90, 0, grey_packing()),
        np.where(blurred_ball() < 5, 0, blurred_ball()).astype(np.uint8),
        np.where(ball((36,) * 3, (18,) * 3, 15), one_phase(), 0),
        ball((36,) * 3, (18,) * 3, 15) * np.uint8(200),
        np.random.default_rng(0).integers(0, 3, (20, 20, 20)),
    ],
    ids=["none", "bool", "binary", "clipped", "ball", "bright ball", "solid ball", "noise"],
)
def test_voids_that_are_constant_are_no_padding(image):
    assert padding(image) == (None, None)


def test_padding_changes_nothing_inside():
    """Threshold, labels and void fraction are those of the same image without its surroundings."""
    settings = SegmentSettings(voxel_size=1e-5)
    inside = np.broadcast_to(disc(36, 17.5), (36, 36, 36))
    image, labels = scan(), []
    for value in (0, 65535):
        grown = np.pad(np.where(inside, image, np.uint16(value)), 2, constant_values=value)
        found, _ = field_of_view(grown)
        parts, grey, done = segment(grown, settings, found)
        labels.append(parts)
        assert parts.shape == grey.shape == grown.shape and not parts[~found].any()
        # The filter sees the nearest voxel inside in place of what lies outside, where the whole
        # image has its own: threshold and share may differ by as much as the rim is of the disc.
        level = find_threshold(image[inside], "middle")
        assert done["threshold"] == pytest.approx(level, rel=2e-3)
        share = (image[inside] > level).mean()
        assert done["solid_fraction"] == pytest.approx(share, abs=0.02)
        assert parts.max() == 8
    assert np.array_equal(*labels)


def test_the_nearest_voxel_inside_stands_for_what_is_outside():
    image = np.arange(3 * 4 * 5).reshape(3, 4, 5)
    inside = np.zeros(image.shape, dtype=bool)
    inside[1, 1:3, 1:4] = True
    full = filled(image, inside)
    assert np.array_equal(full[1], image[1][np.ix_([1, 1, 2, 2], [1, 1, 2, 3, 3])])
    assert np.array_equal(full[0], full[1]) and np.array_equal(full[2], full[1])


def test_a_mask_is_a_cylinder_a_level_or_a_file(tmp_path):
    image = scan()
    inside, line = field_of_view(image, "cylinder")
    assert np.array_equal(inside[0], disc(36, 18 + 1e-9)) and "upright cylinder" in line
    image[:, :, :3] = 7
    inside, _ = field_of_view(image, 7.0)
    assert np.array_equal(inside, np.indices(image.shape)[2] >= 3)
    mask = np.zeros((36, 36, 36), np.uint8)
    mask[4:30, 3:33, 5:31] = 255
    tifffile.imwrite(tmp_path / "mask.tif", mask)
    assert np.array_equal(field_of_view(image, tmp_path / "mask.tif")[0], mask > 0)
    crop = ((0, 10), (0, 36), (2, 36))
    part = image[tuple(slice(*ends) for ends in crop)]
    assert np.array_equal(
        field_of_view(part, tmp_path / "mask.tif", crop=crop)[0], mask[:10, :, 2:] > 0
    )
    assert field_of_view(image, "none") == (None, None)
    with pytest.raises(InputError, match=r"shape \(36, 36, 36\), expected \(10, 36, 34\)"):
        field_of_view(part, tmp_path / "mask.tif")
    with pytest.raises(InputError, match=r"mask = 3: 46656 of 46656 voxels .* are inside"):
        field_of_view(image, 3)


@pytest.mark.parametrize("crop", [None, ((40, 50), (0, 200), (0, 200))])
def test_a_real_cylinder_is_recognised(shared_data, crop):
    """Sand in its container, zeros around its field of view: a disc of radius 256 voxels."""
    name = shared_data("sand_xct_grey_cylinder_100x512x512.tif")
    image = read_image(name, crop=crop or ((40, 50), (0, 512), (0, 512)))
    found, line = field_of_view(image)
    cut = slice(0, image.shape[1])
    assert np.array_equal(found[0], disc(512, 256.003)[cut, cut]) and "constant at 0" in line
    # Peaks near 35 590 and 36 690, and darker towards the rim; all of it had given 18 368.
    assert 35800 < find_threshold(image[found], "middle") < 36300


def test_real_voids_are_no_padding(shared_data):
    assert padding(read_image(shared_data("snow_xct_grey_100.tif")))[1] is None
    rock = np.load(shared_data("tsquare_rock_73x105x115.npz"))["solid"]
    assert padding(rock)[1] is None


def test_grains_at_the_rim_are_cut_and_the_image_is_held_against_the_truth(tmp_path):
    truth, inside = np.zeros((36, 36, 36), np.int64), disc(36, 17.5)
    for k, at in enumerate(np.ndindex(2, 2, 2)):
        truth[ball(truth.shape, 10 + 16 * np.array(at), 8.5)] = (k + 1) * 10**9
    np.savez(tmp_path / "truth.npz", labels=truth * inside)
    np.save(tmp_path / "a.npy", 60000 - np.where(inside, scan(), np.uint16(0)))
    settings = SegmentSettings(voxel_size=1e-5, invert=True)
    done = segment_image(
        tmp_path / "a.npy", settings, tmp_path / "labels.tif", truth=tmp_path / "truth.npz"
    )
    assert done["num_grains"] == done["num_border_grains"] == 8
    assert "constant at 60000" in done["notices"][0]
    found = done["compared"]
    assert (found["num_true"], found["num_matched"], found["false_grains"]) == (8, 8, 0)
    assert abs(found["mean_diameter_error"]) < 0.02  # a tenth of a voxel of radius
    part = SegmentSettings(voxel_size=1e-5, invert=True, crop=((0, 20), (0, 36), (0, 36)))
    done = segment_image(
        tmp_path / "a.npy", part, tmp_path / "part.tif", truth=tmp_path / "truth.npz"
    )
    # Of the upper balls two slices are left.
    assert (done["compared"]["num_true"], done["compared"]["num_matched"]) == (4, 4)
    np.save(tmp_path / "small.npy", truth[:30])
    with pytest.raises(InputError, match=r"shape \(30, 36, 36\), expected \(36, 36, 36\)"):
        segment_image(
            tmp_path / "a.npy", settings, tmp_path / "b.tif", truth=tmp_path / "small.npy"
        )
    assert not (tmp_path / "b.tif").exists()
