"""`mufe export …`: what works ends with 0, what cannot be used in one line with 2 and no output."""

import numpy as np
import pytest
import tifffile

from mufe_fenicsx.cli.main import main
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.geometry.image.label_files import write_labels
from tests.peers.samples import ball_and_brick, packed_labels

SCENE = """
[sample]
grains = "g"
[material]
model = "elastic"
E = 100e9
nu = 0.15
rho = 2650
[contact]
friction = 0.23
[oedometer]
strain = 0.1
speed = 2
"""


@pytest.fixture
def mufe(tmp_path, monkeypatch, capfd):
    """Run `mufe` beside grains `g`, labels `l.tif` and a scene `s.toml`; status and output."""
    monkeypatch.chdir(tmp_path)
    save_grains("g", ball_and_brick())
    write_labels("l.tif", packed_labels(), 5e-6)
    (tmp_path / "s.toml").write_text(SCENE)
    tifffile.imwrite("bare.tif", packed_labels().astype(np.uint16))

    def call(*arguments):
        capfd.readouterr()
        with pytest.raises(SystemExit) as end:
            main(list(arguments))
        out, err = capfd.readouterr()
        return end.value.code, out, err

    return call


def test_every_peer_is_served(mufe, tmp_path):
    for arguments, made in (
        (("g", "-o", "a.vtu"), "a.vtu"),
        (("-o", "b.msh", "g"), "b.msh"),
        (("mesh", "g", "-o", "c.inp"), "c.inp"),
        (("surfaces", "g", "-o", "s", "--format", "ply", "--unit", "1 mm"), "s/grain_03.ply"),
        (("clumps", "g", "-o", "c", "--spheres", "3"), "c/clumps.txt"),
        (("level-sets", "g", "-o", "ls", "--spacing", "30 um"), "ls/lsdem/morph_1.dat"),
        (("fiji", "l.tif", "-o", "f.tif"), "f.tif"),
        (("spam", "bare.tif", "-o", "sp", "--voxel-size", "5 um"), "sp/contacts.tsv"),
        (("calculix", "s.toml", "-o", "d.inp"), "d.inp"),
    ):
        status, out, err = mufe("export", *arguments)
        assert status in (0, None), (arguments, out, err)
        assert (tmp_path / made).is_file(), arguments


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("nowhere", "-o", "x.vtu"), "no file nowhere"),
        (("surfaces", "g", "-o", "x", "--format", "step"), "expected one of stl, ply, obj"),
        (("surfaces", "g", "-o", "x", "--unit", "1 kg"), '--unit = "1 kg", expected a length'),
        (("clumps", "g", "-o", "x", "--missing", "1.5"), "--missing = 1.5, expected 0 <= missing"),
        (("level-sets", "g", "-o", "x", "--spacing", "1 nm"), "expected a grid of at most"),
        (("fiji", "bare.tif", "-o", "x.tif"), "voxel_size of bare.tif is not stated"),
        (("fiji", "l.tif", "-o", "x.png"), "ends with .tif"),
        (("spam", "l.tif", "-o", "g"), "expected a folder that may be replaced"),
        (("calculix", "s.toml", "-o", "x.k"), "ends with .inp"),
        (("calculix", "s.toml", "-o", "x.inp", "--grains", "none"), "no file none"),
    ],
)
def test_what_cannot_be_used_ends_in_one_line(mufe, tmp_path, arguments, why):
    if why.endswith("replaced"):
        arguments = (*arguments, "--overwrite")
    before = sorted(tmp_path.rglob("*"))
    status, out, err = mufe("export", *arguments)
    assert status == 2 and why in err, err
    assert len(err.strip().splitlines()) == 1 and "Traceback" not in out + err
    assert sorted(tmp_path.rglob("*")) == before
