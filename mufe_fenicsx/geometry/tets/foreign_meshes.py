"""Grain meshes to and from the formats of other programs, through meshio.

Each cell carries the label of its grain: as cell data ``label`` (VTU, VTK, XDMF), as physical and
elementary tags (MSH of gmsh), or as element sets ``GRAIN_<label>`` (INP of Abaqus and CalculiX).
Lengths are written in metres with all digits.
"""

from pathlib import Path

import meshio
import numpy as np

from ...errors import InputError
from ...kernels.geometry.topology import body_defect, cell_defect, num_folds
from ...machine.files import new_files
from ..grains import Grains
from ..measure import positively_oriented, renumbered
from ..pieces import piece_of_cell
from .cell_labels import PIECES, SETS, labels_of_cells, unused_numbers
from .foreign import counted, read_tetrahedra

#: Formats by the end of the name, and how meshio is to write them.
FORMATS = {
    # Version 2.2 has a tag for each element; 4.1 only for each entity.
    ".msh": {"file_format": "gmsh22", "binary": True},
    ".vtu": {"file_format": "vtu", "binary": True},
    ".vtk": {"file_format": "vtk", "binary": True},
    ".xdmf": {"file_format": "xdmf"},
    ".inp": {"file_format": "abaqus", "float_fmt": ".17g"},
}


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


def import_grains(path, scale=1.0, element_size=None, labels=None, notices=None):
    """Read tetrahedral meshes of grains from a file of another program.

    Grains are told apart as `cell_labels.labels_of_cells` says. A node that grains share is
    doubled: in this model they touch through contact. Cells that are inside out are turned.

    Args:
        path: See `foreign.read_tetrahedra`.
        scale: Metres a unit of length.
        element_size: Wanted length of edges [m], which is stored; None: the mean edge.
        labels: What tells grains apart, where the file leaves more than one answer.
        notices: A list to which a line is added for whatever was left out or changed.

    Raises:
        InputError: the file cannot be read, holds other than linear tetrahedra, leaves open which
            cells make a grain, or one of these is no body.
    """
    path, notices = Path(path), [] if notices is None else notices
    mesh = read_tetrahedra(path)
    if mesh.others:
        notices.append(f"{path.name}: left out {counted(mesh.others)}")
    defect = cell_defect(mesh.cells, len(mesh.points))
    if defect:
        raise InputError(f"{path} has {defect}")
    points = mesh.points * scale
    cells = positively_oriented(points, mesh.cells)
    turned = np.count_nonzero((cells != mesh.cells).any(axis=1))
    if turned:
        notices.append(f"{path.name}: {turned} cells turned, which were inside out")
    folds = num_folds(cells)
    if folds:
        raise InputError(
            f"{path} has {folds} facets with both cells on one side, expected cells that do not "
            "lie in each other"
        )
    label, by = labels_of_cells(mesh, labels, str(path))
    unused = unused_numbers(mesh, label) if labels is None and by == PIECES else ()
    if unused:
        whole = mesh.data[unused[0]].min() >= 1
        how = f"--labels {unused[0]} takes it" if whole else "labels are from 1 on"
        notices.append(f"grains told apart by: {PIECES} ({', '.join(unused)} not used; {how})")
    numbers, meshes = np.unique(label), []
    order = np.argsort(label, kind="stable")
    first = np.searchsorted(label[order], numbers)
    for number, own in zip(numbers, np.split(order, first[1:]), strict=True):
        used, part = renumbered(cells[own])
        num_pieces = 1 + piece_of_cell(part).max()
        if num_pieces > 1:
            raise InputError(
                f"{path}: grain {number} by {by} is in {num_pieces} pieces, expected one that "
                f"hangs together, or --labels {PIECES}"
            )
        defect = body_defect(part, len(used))
        if defect:
            raise InputError(f"{path}: grain {number} has {defect}")
        meshes.append((points[used], part))
    if element_size is None:
        edges = points[cells[:, [0, 0, 0, 1, 1, 2]]] - points[cells[:, [1, 2, 3, 2, 3, 3]]]
        element_size = float(np.linalg.norm(edges, axis=-1).mean())
    return Grains.from_list(numbers, meshes, element_size)
