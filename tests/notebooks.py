"""Runs the notebooks of the documentation; `python -m tests.notebooks` stores what cells give."""

import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
#: Most that a cell may take [s].
SECONDS = 120


def execute(path, folder):
    """A notebook with what its cells give when they are run in a folder.

    Lines that were written anew are as they were at last; of a picture there is the PNG alone.
    """
    notebook = nbformat.read(path, as_version=4)
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
        for output in cell.get("outputs", ()):
            output.get("data", {}).pop("image/jpeg", None)
    return notebook


def main():
    """Store all of them."""
    for path in NOTEBOOKS:
        with tempfile.TemporaryDirectory() as folder:
            nbformat.write(execute(path, folder), path)
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
