"""The line that tells how far a run has come, where a notebook shows it."""

import sys
from types import SimpleNamespace

import pytest

from mufe_fenicsx.run import progress_line


@pytest.mark.parametrize("quiet", [False, True])
def test_a_notebook_sees_one_line_that_is_written_anew(monkeypatch, capsys, quiet):
    monkeypatch.setitem(sys.modules, progress_line.NOTEBOOK, SimpleNamespace())
    monkeypatch.setattr(progress_line, "REFRESH_SECONDS", 0.0)
    loading = SimpleNamespace(stage="loading", part_done=0.25, strain=0.0125)
    simulation = SimpleNamespace(state=SimpleNamespace(num_steps=100))
    with progress_line.ProgressLine(SimpleNamespace(rank=0), loading, quiet) as line:
        line.update(simulation)
        loading.part_done, loading.strain = 1.0, 0.05
    first, *shown = capsys.readouterr().out.split("\r")
    assert first == "" and len(shown) == (0 if quiet else 2)
    if shown:
        assert shown[0].startswith("loading  25%  strain 0.0125  ") and "steps/s" in shown[0]
        assert shown[1].rstrip() == "loading 100%  strain 0.0500" and shown[1].endswith("\n")
