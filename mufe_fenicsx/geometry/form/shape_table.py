"""Table and figure of the shapes of grains, from meshes or labels on disk."""

import csv
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...machine.files import new_files
from ..grains import load_grains
from ..image.label_files import read_labels
from .shape import COLUMNS, LENGTHS, shapes_of_labels, shapes_of_meshes, size_at
from .shape_picture import draw_shapes


def write_shapes(source, output, *, voxel_size=None, key=None, overwrite=False):
    """Write ``shapes.csv`` and ``shapes.png`` into the folder ``output``.

    Args:
        source: Folder with ``grains.h5``, or labels (TIFF, .npy, .npz ...).
        output: Folder, made if it is not there.
        voxel_size: Of labels that do not state it [m].
        key: Name of the labels in an .npz file.
        overwrite: Replace these files.

    Returns:
        Summary, a dict.

    Raises:
        InputError: the source cannot be used, or the files are there already.
    """
    source, output = Path(source), Path(output)
    if not source.exists():
        raise InputError(f"{source} does not exist, expected a folder of grains or labels")
    notices = []
    if source.is_dir() and (source / "grains.h5").is_file():
        rows = shapes_of_meshes(load_grains(source))
    else:
        rows = shapes_of_labels(
            *read_labels(source, voxel_size=voxel_size, key=key, notices=notices)
        )
    names = ("shapes.csv", "shapes.png")
    made = not output.exists()
    try:
        output.mkdir(parents=True, exist_ok=True)
        with new_files(*(output / n for n in names), overwrite=overwrite) as folder:
            with (folder / names[0]).open("w", newline="", encoding="utf-8") as file:
                table = csv.DictWriter(file, COLUMNS)
                table.writeheader()
                table.writerows(rows)
            draw_shapes(folder / names[1], rows)
    except OSError as error:
        raise InputError(f"output {output} cannot be written: {error.strerror}") from error
    except InputError:
        if made and output.is_dir() and not any(output.iterdir()):
            output.rmdir()
        raise
    return {
        "num_grains": len(rows),
        "d10_m": size_at(rows, 0.1),
        "d50_m": size_at(rows, 0.5),
        "d60_m": size_at(rows, 0.6),
        **{
            f"mean_{name}": float(np.mean([row[name] for row in rows]))
            for name in ("elongation", "flatness", "sphericity", "convexity")
        },
        "lengths": LENGTHS,
        "notices": notices,
        "table": str(output / names[0]),
        "figure": str(output / names[1]),
    }
