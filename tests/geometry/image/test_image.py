"""Images come in as they were written, and what is no image is refused in one line."""

import numpy as np
import pytest
import tifffile

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image.image import resample, smooth, to_cubes
from mufe_fenicsx.geometry.image.image_files import check_crop, read_image


@pytest.fixture
def volume():
    return np.random.default_rng(0).integers(0, 60000, (12, 5, 7)).astype(np.uint16)


def test_every_format_gives_the_same_voxels(tmp_path, volume):
    tifffile.imwrite(tmp_path / "stack.tif", volume)
    np.save(tmp_path / "image.npy", volume)
    np.savez(tmp_path / "one.npz", grey=volume, size=np.array([1.0]))
    np.savez(tmp_path / "two.npz", grey=volume, other=volume + 1)
    volume.astype(">u2").tofile(tmp_path / "image.raw")
    folder = tmp_path / "slices"
    folder.mkdir()
    # Without leading zeros slice10 would come before slice2.
    for k, part in enumerate(volume):
        tifffile.imwrite(folder / f"slice{k}.tif", part)

    assert np.array_equal(read_image(tmp_path / "stack.tif"), volume)
    assert np.array_equal(read_image(tmp_path / "image.npy"), volume)
    assert np.array_equal(read_image(tmp_path / "one.npz"), volume)
    assert np.array_equal(read_image(tmp_path / "two.npz", key="grey"), volume)
    raw = read_image(tmp_path / "image.raw", shape=(12, 5, 7), dtype=">u2")
    assert np.array_equal(raw, volume)
    assert np.array_equal(read_image(folder), volume)


class Harmful:
    """An object that would make a file if it were unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (str(self.path), "w"))


def test_pickled_objects_are_never_loaded(tmp_path):
    np.savez(tmp_path / "bad.npz", labels=np.array([Harmful(tmp_path / "made")], dtype=object))
    with pytest.raises(InputError, match="Object arrays cannot be loaded"):
        read_image(tmp_path / "bad.npz", key="labels")
    with pytest.raises(InputError, match="Object arrays cannot be loaded"):
        read_image(tmp_path / "bad.npz")
    assert not (tmp_path / "made").exists()


def bad_images(folder):
    """Pairs of a call and what its message has to say."""
    good = np.arange(60, dtype=float).reshape(3, 4, 5)
    np.save(folder / "flat.npy", good[0])
    with_nan = good.copy()
    with_nan[2, 1, 3] = np.nan
    np.save(folder / "nan.npy", with_nan)
    np.save(folder / "text.npy", np.full((2, 2, 2), "x"))
    (folder / "broken.tif").write_bytes(b"II*\0 this is no TIFF")
    (folder / "broken.npz").write_bytes(b"PK nothing")
    (folder / "empty.npy").write_bytes(b"")
    (folder / "image.jpg").write_bytes(b"")
    good.tofile(folder / "image.raw")
    np.savez(folder / "two.npz", a=good, b=good)
    (folder / "none").mkdir()
    (folder / "mixed").mkdir()
    tifffile.imwrite(folder / "mixed" / "0.tif", good[0])
    tifffile.imwrite(folder / "mixed" / "1.tif", good[0, :2])
    return [
        (("missing.tif", {}), "no image .*missing.tif"),
        (("flat.npy", {}), r"2 axes, shape \(4, 5\)"),
        (("nan.npy", {}), r"1 voxels that are NaN.*\(2, 1, 3\)"),
        (("text.npy", {}), "type <U1"),
        (("broken.tif", {}), "broken.tif holds no page"),
        (("broken.npz", {}), "broken.npz cannot be read"),
        (("empty.npy", {}), "empty.npy cannot be read"),
        (("image.jpg", {}), "ends in '.jpg'"),
        (("image.raw", {}), "shape = None, dtype = None"),
        (("image.raw", {"shape": (3, 4, 5), "dtype": "<u2"}), "480 bytes, expected 120"),
        (("image.raw", {"shape": (3, 4, 5), "dtype": "colour"}), "dtype = 'colour'"),
        (("two.npz", {}), r"2 arrays with three axes \(a, b\)"),
        (("two.npz", {"key": "c"}), "no array 'c'.*a, b"),
        (("none", {}), "holds no .tif"),
        (("mixed", {}), r"1.tif has shape \(2, 5\)"),
    ]


@pytest.mark.parametrize("number", range(15))
def test_bad_images_are_refused_in_one_line(tmp_path, number):
    (name, options), message = bad_images(tmp_path)[number]
    with pytest.raises(InputError, match=message) as caught:
        read_image(tmp_path / name, **options)
    assert "\n" not in str(caught.value)


def test_crop_outside_the_image_is_refused(volume):
    with pytest.raises(InputError, match="crop along y = 2 to 9, expected a range within 0 to 5"):
        check_crop(((0, 5), (2, 9), (0, 7)), volume.shape)


def test_resampling_keeps_the_domain():
    """A linear ramp on voxel centres stays the same ramp on finer centres."""
    ramp = np.broadcast_to(np.arange(12) + 0.5, (6, 6, 12))
    fine = resample(ramp, 2)
    assert fine.shape == (12, 12, 24)
    # Away from the ends, where splines know nothing beyond, single precision remains.
    assert np.allclose(fine[6, 6, 8:-8], (np.arange(24) + 0.5)[8:-8] / 2, atol=2e-3)


def test_flat_voxels_become_cubes():
    """A ramp along z on voxels twice as high becomes the same ramp on cubes."""
    ramp = np.broadcast_to((np.arange(10) + 0.5)[:, None, None] * 2, (10, 6, 6))
    cubes, edge = to_cubes(ramp, (2e-6, 1e-6, 1e-6))
    assert cubes.shape == (20, 6, 6) and edge == 1e-6
    assert np.allclose(cubes[6:-6, 3, 3], (np.arange(20) + 0.5)[6:-6], atol=2e-2)
    labels, _ = to_cubes(np.arange(2).reshape(1, 2, 1), (3.0, 3.0, 1.0), labels=True)
    assert labels.shape == (3, 6, 1) and labels[:, :3].max() == 0 and labels[:, 3:].min() == 1


def test_filters_keep_a_constant_and_remove_a_speck():
    image = np.full((9, 9, 9), 7.0)
    image[4, 4, 4] = 1000.0
    assert np.all(smooth(image, "median", 1.5) == 7.0)
    assert smooth(image, "gaussian", 1.0).mean() == pytest.approx(image.mean(), rel=1e-3)
    assert np.array_equal(smooth(image, "none"), image)
