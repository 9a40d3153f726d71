"""Notebooks of the documentation run from their first cell to their last, as a reader would."""

import json
from pathlib import Path

import pytest

STORED = sorted((Path(__file__).resolve().parents[1] / "docs" / "notebooks").glob("*.ipynb"))
#: What makes their tests short: the first part of a run.
SHORTER = {"first_run": (("strain=0.06", "strain=0.015"),)}
#: Most that a notebook takes with what its cells give [bytes].
LARGEST = 500_000


def kinds(notebook):
    """Of each cell the kinds of what it gives."""
    codes = (cell for cell in notebook["cells"] if cell["cell_type"] == "code")
    return [
        [sorted(output.get("data", [output["output_type"]])) for output in cell["outputs"]]
        for cell in codes
    ]


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_a_notebook_gives_what_is_stored_in_it(path, tmp_path):
    for name in ("nbclient", "ipykernel"):
        pytest.importorskip(name, reason=f"{name}, of the extra test, is not installed")
    from tests.notebooks import execute

    stored = json.loads(path.read_text(encoding="utf-8"))
    found = execute(path, tmp_path, SHORTER.get(path.stem, ()))
    assert kinds(found) == kinds(stored), "run `make notebooks`"


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_a_notebook_is_small_and_names_no_place(path):
    text = path.read_text(encoding="utf-8")
    assert len(text) <= LARGEST
    assert not [place for place in ("/home/", "/tmp/", "/root/") if place in text]
    assert not [cell for cell in kinds(json.loads(text)) if ["error"] in cell]
