"""Runs the notebooks of the documentation; `python -m tests.notebooks` stores what cells give."""

import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
#: Most that a cell may take [s].
SECONDS = 600


def execute(path, folder, changes=()):
    """A notebook with what its cells give when they are run in a folder.

    Lines that were written anew are as they were at last; of a picture there is the PNG alone.
    What says how long one waits, on standard error, is left out.

    Args:
        path: Notebook.
        folder: Where it is run.
        changes: Pairs of texts: in the code of its cells, the first becomes the second.
    """
    notebook = nbformat.read(path, as_version=4)
    for old, new in changes:
        cells = [cell for cell in notebook.cells if old in cell.source]
        assert cells, f"{path.name} has no {old}"
        for cell in cells:
            cell.source = cell.source.replace(old, new)
    place = {"metadata": {"path": str(folder)}}
    client = NotebookClient(
        notebook,
        timeout=SECONDS,
        resources=place,
        kernel_name="python3",
        coalesce_streams=True,
        record_timing=False,
    )
    client.execute()
    notebook.metadata["language_info"] = {"name": "python"}  # not the version of this machine
    for cell in notebook.cells:
        given = [one for one in cell.get("outputs", ()) if one.get("name") != "stderr"]
        for output in given:
            output.get("data", {}).pop("image/jpeg", None)
        if "outputs" in cell:
            cell.outputs = given
    return notebook


def main():
    """Store all of them."""
    for path in NOTEBOOKS:
        with tempfile.TemporaryDirectory() as folder:
            nbformat.write(execute(path, folder), path)
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
