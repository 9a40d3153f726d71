"""Nothing of grains.h5 is believed: damage is one line, whatever it hit."""

import shutil

import h5py
import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.grain_file import WITHOUT_CHECKSUM, GrainFile
from mufe_fenicsx.geometry.grains import Grains, load_grains, read_grain_table, save_grains


@pytest.fixture
def folder(tmp_path):
    meshes = [box((1, 1, 1), (2, 1, 1), origin=(2.0 * k, 0, 0)) for k in range(3)]
    save_grains(tmp_path, Grains.from_list([3, 5, 9], meshes, 0.5, [[0, 0, 0], [6, 1, 1]]))
    return tmp_path


def as_version_1(folder):
    """The file without a checksum, as somebody else may have written it; open for changes."""
    path = folder / "grains.h5"
    with h5py.File(path) as old, h5py.File(folder / "plain.h5", "w") as new:
        for name in old:
            old.copy(name, new)
        new.attrs.update(old.attrs)
        new.attrs["version"] = WITHOUT_CHECKSUM
    shutil.move(folder / "plain.h5", path)
    return h5py.File(path, "r+")


def put(file, name, values):
    del file[name]
    file[name] = values


def changed(file, name, at, value):
    values = file[name][()]
    values[at] = value
    put(file, name, values)


#: What is wrong -> how to do that to an open file.
DAMAGE = {
    "labels is missing": lambda f: f.__delitem__("labels"),
    "labels is no array": lambda f: (f.__delitem__("labels"), f.create_group("labels")),
    "labels is a link": lambda f: (
        f.__delitem__("labels"), f.__setitem__("labels", h5py.SoftLink("/cell_label"))),
    "cells is a link": lambda f: (
        f.__delitem__("cells"), f.__setitem__("cells", h5py.ExternalLink("x.h5", "/cells"))),
    "labels has float64": lambda f: put(f, "labels", [3.0, 5.0, 9.0]),
    "labels has object": lambda f: put(f, "labels", ["a", "b", "c"]),
    "labels is empty": lambda f: put(f, "labels", np.empty(0, int)),
    "labels has 0": lambda f: changed(f, "labels", 0, 0),
    "labels has -5": lambda f: changed(f, "labels", 1, -5),
    "labels has 9223372036854775808": lambda f: put(f, "labels", np.array([1, 2, 2**63], "u8")),
    "labels has one twice": lambda f: changed(f, "labels", 0, 5),
    "cells has the shape (36, 3)": lambda f: put(f, "cells", f["cells"][:, :3]),
    "cells has float64": lambda f: put(f, "cells", f["cells"][()] + 0.5),
    "cells of grain 5 have nodes 12 to 1000000000": lambda f: changed(f, "cells", (14, 2), 10**9),
    "cells of grain 3 have nodes -5 to 11": lambda f: changed(f, "cells", (3, 0), -5),
    "cells of grain 9 have nodes 0 to 35": lambda f: changed(f, "cells", (30, 0), 0),
    "grain 3 has a cell without volume": lambda f: changed(
        f, "cells", 2, f["cells"][2][[0, 2, 1, 3]]),
    "points has the shape (108,)": lambda f: put(f, "points", f["points"][()].ravel()),
    "points has float128": lambda f: put(f, "points", f["points"][()].astype("g")),
    "grain 9 has a node far away": lambda f: changed(f, "points", (30, 1), np.nan),
    "volume of grain 3 = 2, that of its cells 1": lambda f: changed(f, "volumes", 0, 2.0),
    "volumes has one that is not > 0": lambda f: changed(f, "volumes", 0, np.nan),
    "centroids has one far away": lambda f: changed(f, "centroids", (1, 1), -np.inf),
    "node_offset goes from 1 to 36": lambda f: changed(f, "node_offset", 0, 1),
    "node_offset has a grain of too few": lambda f: changed(f, "node_offset", 1, 30),
    "cell_offset goes from 0 to 1000000": lambda f: changed(f, "cell_offset", 3, 10**6),
    "cell_offset has the shape (3,)": lambda f: put(f, "cell_offset", [0, 12, 36]),
    "element_size = nan": lambda f: f.attrs.__setitem__("element_size", np.nan),
    "element_size is no number": lambda f: f.attrs.__setitem__("element_size", [1.0, 2.0]),
    "box is none": lambda f: changed(f, "box", (1, 1), -1.0),
}  # fmt: skip


@pytest.mark.parametrize("what", DAMAGE)
def test_damage_is_named(folder, what):
    with as_version_1(folder) as file:
        DAMAGE[what](file)
    with pytest.raises(InputError, match=r"grains.h5 is damaged \(") as refused:
        load_grains(folder)
    assert f"({what}" in str(refused.value) and "\n" not in str(refused.value)


def test_files_without_a_checksum_are_read(folder):
    as_version_1(folder).close()
    assert load_grains(folder).labels.tolist() == [3, 5, 9]


def test_the_checksum_sees_what_could_be_right(folder):
    """A node moved by a rounding, a label that is another one, a version that has no checksum."""
    path, copy = folder / "grains.h5", folder / "copy.h5"
    shutil.copy(path, copy)
    with h5py.File(path, "r+") as file:
        changed(file, "points", (14, 1), np.nextafter(file["points"][14, 1], 2.0))
    with pytest.raises(InputError, match=r"damaged \(its checksum differs\)"):
        load_grains(folder, [0])
    with h5py.File(copy, "r+") as file:
        file["labels"][1] = 6
        file.attrs["version"] = WITHOUT_CHECKSUM
    with pytest.raises(InputError, match=r"damaged \(its checksum differs\)"):
        read_grain_table(copy)
    assert read_grain_table(copy, compare=False)[0].tolist() == [3, 6, 9]


def test_an_array_of_terabytes_is_refused_before_it_is_read(folder):
    with as_version_1(folder) as file:
        del file["labels"]
        file.create_dataset("labels", (1 << 42,), "i8", chunks=(1 << 16,))
    with pytest.raises(InputError, match=r"labels take 3.52e\+04 GB, expected less than the mem"):
        load_grains(folder)


def flip_bits(folder, chance, count):
    """Copies of a file with some bits flipped, and some that are cut as well: all are refused."""
    data = (folder / "grains.h5").read_bytes()
    path = folder / "flipped.h5"
    for _ in range(count):
        flipped = bytearray(data)
        for at in chance.integers(8 * len(data), size=chance.integers(1, 13)):
            flipped[at // 8] ^= 1 << (at % 8)
        if chance.random() < 0.1:
            flipped = flipped[: chance.integers(len(data))]
        path.write_bytes(flipped)
        with pytest.raises(InputError) as refused:
            load_grains(path)
        assert "\n" not in str(refused.value) and len(str(refused.value)) < 500


def test_flipped_bits(folder):
    flip_bits(folder, np.random.default_rng(40), 100)


@pytest.mark.slow
def test_flipped_bits_of_many_files(folder):
    flip_bits(folder, np.random.default_rng(41), 3000)


def test_a_file_is_closed_where_it_is_refused(folder):
    with as_version_1(folder) as file:
        put(file, "labels", [1, 1, 2])
    for _ in range(2):
        with pytest.raises(InputError):
            GrainFile(folder)
        with h5py.File(folder / "grains.h5", "r+") as file:  # not while another has it open
            file.attrs["note"] = "open"
