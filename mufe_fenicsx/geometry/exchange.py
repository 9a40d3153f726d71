"""Grain meshes to and from the formats of other programs, through meshio.

Each cell carries the label of its grain: as cell data ``label`` (VTU, VTK, XDMF), as physical and
elementary tags (MSH of gmsh), or as element sets ``GRAIN_<label>`` (INP of Abaqus and CalculiX).
Lengths are written in metres with all digits.
"""

from pathlib import Path

import meshio
import numpy as np

from ..errors import InputError
from .grains import Grains
from .measure import positively_oriented
from .output import new_files
from .pieces import piece_of_cell

SETS = "GRAIN_"
#: Formats by the end of the name, and how meshio is to write them.
FORMATS = {
    # Version 2.2 has a tag for each element; 4.1 only for each entity.
    ".msh": {"file_format": "gmsh22", "binary": True},
    ".vtu": {"file_format": "vtu", "binary": True},
    ".vtk": {"file_format": "vtk", "binary": True},
    ".xdmf": {"file_format": "xdmf"},
    ".inp": {"file_format": "abaqus", "float_fmt": ".17g"},
}
#: Cell data that tell grains apart, the first that is there.
TAGS = ("label", "gmsh:physical", "gmsh:geometrical", "cell_tags", "grain")


def export_grains(path, grains, *, overwrite=False):
    """Write grain meshes into one file; its ending says the format, see `FORMATS`.

    Args:
        path: File to write.
        grains: :class:`~mufe_fenicsx.geometry.grains.Grains`.
        overwrite: Replace the file.

    Raises:
        InputError: an unknown ending, the file is there already or cannot be written.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise InputError(f"output {path}, expected a name that ends with {', '.join(FORMATS)}")
    label = grains.cell_label.astype(np.int32)
    data, sets = {"label": [label]}, None
    if kind == ".msh":
        data = {"gmsh:physical": [label], "gmsh:geometrical": [label]}
    elif kind == ".inp":
        first = grains.cell_offset
        data = {}
        sets = {
            f"{SETS}{number}": [np.arange(first[g], first[g + 1])]
            for g, number in enumerate(grains.labels)
        }
    mesh = meshio.Mesh(grains.points, [("tetra", grains.cells)], cell_data=data, cell_sets=sets)
    files = [path] if kind != ".xdmf" else [path, path.with_suffix(".h5")]
    with new_files(*files, overwrite=overwrite) as folder:
        meshio.write(folder / path.name, mesh, **FORMATS[kind])


def import_grains(path, scale=1.0, element_size=None):
    """Read tetrahedral meshes of grains from a file of another program.

    Grains are told apart by the first of `TAGS` among the cell data, by element sets
    ``GRAIN_<label>``, or else by which cells hang together. A node that grains share is
    doubled: in this model they touch through contact. Cells that are inside out are turned.

    Args:
        path: File in a format of meshio.
        scale: Metres a unit of length.
        element_size: Wanted length of edges [m], which is stored; None: the mean edge.

    Raises:
        InputError: the file cannot be read or holds no tetrahedra, or a grain is in pieces.
    """
    path = Path(path)
    mesh = read_foreign(path)
    blocks = [k for k, block in enumerate(mesh.cells) if block.type == "tetra"]
    if not blocks:
        found = ", ".join(sorted({block.type for block in mesh.cells})) or "nothing"
        raise InputError(f"{path} holds {found}, expected linear tetrahedra (tetra)")
    cells = np.concatenate([mesh.cells[k].data for k in blocks]).astype(np.int64)
    points = np.asarray(mesh.points, dtype=np.float64) * scale
    label = _labels_of_cells(mesh, blocks, cells)
    if label.min() < 1:
        raise InputError(f"{path}: smallest label is {label.min()}, expected labels from 1")
    labels, meshes = np.unique(label), []
    for number in labels:
        used, local = np.unique(cells[label == number], return_inverse=True)
        part = local.reshape(-1, 4)
        num_pieces = 1 + piece_of_cell(part).max()
        if num_pieces > 1:
            raise InputError(
                f"{path}: grain {number} is in {num_pieces} pieces, expected one that hangs "
                "together"
            )
        meshes.append((points[used], positively_oriented(points[used], part)))
    if element_size is None:
        edges = points[cells[:, [0, 0, 0, 1, 1, 2]]] - points[cells[:, [1, 2, 3, 2, 3, 3]]]
        element_size = float(np.linalg.norm(edges, axis=-1).mean())
    return Grains.from_list(labels, meshes, element_size)


def read_foreign(path, what="mesh", expected="a format of meshio"):
    """A mesh by meshio, whose failures become one line.

    Args:
        path: Its file.
        what, expected: What the message calls it, and what it asks for.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        return meshio.read(path)
    except SystemExit as error:  # meshio ends the program on a file that it cannot read
        raise InputError(f"{what} {path} cannot be read, expected {expected}") from error
    except Exception as error:
        raise InputError(f"{what} {path} cannot be read: {' '.join(str(error).split())}") from error


def _labels_of_cells(mesh, blocks, cells):
    for name in TAGS:
        if name in mesh.cell_data:
            return np.concatenate([mesh.cell_data[name][k] for k in blocks]).astype(np.int64)
    label = np.zeros(len(cells), dtype=np.int64)
    first = np.cumsum([0] + [len(mesh.cells[k].data) for k in blocks])
    for name, members in mesh.cell_sets.items():
        number = name.upper().removeprefix(SETS)
        if name.upper().startswith(SETS) and number.isdigit():
            for i, k in enumerate(blocks):
                if members[k] is not None:
                    label[first[i] + np.asarray(members[k], dtype=np.int64)] = int(number)
    return label if label.any() else 1 + piece_of_cell(cells)
