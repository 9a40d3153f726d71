"""Whatever a file of an image holds: its voxels, or one line that refuses it."""

import os
import random
import signal
import zipfile
from contextlib import contextmanager

import h5py
import numpy as np
import pytest
import SimpleITK
import tifffile

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image.image_files import read_image, read_with_size
from mufe_fenicsx.machine import memory
from tests.geometry.image_samples import IMAGE, write_samples

#: Longest that one file may take [s].
LIMIT = 20


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    return write_samples(tmp_path_factory.mktemp("images"))


class Hang(BaseException):
    """Of a kind that no reader takes for damage."""


@contextmanager
def in_time(limit=LIMIT):
    """Raise Hang where the block does."""

    def ring(*args):
        raise Hang

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(limit)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def refusal(path, **options):
    """The one line by which an image is refused, or None."""
    with in_time():
        try:
            read_image(path, **options)
        except InputError as error:
            assert "\n" not in str(error)
            return str(error)
    return None


def test_every_format_gives_the_same_voxels(samples):
    for path, options in samples:
        found = read_image(path, **options)
        assert found.dtype == IMAGE.dtype and np.array_equal(found, IMAGE), path.name


def test_a_file_cut_short_gives_all_voxels_or_none(samples, capfd):
    """Bytes are held against the header by every reader; NIfTI had been filled up with zeros."""
    for path, options in samples:
        data = path.read_bytes()
        for part in (0, 0.3, 0.6, 0.9, 0.99):
            path.write_bytes(data[: int(part * len(data))])
            if refusal(path, **options) is None:
                # What ended was the metadata that some TIFFs have behind their voxels.
                assert np.array_equal(read_image(path, **options), IMAGE), (path.name, part)
        path.write_bytes(data)
    assert capfd.readouterr().err == ""


def damaged(data, rng):
    """A copy with some bytes changed, taken out or put in, more of them in headers."""
    data = bytearray(data)
    reach = len(data) if rng.random() < 0.4 else min(len(data), 600)
    for _ in range(rng.choice((1, 1, 2, 8))):
        how, at = rng.random(), rng.randrange(reach)
        if how < 0.4:
            data[at] ^= 1 << rng.randrange(8)
        elif how < 0.7:
            data[at] = rng.choice((0, 255, 127, 128, 32, 48, 57, 45))
        elif how < 0.8:
            data[at : at + 4] = rng.choice((b"\xff" * 4, b"\0" * 4, b"\xff\xff\xff\x7f"))
        elif how < 0.9:
            del data[at : at + rng.randrange(1, 9)]
            reach = max(1, min(reach, len(data)))
        else:
            data[at:at] = rng.randbytes(rng.randrange(1, 9))
    return bytes(data)


def damage_all(samples, rng, count):
    """How many of so many damaged files are refused."""
    refused = 0
    for k in range(count):
        path, options = samples[k % len(samples)]
        data = path.read_bytes()
        path.write_bytes(damaged(data, rng))
        refused += refusal(path, **options) is not None
        path.write_bytes(data)
    return refused


def test_damaged_files_are_read_or_refused_in_one_line(samples, capfd):
    # Bytes of voxels may change without a trace, those of headers hardly.
    assert damage_all(samples, random.Random(1), 150) > 50
    assert capfd.readouterr().err == ""


@pytest.mark.slow
def test_many_damaged_files(samples, capfd):
    assert damage_all(samples, random.Random(41), 3000) > 1000
    assert capfd.readouterr().err == ""


def zip_bomb(path):
    """Six terabytes of zeros in the header of an array, a kilobyte in the file."""
    header = b"{'descr': '<u2', 'fortran_order': False, 'shape': (20000, 12000, 12000)}"
    text = header + b" " * (117 - len(header)) + b"\n"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("grey.npy", b"\x93NUMPY\x01\x00" + b"\x76\x00" + text + bytes(1000))


def absurd_tiff(path):
    """Pages of 2^31 x 2^31 voxels, compressed to nothing."""
    tifffile.imwrite(path, IMAGE, compression="zlib", metadata=None)
    with tifffile.TiffFile(path, mode="r+b") as file:
        for page in file.pages:
            page.tags["ImageWidth"].overwrite(2**31 - 1, erase=False)
            page.tags["ImageLength"].overwrite(2**31 - 1, erase=False)
            page.tags["RowsPerStrip"].overwrite(2**31 - 1, erase=False)


def sparse_hdf5(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("grey", (20000, 20000, 20000), "<u2", chunks=(16, 64, 64))


def nifti_of_terabytes(path):
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(IMAGE), str(path))
    data = bytearray(path.read_bytes())
    data[42:48] = np.array([30000, 30000, 30000], "<i2").tobytes()
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("name", "make", "message"),
    [
        ("a.npz", zip_bomb, "has 1128 bytes, expected 5760000000128"),
        ("a.tif", absurd_tiff, "GB, expected at most the .* GB of memory that are free"),
        ("a.h5", sparse_hdf5, r"takes 1.6e\+04 GB, expected at most .*; crop reads a part"),
        ("a.nii", nifti_of_terabytes, "takes 5.4e[+]04 GB, expected at most"),
    ],
)
def test_sizes_are_known_before_memory_is_taken(tmp_path, name, make, message):
    make(tmp_path / name)
    assert (tmp_path / name).stat().st_size < 100_000
    with pytest.raises(InputError, match=message):
        read_image(tmp_path / name)


def test_an_image_larger_than_the_memory_is_refused(tmp_path, monkeypatch):
    np.save(tmp_path / "a.npy", IMAGE)
    monkeypatch.setattr(memory, "free_memory", lambda: IMAGE.nbytes - 1)
    with pytest.raises(InputError, match=r"6 x 5 x 7 voxels of uint16 takes 4\.2e-07 GB"):
        read_image(tmp_path / "a.npy")
    assert read_image(tmp_path / "a.npy", crop=((0, 5), (0, 5), (0, 7))).shape == (5, 5, 7)


def test_limits_of_the_process_count_as_memory():
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_AS)
    whole = memory.free_memory()
    try:
        resource.setrlimit(resource.RLIMIT_AS, (2**40, before[1]))
        assert memory.free_memory() <= min(whole * 1.1, 2**40)
        with open("/proc/self/statm", encoding="ascii") as file:
            taken = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        resource.setrlimit(resource.RLIMIT_AS, (taken + 2**28, before[1]))
        assert memory.free_memory() <= 2**28
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


KINDS = (".tif", ".npy", ".npz", ".raw", ".h5", ".mha", ".mhd", ".nrrd", ".nhdr", ".nii", ".nii.gz")


@pytest.mark.parametrize("kind", KINDS)
def test_pipes_are_not_waited_for(tmp_path, kind):
    os.mkfifo(tmp_path / f"a{kind}")
    line = refusal(tmp_path / f"a{kind}", shape=(2, 2, 2), dtype="u1")
    assert "is no plain file, expected one" in line


def test_pipes_that_a_file_points_to_are_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.tif")
    assert "is no plain file" in refusal(tmp_path)
    head = "NDims = 3\nDimSize = 7 5 6\nElementType = MET_USHORT\nElementDataFile = pipe.tif\n"
    (tmp_path / "a.mhd").write_text(head)
    assert "is no plain file" in refusal(tmp_path / "a.mhd")
    nrrd = "NRRD0004\ntype: uint16\ndimension: 3\nsizes: 7 5 6\nencoding: raw\nendian: little\n"
    (tmp_path / "a.nhdr").write_text(nrrd + "data file: pipe.tif\n\n")
    assert "is no plain file" in refusal(tmp_path / "a.nhdr")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["link"] = h5py.ExternalLink("pipe.tif", "grey")
        layout = h5py.VirtualLayout((6, 5, 7), "<u2")
        layout[...] = h5py.VirtualSource("pipe.tif", "grey", (6, 5, 7))
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("raw", (6, 5, 7), "<u2", external=[("pipe.tif", 0, 420)])
    for key in ("link", "virtual", "raw"):
        assert "is no plain file" in refusal(tmp_path / "a.h5", key=key)


def test_zeros_that_nobody_wrote_are_no_voxels(tmp_path):
    """HDF5 gives them for chunks, sources and files that are not there."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        chunks = file.create_dataset("chunks", (6, 5, 7), "<u2", chunks=(2, 5, 7))
        chunks[:4] = IMAGE[:4]
        file.create_dataset("late", (6, 5, 7), "<u2")
        layout = h5py.VirtualLayout((6, 5, 7), "<u2")
        layout[...] = h5py.VirtualSource("gone.h5", "grey", (6, 5, 7))
        file.create_virtual_dataset("virtual", layout)
        layout = h5py.VirtualLayout((6, 5, 7), "<u2")
        layout[:4] = h5py.VirtualSource("a.h5", "chunks", (6, 5, 7))[:4]
        file.create_virtual_dataset("unmapped", layout)
    path = tmp_path / "a.h5"
    assert "lacks the chunk at (4, 0, 0)" in refusal(path, key="chunks")
    part = read_image(path, key="chunks", crop=((0, 4), (0, 5), (0, 7)))
    assert np.array_equal(part, IMAGE[:4])
    assert "has 0 bytes, expected 420" in refusal(path, key="late")
    assert "has sources for 140 of 210 voxels" in refusal(path, key="unmapped")
    assert "gone.h5 cannot be read: No such file" in refusal(path, key="virtual")


def test_a_tiff_of_several_series(tmp_path):
    """One of three axes is the image, flat ones of one size are slices, others have numbers."""
    name = tmp_path / "a.tif"
    with tifffile.TiffWriter(name) as writer:
        for part in (IMAGE[:4], IMAGE[4:]):
            writer.write(part, contiguous=False, photometric="minisblack")
    assert "holds 2 series of pages (1 of 4 x 5 x 7, 1 of 2 x 5 x 7)" in refusal(name)
    assert np.array_equal(read_image(name, key="1"), IMAGE[4:])
    assert "key = '2' for" in refusal(name, key="2")
    with tifffile.TiffWriter(name) as writer:
        writer.write(IMAGE, contiguous=False)
        writer.write(IMAGE[0, :2, :2], contiguous=False)
    notices = []
    found, _ = read_with_size(name, notices=notices)
    assert np.array_equal(found, IMAGE)
    assert notices == [f"1 smaller series of {name} left out"]
    with tifffile.TiffWriter(name) as writer:
        writer.write(IMAGE[:5], contiguous=False)
        writer.write(IMAGE[5], contiguous=False)
    assert "a series of 5 slices and 1 single ones of the same size" in refusal(name)
    tifffile.imwrite(name, np.zeros((5, 7, 3), "u1"), photometric="rgb")
    assert "has 3 colours a voxel, expected grey levels" in refusal(name)


def test_lost_slices_are_not_made_up(tmp_path):
    """A stack of ImageJ that was cut at a page, and a file of OME-TIFF without its companion."""
    tifffile.imwrite(tmp_path / "a.tif", IMAGE[:4], imagej=True)
    data = (tmp_path / "a.tif").read_bytes().replace(b"images=4", b"images=6")
    (tmp_path / "a.tif").write_bytes(data.replace(b"slices=4", b"slices=6"))
    assert "has 4 of 6 slices, expected all" in refusal(tmp_path / "a.tif")
    tifffile.imwrite(tmp_path / "b.ome.tif", IMAGE, metadata={"axes": "ZYX"}, compression="zlib")
    data = (tmp_path / "b.ome.tif").read_bytes()
    (tmp_path / "b.ome.tif").write_bytes(data.replace(b'SizeZ="6"', b'SizeZ="9"'))
    assert "lacks page 6, expected 9" in refusal(tmp_path / "b.ome.tif")


@pytest.mark.parametrize("compression", [None, "packbits", "ccittfax4", "ccittrle"])
def test_one_bit_a_voxel(tmp_path, compression):
    """As programs write thresholded images; white is zero in those of fax machines."""
    from PIL import Image

    solid = IMAGE > IMAGE.mean()
    if compression in (None, "packbits"):
        tifffile.imwrite(
            tmp_path / "a.tif", solid, photometric="minisblack", compression=compression
        )
    else:
        how = {"ccittfax4": "group4", "ccittrle": "tiff_ccitt"}[compression]
        pages = [Image.fromarray(part) for part in solid]
        pages[0].save(tmp_path / "a.tif", save_all=True, append_images=pages[1:], compression=how)
    found, _ = read_with_size(tmp_path / "a.tif", grey=True)
    assert np.array_equal(found.astype(bool), solid)


@pytest.mark.parametrize("dtype", ["u1", "<u2", "<f4"])
def test_levels_whose_zeros_are_white_are_turned_round(tmp_path, dtype):
    image = (IMAGE // 16).astype(dtype)
    tifffile.imwrite(tmp_path / "a.tif", image, photometric="miniswhite")
    notices = []
    grey, _ = read_with_size(tmp_path / "a.tif", grey=True, notices=notices)
    assert np.array_equal(grey, image.max() - image + image.min())
    assert grey.dtype == image.dtype and "zeros of" in notices[0]
    # Labels are numbers, whatever colour they are shown in.
    assert np.array_equal(read_image(tmp_path / "a.tif"), image)


def nrrd(folder, *lines):
    head = ["NRRD0004", "type: uint16", "dimension: 3", "sizes: 7 5 6", "endian: little"]
    text = "\n".join([*head, "encoding: raw", *lines, "", ""])
    (folder / "a.nrrd").write_bytes(text.encode() + IMAGE.tobytes())
    return folder / "a.nrrd"


def meta(folder, *lines):
    head = ["NDims = 3", "DimSize = 7 5 6", "ElementType = MET_USHORT", *lines]
    text = "\n".join([*head, "ElementDataFile = LOCAL", ""])
    (folder / "a.mha").write_bytes(text.encode() + IMAGE.tobytes())
    return folder / "a.mha"


DIRECTIONS = "space directions: (5,0,0) (0,6,0) (0,0,7)"


@pytest.mark.parametrize(
    ("make", "lines", "size"),
    [
        (nrrd, (), None),
        (nrrd, ("spacings: 5 6 7",), 1e-3),
        (nrrd, ("spacings: 5 6 7", 'units: "um" "um" "um"'), 1e-6),
        (nrrd, ("space dimension: 3", DIRECTIONS, 'space units: "microns" "um" "µm"'), 1e-6),
        (nrrd, ("space: left-posterior-superior", DIRECTIONS), 1e-3),
        (
            nrrd,
            ("spacings: 5 6 7", 'units: "pixel" "pixel" "pixel"'),
            "5 pixel x 6 pixel x 7 pixel",
        ),
        (nrrd, ("spacings: 1 1 1",), None),
        (meta, (), None),
        (meta, ("ElementSpacing = 5 6 7",), 1e-3),
        (meta, ("ElementSpacing = 5 6 7", "DistanceUnits = um"), 1e-6),
        (meta, ("ElementSpacing = 1 1 1",), None),
    ],
)
def test_units_of_voxels(tmp_path, make, lines, size):
    """Micrometres had been a thousand times as long, and one millimetre taken where none is."""
    path = make(tmp_path, *lines)
    found, stated = read_with_size(path)
    assert np.array_equal(found, IMAGE)
    expected = tuple(n * size for n in (7, 6, 5)) if isinstance(size, float) else None
    assert stated == (size if expected is None else pytest.approx(expected, rel=1e-12))


@pytest.mark.parametrize(("code", "metre"), [(0, None), (1, 1.0), (2, 1e-3), (3, 1e-6)])
def test_units_of_nifti(tmp_path, code, metre):
    image = SimpleITK.GetImageFromArray(IMAGE)
    image.SetSpacing((5, 6, 7))
    SimpleITK.WriteImage(image, str(tmp_path / "a.nii"))
    data = bytearray((tmp_path / "a.nii").read_bytes())
    data[123] = code
    (tmp_path / "a.nii").write_bytes(data)
    _, size = read_with_size(tmp_path / "a.nii")
    assert size == (None if metre is None else pytest.approx((7 * metre, 6 * metre, 5 * metre)))


def test_voxels_of_metaimage_in_many_files(tmp_path):
    for k, part in enumerate(IMAGE):
        part.tofile(tmp_path / f"s{k:02d}.raw")
    head = "NDims = 3\nDimSize = 7 5 6\nElementType = MET_USHORT\nElementDataFile = "
    (tmp_path / "a.mhd").write_text(head + "s%02d.raw 0 5 1\n")
    names = "".join(f"s{k:02d}.raw\n" for k in range(6))
    (tmp_path / "b.mhd").write_text(head + "LIST\n" + names)
    assert np.array_equal(read_image(tmp_path / "a.mhd"), IMAGE)
    assert np.array_equal(read_image(tmp_path / "b.mhd"), IMAGE)
    (tmp_path / "s03.raw").write_bytes(b"x" * 69)
    for name in ("a.mhd", "b.mhd"):
        assert "s03.raw has 69 bytes of voxels, expected 70" in refusal(tmp_path / name)
