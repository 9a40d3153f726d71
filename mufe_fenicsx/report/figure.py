"""A figure with its data and its words, and the files that they become."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pandas
from fontTools import subset

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.machine.files import reason, regular, replacing, write_atomically

#: Lists what is in the folder of figures.
INDEX = "index.json"


@dataclass
class Drawing:
    """A figure before it is saved.

    ``tables`` are the numbers it shows: dict of column -> array, by the ending of the file
    (panel "a", or "" where one table has all). Columns state their unit, as "stress [Pa]".
    """

    name: str  #: of its files, without ending
    figure: object  #: matplotlib Figure
    caption: str
    how: str  #: how to read it
    tables: dict
    shape: str = "narrow"  #: on the page: "narrow" (a column) or "wide"
    vector: bool = True  #: worth a PDF; pictures of bodies in space are not


@dataclass(frozen=True)
class Picture:
    """A figure that was saved."""

    name: str
    caption: str
    how: str
    shape: str
    image: Path  #: PNG or GIF
    vector: Path | None  #: PDF
    data: tuple = field(default_factory=tuple)  #: CSV files
    movie: Path | None = None  #: MP4

    @property
    def files(self):
        """All its files."""
        return [p for p in (self.image, self.vector, self.movie, *self.data) if p is not None]

    @property
    def row(self):
        """(image, caption, words, shape), as :func:`mufe_fenicsx.report.page.write_page` takes."""
        others = ", ".join(f"{p.parent.name}/{p.name}" for p in self.files if p != self.image)
        files = f" Files: {others}." if others else ""
        return self.image, self.caption, f"{self.how}{files}", self.shape


class PlacedLetters(subset.Options):
    """Fonts inside a PDF without the tables by which text is set, which is done by then.

    To cut these down to the letters of a figure takes longer than to draw it.
    """

    def __init__(self, **options):
        super().__init__(**options)
        self.drop_tables = [*self.drop_tables, "GDEF", "GPOS", "GSUB", "kern", "MATH"]


def save(drawing, folder):
    """Write PNG, PDF and CSV of a drawing into a folder; returns the :class:`Picture`."""
    image = folder / f"{drawing.name}.png"
    with replacing(image) as part:
        drawing.figure.savefig(part, format="png")
    drawing.figure.set_layout_engine("none")  # as it was laid out for the PNG
    vector = None
    if drawing.vector:
        vector = folder / f"{drawing.name}.pdf"
        with replacing(vector) as part, patch.object(subset, "Options", PlacedLetters):
            # Without the date the same run gives the same file.
            drawing.figure.savefig(part, format="pdf", metadata={"CreationDate": None})
    data = save_tables(drawing.name, drawing.tables, folder)
    return Picture(drawing.name, drawing.caption, drawing.how, drawing.shape, image, vector, data)


def save_tables(name, tables, folder):
    """Write tables as ``name.csv`` or, by panel, ``name-a.csv``; returns the paths."""
    paths = []
    for panel, columns in tables.items():
        path = folder / (f"{name}-{panel}.csv" if panel else f"{name}.csv")
        columns = {key: np.asarray(values) for key, values in columns.items()}
        with replacing(path) as part:
            pandas.DataFrame(columns).to_csv(part, index=False)
        paths.append(path)
    return tuple(paths)


def file_name(name):
    """A name as part of that of a file."""
    return "".join(c if c.isalnum() or c in ".-" else "-" for c in name).strip("-")


def write_index(folder, pictures):
    """List the pictures in ``index.json`` of their folder."""
    listed = [
        {
            "name": p.name,
            "caption": p.caption,
            "how": p.how,
            "image": p.image.name,
            "vector": p.vector.name if p.vector else None,
            "movie": p.movie.name if p.movie else None,
            "data": [path.name for path in p.data],
        }
        for p in pictures
    ]
    write_atomically(folder / INDEX, json.dumps(listed, indent=1, ensure_ascii=False) + "\n")


def list_figures(report_folder):
    """The figures of a report with their captions, in its order.

    Args:
        report_folder: Where report.html is.

    Returns:
        List of dicts ``name``, ``caption``, ``how`` and the names of files in the folder
        ``figures``: ``image``, ``vector`` (or None), ``movie`` (or None), ``data`` (a list).

    Raises:
        InputError: There is no such list.
    """
    path = Path(report_folder) / "figures" / INDEX
    try:
        return json.loads(regular(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path} cannot be read ({reason(error)}), expected the list that mufe report writes"
        ) from error


def remove_listed(folder):
    """Remove the figures of an earlier report, which would stay beside those of this one."""
    try:
        listed = json.loads(regular(folder / INDEX).read_text(encoding="utf-8"))
        names = [n for f in listed for n in (f["image"], f["vector"], f["movie"], *f["data"])]
    except (OSError, ValueError, KeyError, TypeError):
        return
    for name in names:
        if name and Path(name).name == name:
            (folder / name).unlink(missing_ok=True)
