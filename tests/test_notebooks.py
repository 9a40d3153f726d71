"""Notebooks of the documentation run from their first cell to their last, as a reader would."""

import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[1] / "docs" / "notebooks").glob("*.ipynb"))

#: Most that a notebook takes with what its cells give [bytes], and that a cell takes [s].
LARGEST, SECONDS = 500_000, 120


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, tmp_path):
    nbclient = pytest.importorskip("nbclient", reason="nbclient, of the extra test, is missing")
    pytest.importorskip("ipykernel", reason="ipykernel, of the extra test, is missing")
    import nbformat

    notebook = nbformat.read(path, as_version=4)
    place = {"metadata": {"path": str(tmp_path)}}
    client = nbclient.NotebookClient(
        notebook, timeout=SECONDS, resources=place, kernel_name="python3"
    )
    client.execute()
    assert kinds(json.loads(path.read_text())) == kinds(notebook), "run `make notebooks`"


def kinds(notebook):
    """Of each cell's outputs, the richest kind."""
    return [
        [sorted(output.get("data", [output["output_type"]]))[0] for output in cell["outputs"]]
        for cell in notebook["cells"]
        if cell["cell_type"] == "code"
    ]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_small_and_without_places(path):
    text = path.read_text(encoding="utf-8")
    assert len(text) <= LARGEST
    assert "/home/" not in text and "/tmp/" not in text and "error" not in kinds(json.loads(text))
