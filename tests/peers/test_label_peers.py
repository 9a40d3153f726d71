"""Labels that leave for Fiji and SPAM come back as they were, and contacts are SPAM's own."""

import subprocess
import sys

import numpy as np
import pytest
import tifffile

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.image.label_files import read_labels
from mufe_fenicsx.peers.fiji import export_fiji
from mufe_fenicsx.peers.spam import contact_table, export_spam, find_contacts, read_contacts
from tests.peers.samples import packed_labels


@pytest.mark.parametrize(
    ("largest", "size", "kind"),
    [(None, 5e-6, "uint8"), (40_000, 2.3625e-6, "uint16"), (70_001, 1 / 3e5, "float32")],
)
def test_labels_come_back_from_fiji(tmp_path, largest, size, kind):
    """Labels identical, the voxel size to the twelve digits that are written."""
    labels = packed_labels(largest=largest)
    path = tmp_path / "fiji.tif"
    assert export_fiji(path, labels, size)["type"] == kind
    with tifffile.TiffFile(path) as file:
        meta = file.imagej_metadata
        assert file.is_imagej and file.series[0].axes == "ZYX"
        assert meta["slices"] == labels.shape[0] and meta["unit"] == "um"
        tags = file.pages[0].tags
        pixels = [np.divide(*tags[name].value) for name in ("XResolution", "YResolution")]
    # As ImageJ reads them: pixels a unit along x and y, the distance of slices along z.
    assert np.allclose([1 / pixels[0], 1 / pixels[1], meta["spacing"]], size / 1e-6, rtol=1e-11)
    back, edge = read_labels(path)
    assert np.array_equal(back, labels) and edge == pytest.approx(size, rel=1e-11)


def test_what_imagej_cannot_hold_is_refused(tmp_path):
    labels = np.zeros((3, 3, 3), dtype=np.int32)
    labels[1, 1, 1] = 2**24 + 1
    with pytest.raises(InputError, match="expected up to 16777216"):
        export_fiji(tmp_path / "a.tif", labels, 1e-6)
    assert not list(tmp_path.iterdir())


SPAM = """
import sys
import numpy, spam.label, tifffile
labels = tifffile.imread(sys.argv[1])
_, Z, table, pairs = spam.label.labelledContacts(labels.astype(spam.label.labelType))
numpy.savez(sys.argv[2], Z=Z, table=table, pairs=pairs)
numpy.save("contactTable.npy", table)
"""


def test_contacts_are_those_that_spam_finds(tmp_path):
    """Every number of SPAM's three tables, from the file that was written for it."""
    labels = packed_labels()
    result = export_spam(tmp_path / "spam", labels, 5e-6)
    assert np.array_equal(tifffile.imread(tmp_path / "spam" / "labels.tif"), labels)
    back, _ = read_labels(tmp_path / "spam" / "labels.tif", voxel_size=5e-6)
    assert np.array_equal(back, labels)
    pairs = read_contacts(tmp_path / "spam" / "contacts.tsv")
    assert len(pairs) == result["num_contacts"] > 20
    assert np.array_equal(
        np.unique(read_contacts(tmp_path / "spam" / "contactTable.txt"), axis=0),
        np.unique(pairs, axis=0),
    )
    command = [sys.executable, "-c", SPAM, tmp_path / "spam" / "labels.tif", tmp_path / "a.npz"]
    done = subprocess.run(
        list(map(str, command)), cwd=tmp_path, capture_output=True, text=True, check=False
    )
    if "No module named 'spam" in done.stderr:
        pytest.skip("spam is not installed")
    assert done.returncode == 0, done.stderr
    theirs = np.load(tmp_path / "a.npz")
    table, count = contact_table(find_contacts(labels)[0], labels.max())
    assert np.array_equal(pairs, theirs["pairs"]) and np.array_equal(count, theirs["Z"])
    width = table.shape[1]
    assert (
        np.array_equal(table, theirs["table"][:, :width]) and not theirs["table"][:, width:].any()
    )
    assert np.array_equal(read_contacts(tmp_path / "contactTable.npy"), pairs)


def test_tables_that_are_none(tmp_path):
    for text, why in (
        ("a b\n", "cannot be read"),
        ("1 1\n", "touches itself"),
        ("1 2 3\n", "hold"),
    ):
        (tmp_path / "a.txt").write_text(text)
        with pytest.raises(InputError, match=why):
            read_contacts(tmp_path / "a.txt")
