"""Grain meshes: all grains of a sample in one set of arrays, and their folder on disk.

The folder holds `grains.h5` with the arrays and `grains.xdmf`, through which
ParaView opens them. Reading takes only the grains asked for, so that each
rank of a parallel run reads its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import h5py
import numpy as np
from numpy.typing import ArrayLike

from ..arguments import checked
from ..errors import InputError
from ..machine.files import replacing, write_atomically
from .grain_file import BLOCK, FORMAT, VERSION, GrainFile, write_checksum
from .measure import centroid_of, tet_volumes


@dataclass(frozen=True)
class Grains:
    """Tetrahedral meshes of grains; no two grains share a node.

    Nodes and cells of grain g are the slices given by ``node_offset[g : g + 2]``
    and ``cell_offset[g : g + 2]``.
    """

    points: np.ndarray  #: nodes [m], shape (num_nodes, 3)
    cells: np.ndarray  #: node numbers of the tetrahedra, shape (num_cells, 4)
    labels: np.ndarray  #: label of each grain, shape (num_grains,)
    node_offset: np.ndarray  #: first node of each grain, shape (num_grains + 1,)
    cell_offset: np.ndarray  #: first cell of each grain, shape (num_grains + 1,)
    element_size: float  #: wanted length of edges [m]
    box: np.ndarray | None = None  #: corners of the image domain [m], shape (2, 3)
    cylinder: np.ndarray | None = None  #: that cuts the grains: x, y, radius [m], shape (3,)

    @property
    def num_grains(self) -> int:
        """Number of grains."""
        return len(self.labels)

    @property
    def cell_label(self) -> np.ndarray:
        """Label of the grain of each cell, shape (num_cells,)."""
        return np.repeat(self.labels, np.diff(self.cell_offset))

    @property
    def volumes(self) -> np.ndarray:
        """Volume of each grain [m³], shape (num_grains,)."""
        cell_volumes = tet_volumes(self.points, self.cells)
        return np.add.reduceat(cell_volumes, self.cell_offset[:-1])

    @property
    def centroids(self) -> np.ndarray:
        """Centre of volume of each grain [m], shape (num_grains, 3)."""
        return np.array([centroid_of(*self.grain(g)) for g in range(self.num_grains)])

    def grain(self, g: int) -> tuple[np.ndarray, np.ndarray]:
        """Nodes of grain ``g`` [m] and its cells, numbered from 0 within the grain."""
        first, last = self.node_offset[g : g + 2]
        cells = self.cells[self.cell_offset[g] : self.cell_offset[g + 1]]
        return self.points[first:last], cells - first

    @classmethod
    def from_list(
        cls,
        labels: ArrayLike,
        meshes: Sequence[tuple[ArrayLike, ArrayLike]],
        element_size: float,
        box: ArrayLike | None = None,
        cylinder: ArrayLike | None = None,
    ) -> Self:
        """Join meshes of single grains.

        Args:
            labels: Positive integers, different from each other; the grains
                are put in the order of their labels.
            meshes: A pair (points, cells) a grain, cells numbered from 0.
            element_size: Wanted length of edges [m].
            box: Corners of the image domain [m], shape (2, 3), or None.
            cylinder: x and y of the axis and the radius of a cylinder that cuts them [m], or None.

        Raises:
            InputError: labels occur twice, are not positive, or a cell has no volume.
        """
        labels = np.asarray(labels, dtype=np.int64)
        if len(labels) == 0 or len(labels) != len(meshes):
            raise InputError(
                f"{len(labels)} labels and {len(meshes)} meshes of grains, "
                "expected as many labels as meshes and at least one"
            )
        if labels.min() < 1 or len(np.unique(labels)) < len(labels):
            raise InputError(
                f"labels of grains from {labels.min()}, {len(np.unique(labels))} different ones of "
                f"{len(labels)}, expected positive labels that differ"
            )
        order = np.argsort(labels)
        node_offset = np.cumsum([0] + [len(meshes[g][0]) for g in order])
        cell_offset = np.cumsum([0] + [len(meshes[g][1]) for g in order])
        points = np.concatenate([np.asarray(meshes[g][0], dtype=float) for g in order])
        cells = np.concatenate(
            [np.asarray(meshes[g][1], dtype=np.int64) + node_offset[i] for i, g in enumerate(order)]
        )
        grains = cls(
            points,
            cells,
            labels[order],
            node_offset.astype(np.int64),
            cell_offset.astype(np.int64),
            float(element_size),
            None if box is None else np.array(box, dtype=float).reshape(2, 3),
            None if cylinder is None else np.array(cylinder, dtype=float).reshape(3),
        )
        bad = np.flatnonzero(~(tet_volumes(points, cells) > 0))
        if len(bad):
            raise InputError(
                f"grain {grains.cell_label[bad[0]]}: cell {bad[0]} has no positive volume, "
                "expected tetrahedra with det(x1-x0, x2-x0, x3-x0) > 0"
            )
        return grains


@checked
def save_grains(folder: str | Path, grains: Grains) -> None:
    """Write `grains.h5` and `grains.xdmf` into a folder, which is made if it is not there.

    Raises:
        InputError: the folder cannot be written.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(folder / "grains.h5") as part:
            with h5py.File(part, "w", userblock_size=BLOCK) as file:
                file.attrs["format"] = FORMAT
                file.attrs["version"] = VERSION
                file.attrs["length_unit"] = "m"
                file.attrs["element_size"] = grains.element_size
                file["points"] = grains.points.astype(np.float64)
                file["cells"] = grains.cells.astype(np.int64)
                file["labels"] = grains.labels.astype(np.int64)
                file["node_offset"] = grains.node_offset.astype(np.int64)
                file["cell_offset"] = grains.cell_offset.astype(np.int64)
                file["cell_label"] = grains.cell_label.astype(np.int32)
                file["centroids"] = grains.centroids
                file["volumes"] = grains.volumes
                if grains.box is not None:
                    file["box"] = grains.box
                if grains.cylinder is not None:
                    file["cylinder"] = grains.cylinder
            write_checksum(part)
        write_atomically(folder / "grains.xdmf", _xdmf(len(grains.points), len(grains.cells)))
    except OSError as error:
        raise InputError(f"folder {folder} cannot be written: {_one_line(error)}") from error


@checked
def load_grains(
    folder_or_h5: str | Path, which: ArrayLike | None = None, compare: bool = True
) -> Grains:
    """Read grain meshes; all that is read is checked (:mod:`.grain_file`).

    Args:
        folder_or_h5: The folder written by `save_grains`, or its `grains.h5`.
        which: Indices 0 … num_grains-1 of the grains to read, in the order in
            which they are wanted; only their part of the file is read. None: all.
        compare: Compare the checksum of the file, for which all of it is read once.

    Raises:
        InputError: no such file, not a file of grains, a damaged one, or an index outside it.
    """
    with GrainFile(folder_or_h5, compare) as file:
        labels = file.labels
        which = np.arange(len(labels)) if which is None else which
        which = np.asarray(which, dtype=np.int64).reshape(-1)
        outside = which[(which < 0) | (which >= len(labels))]
        if len(outside):
            raise InputError(
                f"grain index {outside[0]}, expected 0 to {len(labels) - 1} in {folder_or_h5}"
            )
        node_offset = np.concatenate([[0], np.cumsum(np.diff(file.node_offset)[which])])
        cell_offset = np.concatenate([[0], np.cumsum(np.diff(file.cell_offset)[which])])
        file.check_room(node_offset[-1], cell_offset[-1])
        points = np.empty((node_offset[-1], 3))
        cells = np.empty((cell_offset[-1], 4), dtype=np.int64)
        for i, g in enumerate(which):
            nodes = slice(node_offset[i], node_offset[i + 1])
            part = slice(cell_offset[i], cell_offset[i + 1])
            points[nodes], cells[part] = file.grain(g)
            cells[part] += node_offset[i]
        return Grains(
            points, cells, labels[which], node_offset, cell_offset, file.element_size, file.box,
            file.cylinder,
        )  # fmt: skip


def read_grain_table(
    folder_or_h5: str | Path, compare: bool = True
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Labels, numbers of cells and nodes, and centroids [m] of all grains; no mesh is read.

    Args:
        folder_or_h5, compare: As of :func:`load_grains`.

    Raises:
        InputError: no such file, not a file of grains, or a damaged one.
    """
    with GrainFile(folder_or_h5, compare) as file:
        num_cells, num_nodes = np.diff(file.cell_offset), np.diff(file.node_offset)
        return file.labels, num_cells, num_nodes, file.centroids


def _one_line(error):
    return " ".join(str(error).split())


def _xdmf(num_nodes, num_cells):
    """The description through which ParaView finds the arrays of `grains.h5`."""
    return f"""<?xml version="1.0"?>
<Xdmf Version="3.0">
  <Domain>
    <Grid Name="grains" GridType="Uniform">
      <Geometry GeometryType="XYZ">
        <DataItem Dimensions="{num_nodes} 3" NumberType="Float" Precision="8" Format="HDF">\
grains.h5:/points</DataItem>
      </Geometry>
      <Topology TopologyType="Tetrahedron" NumberOfElements="{num_cells}" NodesPerElement="4">
        <DataItem Dimensions="{num_cells} 4" NumberType="Int" Precision="8" Format="HDF">\
grains.h5:/cells</DataItem>
      </Topology>
      <Attribute Name="label" AttributeType="Scalar" Center="Cell">
        <DataItem Dimensions="{num_cells}" NumberType="Int" Precision="4" Format="HDF">\
grains.h5:/cell_label</DataItem>
      </Attribute>
    </Grid>
  </Domain>
</Xdmf>
"""
