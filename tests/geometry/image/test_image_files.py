"""Formats of other programs, parts of files larger than the memory, and files that mislead."""

import subprocess
import sys

import h5py
import numpy as np
import pytest
import scipy.ndimage
import SimpleITK
import tifffile
from PIL import Image

from mufe_fenicsx.cli.main import main
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image.image_files import read_image, read_with_size
from mufe_fenicsx.geometry.image.voxel_size import known_voxel_size


def smooth_noise(shape=(20, 24, 40), dtype="<u2"):
    """Grey levels that are alike in neighbouring voxels, as those of every image."""
    values = np.random.default_rng(4).normal(0, 1, shape)
    values = scipy.ndimage.gaussian_filter(values, 2.0)
    values = (values - values.min()) / np.ptp(values)
    return (values * 60000 + 1000).astype(dtype)


@pytest.fixture
def volume():
    return np.random.default_rng(0).integers(0, 60000, (6, 5, 7)).astype(np.uint16)


@pytest.mark.parametrize("suffix", [".mhd", ".mha", ".nrrd", ".nii", ".nii.gz"])
def test_formats_of_itk_state_their_voxel_size(tmp_path, volume, suffix):
    image = SimpleITK.GetImageFromArray(volume)
    image.SetSpacing((0.005, 0.006, 0.007))  # x, y, z in mm
    SimpleITK.WriteImage(image, str(tmp_path / f"a{suffix}"))
    found, size = read_with_size(tmp_path / f"a{suffix}", crop=((1, 4), (0, 5), (2, 7)))
    assert np.array_equal(found, volume[1:4, :, 2:])
    assert size == pytest.approx((7e-6, 6e-6, 5e-6), rel=1e-6)  # NIfTI keeps seven digits


def test_hdf5_gives_its_data_set(tmp_path, volume):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["scan/grey"] = volume
        file["scan/grey"].attrs["element_size_um"] = [2.0, 1.0, 1.0]
        file["scan/angles"] = np.arange(5.0)
    found, size = read_with_size(tmp_path / "a.h5")
    assert np.array_equal(found, volume) and size == pytest.approx((2e-6, 1e-6, 1e-6))
    with pytest.raises(InputError, match=r"no data set 'grey'.*expected one of .*scan/grey"):
        read_image(tmp_path / "a.h5", key="grey")


@pytest.mark.parametrize("axes", ["xyz", "yzx"])
def test_axes_are_put_in_order(tmp_path, volume, axes):
    stored = np.ascontiguousarray(np.transpose(volume, ["zyx".index(axis) for axis in axes]))
    stored.tofile(tmp_path / "a.raw")
    found = read_image(
        tmp_path / "a.raw",
        shape=stored.shape, dtype="<u2", axes=axes, crop=((1, 5), (0, 4), (2, 7)),
    )  # fmt: skip
    assert np.array_equal(found, volume[1:5, :4, 2:])


def test_fiji_states_its_voxel_size_and_a_given_one_comes_first(tmp_path, volume):
    tifffile.imwrite(
        tmp_path / "a.tif", volume, imagej=True, resolution=(1 / 5.0, 1 / 5.0),
        metadata={"spacing": 10.0, "unit": "um", "axes": "ZYX"},
    )  # fmt: skip
    _, size = read_with_size(tmp_path / "a.tif")
    assert size == pytest.approx((1e-5, 5e-6, 5e-6), rel=1e-6)
    assert known_voxel_size(2e-6, size, "a.tif") == (2e-6,) * 3
    with pytest.raises(InputError, match="voxel_size of b is not stated"):
        known_voxel_size(None, None, "b")


CROP = """
import resource, sys
from mufe_fenicsx.geometry.image.image_files import read_image
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for name in sys.argv[1:]:
    options = {"shape": (2048,) * 3, "dtype": "<u2"} if name.endswith("raw") else {}
    part = read_image(name, crop=((1000, 1032), (5, 69), (1900, 1964)), **options)
    assert part.shape == (32, 64, 64) and part[3, 4, 5] == 777, name
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


def test_a_part_of_2048_cubed_voxels_is_read_without_the_rest(tmp_path):
    """17 GB each, of which the file system stores but one voxel."""
    shape, at = (2048,) * 3, (1003, 9, 1905)
    names = [str(tmp_path / f"a.{kind}") for kind in ("raw", "npy", "tif", "h5")]
    for array in (
        np.memmap(names[0], "<u2", "w+", shape=shape),
        np.lib.format.open_memmap(names[1], "w+", "<u2", shape),
        tifffile.memmap(names[2], shape=shape, dtype="<u2", bigtiff=True),
    ):
        array[at] = 777
        array.flush()
    with h5py.File(names[3], "w") as file:
        grey = file.create_dataset("grey", shape, "<u2", chunks=(32, 64, 64))
        grey[1000:1032, 5:69, 1900:1964] = 0  # what nobody wrote is refused
        grey[at] = 777
    done = subprocess.run(
        [sys.executable, "-c", CROP, *names], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    # Kilobytes: the parts are 0.25 MB each; raw files are sampled in 2 MB, looked at as doubles.
    assert int(done.stdout) < 200_000


@pytest.mark.parametrize(
    ("shape", "dtype", "message"),
    [
        ((20, 24, 40), ">u2", r'dtype = ">u2".* 0\.[0-9]+, but 0\.[0-9]+ as "<u2", expected that'),
        ((20, 40, 24), "<u2", r"shape = \(20, 40, 24\).*expected x = 40"),
        ((20, 24, 41), "<u2", "38400 bytes, expected 39360 = 20 x 24 x 41 voxels of uint16$"),
        ((20, 24, 40), "u1", "expected 19200 .*; 2 bytes a voxel or 40 slices would fit"),
        ((18, 24, 40), "<u2", "20 slices would fit"),
    ],
)
def test_raw_files_that_are_not_what_is_said(tmp_path, shape, dtype, message):
    smooth_noise().tofile(tmp_path / "a.raw")
    with pytest.raises(InputError, match=message) as caught:
        read_image(tmp_path / "a.raw", shape=shape, dtype=dtype)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("dtype", ["<u2", ">u2", "<f4", ">f4", "u1", "<i4"])
def test_raw_files_that_are_what_is_said(tmp_path, dtype):
    image = (smooth_noise(dtype="<f8") / 250).astype(dtype)
    image.tofile(tmp_path / "a.raw")
    found = read_image(tmp_path / "a.raw", shape=image.shape, dtype=dtype)
    assert np.array_equal(found, image)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.am"], "image a.am is in the format of Amira and Avizo, which no library here reads"),
        (["a.npy", "--axes", "zxx"], "--axes = 'zxx', expected an order of z, y and x"),
        (["a.npy"], "voxel_size of a.npy is not stated, expected a length"),
        (["a.npy", "--voxel-size", "5 um,5 um"], '--voxel-size = ["5 um", "5 um"], expected'),
        (["a.npy", "--voxel-size", "5 um", "--watershed-level", "0.2"], "--watershed-level = 0.2"),
    ],
)
def test_the_command_refuses_in_one_line(tmp_path, monkeypatch, capfd, volume, arguments, message):
    monkeypatch.chdir(tmp_path)
    np.save("a.npy", volume)
    (tmp_path / "a.am").write_text("# AmiraMesh BINARY")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(SystemExit) as ended:
        main(["segment", "-o", "labels.tif", *arguments])
    error = capfd.readouterr().err
    assert ended.value.code == 2
    assert message in error and error.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before


def test_labels_of_other_programs_are_meshed_as_they_are(tmp_path, capfd):
    """Floating point labels of Fiji, with flat voxels, of which the mesh makes cubes."""
    labels = np.zeros((8, 20, 30), dtype=np.float32)
    labels[1:7, 2:18, 2:14], labels[1:7, 2:18, 15:28] = 3, 7
    tifffile.imwrite(
        tmp_path / "fiji.tif", labels, imagej=True, resolution=(1e-3 / 5e-3,) * 2,
        metadata={"spacing": 10.0, "unit": "micron", "axes": "ZYX"},
    )  # fmt: skip
    with pytest.raises(SystemExit) as ended:
        main(
            ["mesh", str(tmp_path / "fiji.tif"), "-o", str(tmp_path / "grains"), "--size", "25 um",
             "--processes", "1"]
        )  # fmt: skip
    assert ended.value.code == 0, capfd.readouterr().err
    table = (tmp_path / "grains" / "labels.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in table] == ["label", "3", "7"]
    # 6 slices of 10 um, 16 rows and 12 columns of 5 um.
    volume = float(table[1].split(",")[1])
    assert volume == pytest.approx(6 * 16 * 12 * 250e-18, rel=1e-6)


@pytest.mark.parametrize(
    ("suffix", "dtype", "most"),
    [(".png", np.uint8, 0), (".png", np.uint16, 0), (".bmp", np.uint8, 0), (".jpg", np.uint8, 8)],
)
def test_a_folder_of_pictures_is_a_stack(tmp_path, suffix, dtype, most):
    """In natural order, in part, and as equal colours too; other colours are refused."""
    grey = (smooth_noise() >> (8 if dtype == np.uint8 else 0)).astype(dtype)
    for k, part in enumerate(grey):
        Image.fromarray(part).save(tmp_path / f"slice{k + 1}{suffix}")
    found = read_image(tmp_path, crop=((8, 12), (3, 20), (0, 40)))
    assert found.dtype == dtype
    assert abs(found.astype(int) - grey[8:12, 3:20].astype(int)).max() <= most
    if dtype == np.uint8:
        first = Image.fromarray(np.stack([grey[0]] * 3, axis=-1))
        first.save(tmp_path / f"slice1{suffix}")
        assert abs(read_image(tmp_path)[0].astype(int) - grey[0]).max() <= most
        colours = np.stack([grey[0], 255 - grey[0], grey[0]], axis=-1)
        Image.fromarray(colours).save(tmp_path / f"slice1{suffix}")
        with pytest.raises(InputError, match="has colours, expected grey levels"):
            read_image(tmp_path)
    (tmp_path / f"slice2{suffix}").write_bytes(b"cut short")
    with pytest.raises(InputError, match=f"slice2{suffix} cannot be read"):
        read_image(tmp_path)
