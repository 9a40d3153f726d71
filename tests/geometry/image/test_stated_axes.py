"""What files say of their axes and lengths is heeded, or named in a line."""

import json
import re

import h5py
import numpy as np
import pytest
import SimpleITK
import tifffile

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image.image_files import read_image, read_with_size
from mufe_fenicsx.geometry.image.voxel_size import known_voxel_size, metres
from tests.geometry.image.test_image_door import meta, nrrd
from tests.geometry.image_samples import IMAGE

TURNED = IMAGE.transpose(2, 1, 0)


def tags_of_vigra(path):
    with h5py.File(path, "w") as file:
        grey = file.create_dataset("grey", data=TURNED[..., None])
        axes = [{"key": key, "resolution": 0} for key in "xyzc"]
        grey.attrs["axistags"] = json.dumps({"axes": axes})


def labels_of_dimensions(path):
    with h5py.File(path, "w") as file:
        grey = file.create_dataset("grey", data=TURNED)
        for dimension, label in zip(grey.dims, "xyz", strict=True):
            dimension.label = label


def emd(path):
    """As tomviz writes it; NeXus has names of the same in an attribute."""
    with h5py.File(path, "w") as file:
        group = file.create_group("data/tomography")
        group["data"] = TURNED
        for k, name in enumerate("xyz"):
            scale = group.create_dataset(f"dim{k + 1}", data=np.arange(TURNED.shape[k]) * 5.0)
            scale.attrs.update(name=name, units="[n_m]")


def nexus(path):
    with h5py.File(path, "w") as file:
        group = file.create_group("entry")
        group["data"] = TURNED
        group.attrs["axes"] = list("xyz")
        for k, name in enumerate("xyz"):
            scale = group.create_dataset(name, data=2.0 * np.arange(TURNED.shape[k]))
            scale.attrs["units"] = "um"


def itk(path):
    """Voxels whose fastest axis runs along z."""
    image = SimpleITK.GetImageFromArray(TURNED)
    image.SetDirection((0, 0, 1, 0, 1, 0, 1, 0, 0))
    SimpleITK.WriteImage(image, str(path))


def shaped(path):
    tifffile.imwrite(path, TURNED, metadata={"axes": "XYZ"}, photometric="minisblack")


def nrrd_labels(path):
    head = "NRRD0004\ntype: uint16\ndimension: 3\nsizes: 6 5 7\nendian: little\nencoding: raw\n"
    path.write_bytes((head + 'labels: "z" "y" "x"\n\n').encode() + TURNED.tobytes())


def letters_of_sides(path):
    head = "NDims = 3\nDimSize = 6 5 7\nElementType = MET_USHORT\nAnatomicalOrientation = IPR\n"
    path.write_bytes((head + "ElementDataFile = LOCAL\n").encode() + TURNED.tobytes())


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.h5", tags_of_vigra), ("b.h5", labels_of_dimensions), ("c.h5", emd),
        ("a.nxs", nexus), ("a.nrrd", itk), ("a.mha", itk),
        ("a.nii.gz", itk), ("a.tif", shaped), ("b.nrrd", nrrd_labels), ("b.mha", letters_of_sides),
    ],
)  # fmt: skip
def test_axes_are_in_the_order_that_the_file_states(tmp_path, name, write):
    """They had been z, y, x whatever stood there: platens pressed along another axis."""
    path, notices = tmp_path / name, []
    write(path)
    assert np.array_equal(read_with_size(path, notices=notices)[0], IMAGE)
    assert f'{path} states axes in the order "xyz": taken as "xyz"' in notices[0]
    notices = []
    found, _ = read_with_size(path, axes="zyx", notices=notices)
    assert np.array_equal(found, TURNED)
    assert notices[0].endswith('taken as "zyx"')
    size = {emd: (5e-9,) * 3, nexus: (2e-6,) * 3}.get(write)
    if size:
        assert read_with_size(path)[1] == pytest.approx(size)
    part = read_image(path, crop=((0, 2), (0, 5), (1, 7)))
    assert np.array_equal(part, IMAGE[:2, :, 1:])


@pytest.mark.parametrize(
    ("make", "lines", "said"),
    [
        (
            nrrd,
            ("space dimension: 3", "space directions: (5,0,0) (0,6,0) (0,0,-7)"),
            "backwards along z: t",
        ),
        (nrrd, ("space dimension: 3", "space directions: (-5,0,0) (0,-6,0) (0,0,7)"), None),
        (nrrd, ("space dimension: 3", "space directions: (4,3,0) (-3,4,0) (0,0,5)"), "axes run"),
        (meta, ("TransformMatrix = 1 0 0 0 -1 0 0 0 1",), "backwards along y: taken as stored"),
        (meta, ("AnatomicalOrientation = RAI",), None),
    ],
)
def test_directions_that_are_not_followed_are_named(tmp_path, make, lines, said):
    notices = []
    found, _ = read_with_size(make(tmp_path, *lines), notices=notices)
    assert np.array_equal(found, IMAGE)
    assert [said in line for line in notices] == [True] if said else not notices


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (nrrd, "space dimension: 3\nspace directions: (5,0,0) (3,6,0) (0,0,7)"),
        (meta, "TransformMatrix = 1 0 0 0.5 1 0 0 0 1"),
    ],
)
def test_voxels_that_are_sheared_are_no_bricks(tmp_path, make, line):
    with pytest.raises(InputError, match="axes that are not at right angles to each other"):
        read_image(make(tmp_path, line))


def test_slices_of_times_or_channels_are_named(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", IMAGE, imagej=True, metadata={"axes": "TYX"})
    notices = []
    read_with_size(tmp_path / "a.tif", notices=notices)
    assert notices == [f"{tmp_path / 'a.tif'} states an axis of times: taken as z"]


def imagej(**meta):
    return {"imagej": True, "resolution": (0.2, 0.1), "metadata": {"axes": "ZYX", **meta}}


def ome(unit, **more):
    sizes = {f"PhysicalSize{axis}": n for axis, n in zip("XYZ", (5, 10, 7), strict=True)}
    units = {f"PhysicalSize{axis}Unit": unit for axis in "XYZ"}
    return {"ome": True, "metadata": {"axes": "ZYX", **sizes, **units, **more}}


@pytest.mark.parametrize(
    ("how", "size"),
    [
        (imagej(unit="mm", zunit="um", spacing=7), (7e-6, 1e-2, 5e-3)),
        (imagej(unit="um", yunit="mm", zunit="nm", spacing=7), (7e-9, 1e-2, 5e-6)),
        (imagej(unit="inch", spacing=-7), (7 * 0.0254, 10 * 0.0254, 5 * 0.0254)),
        (imagej(unit="um"), "nothing along z, 10 um along y, 5 um along x"),
        (imagej(unit="um", zunit="pixel", spacing=7),
         "7 pixel along z, 10 um along y, 5 um along x"),
        (imagej(spacing=7), None),
        (ome("dm"), (0.7, 1.0, 0.5)),
        (ome("in"), (7 * 0.0254, 10 * 0.0254, 5 * 0.0254)),
        (ome("Å"), (7e-10, 1e-9, 5e-10)),
        (ome("µm", PhysicalSizeZUnit="mm"), (7e-3, 1e-5, 5e-6)),
        (ome("reference frame"), "7 reference frame along z, 10 reference frame along y, "
                                 "5 reference frame along x"),
        ({"resolution": (5000, 2500), "resolutionunit": "CENTIMETER"},
         "nothing along z, 0.0004 cm along y, 0.0002 cm along x"),
        ({"resolution": (96, 96), "resolutionunit": "INCH"}, None),
    ],
)  # fmt: skip
def test_lengths_are_stated_axis_by_axis(tmp_path, how, size):
    """ImageJ's unit of z had been that of x: 90 µm were 90 319 µm long."""
    path = tmp_path / ("a.ome.tif" if "ome" in how else "a.tif")
    tifffile.imwrite(path, IMAGE, **how)
    _, stated = read_with_size(path)
    if not isinstance(size, tuple):
        assert stated == size
        with pytest.raises(InputError, match=f"is {'not stated' if size is None else 'stated as'}"):
            known_voxel_size(None, stated, path)
    else:
        assert stated == pytest.approx(size, rel=1e-6)


def test_letters_of_units():
    same = ("um", "µm", "μm", "&#181;m", "&#xB5;m", "\\u00B5m", "micron", "Micrometers")
    assert {metres(unit) for unit in same} == {1e-6}
    assert (metres("Mm"), metres("pixel"), metres("")) == (None, None, None)


def test_hidden_files_are_no_slices_and_errors_name_the_slice(tmp_path):
    for k, part in enumerate(IMAGE):
        tifffile.imwrite(tmp_path / f"s{k}.tif", part, resolution=(2000, 2000), resolutionunit=3)
        (tmp_path / f"._s{k}.tif").write_bytes(b"\0\5\x16\7" + bytes(80))
    found, size = read_with_size(tmp_path)
    assert np.array_equal(found, IMAGE) and "0.0005 cm along y" in size
    (tmp_path / "s3.tif").write_bytes(b"no TIFF")
    with pytest.raises(InputError, match=r"s3\.tif cannot be read: not a TIFF file"):
        read_image(tmp_path)


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ([f"rec_{k:04d}.tif" for k in (1, 2, 3, 5, 6, 9)], "2 gaps in the numbers .* 3 and 5"),
        (
            [*(f"{k}.tif" for k in range(5)), "rec_spr.tif"],
            "1 of 6 slices have other names .* rec_",
        ),
        ([f"a{k}b7.tif" for k in range(0, 12, 2)], None),
    ],
)
def test_names_of_slices_that_do_not_fit_are_told(tmp_path, names, said):
    for name, part in zip(names, IMAGE, strict=True):
        tifffile.imwrite(tmp_path / name, part)
    notices = []
    assert len(read_with_size(tmp_path, notices=notices)[0]) == 6
    assert [bool(re.search(said, line)) for line in notices] == [True] if said else not notices
