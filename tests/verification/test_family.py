"""The sand of the benchmarks."""

import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry import mesh
from mufe_fenicsx.verification import family


def test_a_sample_without_one_of_its_grains_is_no_member(tmp_path, monkeypatch):
    def mesh_labels(_labels, _settings, folder):
        folder.mkdir()
        return {"failed": [78], "reasons": ["stopped after 120 s"]}

    monkeypatch.setattr(family, "_labels", lambda *_: tmp_path / "labels.tif")
    monkeypatch.setattr(mesh, "mesh_labels", mesh_labels)
    for _ in range(2):  # nothing is left that a second call would take
        with pytest.raises(InputError, match="grain 78: stopped after 120 s"):
            family.member(tmp_path, 8)
