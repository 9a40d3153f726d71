"""Stored states of a run as VTKHDF files, which ParaView and pyvista open.

The mesh is written once, to ``mesh.h5``; the file of a state holds its data and links to the
mesh. Rank 0 lays a file out (HDF5 reserves the room of each array), then every rank writes
its own rows into the reserved room at once: nothing is gathered and parallel HDF5 is
not needed. A file has its final name only when it is complete.

Format: VTK documentation, "VTKHDF file format", UnstructuredGrid, version 2.
"""

import json
import math
import os
from pathlib import Path

import h5py
import numpy as np

from mufe_fenicsx.errors import InputError, raise_together, shortened
from mufe_fenicsx.machine.files import (
    attempt,
    new_part,
    open_plain,
    own_folder,
    reason,
    regular,
    try_room,
    write_atomically,
)
from mufe_fenicsx.machine.ranks import on_first_rank
from mufe_fenicsx.output.quantities import describe_fields
from mufe_fenicsx.output.run_folder import remove_states_after

VTK_TETRA = 10
#: Rows that are computed and written at a time.
BLOCK = 1 << 15
MESH = "mesh.h5"
SERIES = "states.vtkhdf.series"
MESH_ARRAYS = (
    "NumberOfPoints",
    "NumberOfCells",
    "NumberOfConnectivityIds",
    "Points",
    "Connectivity",
    "Offsets",
    "Types",
    "CellData/grain",
)


class FieldWriter:
    """Writes the states of a run into the folder ``fields``. Collective, as its methods.

    The nodes and cells of rank 0 come first in the files, then those of rank 1, and so on.

    Args:
        comm: MPI communicator.
        folder: The run folder, which exists.
        points: Reference positions of this rank's nodes [m], shape (num_nodes, 3).
        cells: Local nodes of this rank's tetrahedra, shape (num_cells, 4).
        grain_of_cell: Label of each cell's grain, shape (num_cells,).
        kept: What :attr:`kept` was, where a run goes on: later states are removed.
        same_ranks: Whether it goes on on the ranks that wrote so far: the mesh is there.
        number: Of the next state, where it goes on.
        version: Of the mesh: stored states keep that of theirs.

    Raises:
        InputError: A file cannot be written; on all ranks together.
    """

    def __init__(
        self, comm, folder, points, cells, grain_of_cell, kept=None, same_ranks=True, number=0,
        version=0,
    ):  # fmt: skip
        self.comm = comm
        self.folder = Path(folder) / "fields"
        self._mesh, self._states, self.version = MESH, [], version
        self.wrote_mesh = False  #: whether the mesh is a new file
        message = None
        if kept is not None:
            self._mesh, self._states = kept["mesh"], list(kept["states"])
            if comm.rank == 0:
                message = remove_states_after(self.folder, self._states, "*.vtkhdf")
            raise_together(comm, message)
        if comm.rank == 0:
            try:
                own_folder(self.folder)
            except OSError as error:
                message = f"folder {self.folder} cannot be created ({reason(error)})"
        raise_together(comm, message)

        self._nodes = _Rows(comm, len(points))
        self._cells = _Rows(comm, len(cells))
        offsets = 4 * (self._cells.first + np.arange(1, len(cells) + 1, dtype=np.int64))
        offset_rows = _Rows(comm, len(cells) + (comm.rank == 0))
        if comm.rank == 0:
            offsets = np.append(0, offsets)
        num_nodes, num_cells = self._nodes.total, self._cells.total
        if kept is not None:
            same = same_ranks and kept.get("version", 0) == version
            if same and not kept.get("mesh_is_gone"):
                return
            # Other ranks have nodes and cells in another order: stored states keep their mesh.
            self._mesh = f"mesh_{number:04d}.h5"
        self.wrote_mesh = True
        self._write_file(
            self._mesh,
            [
                ("Points", np.asarray(points, np.float64), self._nodes),
                (
                    "Connectivity",
                    (np.asarray(cells, np.int64) + self._nodes.first).ravel(),
                    _Rows(comm, 4 * len(cells)),
                ),
                ("Offsets", offsets, offset_rows),
                ("Types", np.full(len(cells), VTK_TETRA, np.uint8), self._cells),
                ("CellData/grain", np.asarray(grain_of_cell, np.int32), self._cells),
            ],
            {
                "NumberOfPoints": [num_nodes],
                "NumberOfCells": [num_cells],
                "NumberOfConnectivityIds": [4 * num_cells],
            },
            links=(),
        )

    @property
    def mesh(self):
        """Name of the file of the mesh."""
        return self._mesh

    @property
    def kept(self):
        """What a writer that goes on from here has to know, fit for JSON."""
        return {"mesh": self._mesh, "states": list(self._states), "version": self.version}

    def write(self, index, time, strain, stage, point_data, cell_data):
        """Write one state and list it in the series.

        Args:
            index: Number of the state, which names its file.
            time: Time [s].
            strain: Strain [-].
            stage: Name of the stage.
            point_data: dict name -> values at this rank's nodes, an array or :class:`Computed` of
                shape (num_nodes,) or (num_nodes, k); the same names and order on every rank.
            cell_data: dict name -> values of this rank's cells; ``grain`` is already known.

        Raises:
            InputError: The file cannot be written; on all ranks together.
        """
        arrays = [(f"PointData/{k}", v, self._nodes) for k, v in point_data.items()]
        arrays += [(f"CellData/{k}", v, self._cells) for k, v in cell_data.items() if k != "grain"]
        arrays = [(k, v if isinstance(v, Computed) else np.asarray(v), r) for k, v, r in arrays]
        time, strain = float(time), float(strain)
        small = {"FieldData/TimeValue": [time], "FieldData/strain": [strain]}
        name = f"{index:04d}.vtkhdf"
        self._write_file(name, arrays, small, links=MESH_ARRAYS)

        self._states = [state for state in self._states if state["name"] != name]
        self._states.append({"name": name, "time": time, "strain": strain, "stage": str(stage)})
        self._states.sort(key=lambda state: state["name"])
        series = json.dumps({"file-series-version": "1.0", "files": self._states}, indent=1)
        on_first_rank(self.comm, lambda: write_atomically(self.folder / SERIES, series + "\n"))

    def _write_file(self, name, arrays, small, links):
        """Write arrays [(name, values, rows)] of all ranks, and small ones of rank 0."""
        path = self.folder / name
        message = _wrong_shape(arrays)
        raise_together(self.comm, message)

        part, layout = None, None
        if self.comm.rank == 0:
            size = sum(r.total * v.itemsize * math.prod(v.shape[1:]) for _, v, r in arrays)
            message, part = attempt(path, lambda: new_part(path))
            if message is None:
                message, _ = attempt(path, lambda: try_room(part, size))
            if message is None:
                message, layout = attempt(
                    path, lambda: _lay_out(part, arrays, small, self._mesh, links)
                )
        self._raise_together(message, part)
        part, layout = self.comm.bcast((part, layout))
        message, _ = attempt(path, lambda: _write_rows(part, arrays, layout))
        self._raise_together(message, part)
        if self.comm.rank == 0:
            message, _ = attempt(path, lambda: os.replace(part, path))
        self._raise_together(message, part)

    def _raise_together(self, message, part):
        """Raise on all ranks if any has a message, after removing the incomplete file."""
        try:
            raise_together(self.comm, message)
        except InputError:
            if part is not None and self.comm.rank == 0:
                part.unlink(missing_ok=True)
            raise


class Computed:
    """Values that exist some rows at a time: a state of a large mesh has no room for all.

    Args:
        shape: Of all values of this rank.
        of: ``of(rows)`` gives those of a slice of rows, float64.
    """

    dtype = np.dtype(np.float64)

    def __init__(self, shape, of):
        self.shape, self._of = shape, of

    ndim = property(lambda self: len(self.shape))
    itemsize = dtype.itemsize

    def __getitem__(self, rows):
        # As of an array: none beyond the last, though ``of`` may know more.
        first, last, _ = rows.indices(self.shape[0])
        return self._of(slice(first, last))


class _Rows:
    """Where this rank's rows stand among those of all ranks. Collective."""

    def __init__(self, comm, count):
        counts = comm.allgather(int(count))
        self.count = int(count)
        self.first = sum(counts[: comm.rank])
        self.total = sum(counts)


def _wrong_shape(arrays):
    """What is wrong with the first array that has not one row a node or cell, or None."""
    for name, values, rows in arrays:
        if values.ndim == 0 or values.shape[0] != rows.count or values.ndim > 2:
            return f"shape of field {name} = {values.shape}, expected {rows.count} rows"
    return None


def _lay_out(path, arrays, small, mesh, links):
    """Create the file; the byte where each array starts. On rank 0."""
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plist.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    plist.set_obj_track_times(False)  # the same state gives the same bytes at any time
    layout = []
    with h5py.File(path, "w") as file:
        group = file.create_group("VTKHDF")
        group.attrs["Version"] = np.array([2, 0], dtype=np.int64)
        group.attrs.create("Type", "UnstructuredGrid", dtype=h5py.string_dtype("ascii", 16))
        for folder in ("PointData", "CellData", "FieldData"):
            group.create_group(folder)
        for name in links:
            group[name] = h5py.ExternalLink(mesh, f"/VTKHDF/{name}")
        for name, values in small.items():
            group[name] = np.asarray(values)
        for name, values, rows in arrays:
            dataset = h5py.h5d.create(
                group.id,
                name.encode(),
                h5py.h5t.py_create(values.dtype),
                h5py.h5s.create_simple((rows.total, *values.shape[1:])),
                plist,
            )
            layout.append(dataset.get_offset())
        described = [name for name, *_ in arrays if "Data/" in name]
        if described:
            describe_fields(group, described)
    return layout


def _write_rows(path, arrays, layout):
    """Write this rank's rows into the room that the file reserves for them."""
    file = open_plain(path, os.O_WRONLY)
    try:
        for (_, values, rows), start in zip(arrays, layout, strict=True):
            at = start + rows.first * values.itemsize * math.prod(values.shape[1:])
            for first in range(0, rows.count, BLOCK):
                block = np.ascontiguousarray(values[first : first + BLOCK], values.dtype)
                data = memoryview(block).cast("B")
                while data:
                    written = os.pwrite(file, data, at)
                    data, at = data[written:], at + written
        os.fsync(file)
    finally:
        os.close(file)


def read_states(run_folder):
    """The stored states of a run, in order.

    Returns:
        List of dicts name, time [s], strain, stage, index (of :func:`read_state`).
        Empty if nothing was stored.

    Raises:
        InputError: The list of states is damaged.
    """
    path = Path(run_folder) / "fields" / SERIES
    if not path.exists():
        return []
    try:
        files = json.loads(regular(path).read_text(encoding="utf-8"))["files"]
        found = [dict(state, index=int(Path(state["name"]).stem)) for state in files]
        for state in found:
            times = float(state["time"]), float(state["strain"])
            if not (all(map(math.isfinite, times)) and isinstance(state["stage"], str)):
                raise ValueError(f"{state['name']} has no time, strain or stage")
        numbers = [state["index"] for state in found]
        if numbers != sorted(set(numbers)) or min(numbers, default=0) < 0:
            raise ValueError("the states are not in order")
        return found
    except (OSError, ValueError, KeyError, TypeError, RecursionError, OverflowError) as error:
        raise InputError(f"{path} is not a list of states ({shortened(error)})") from error


def read_arrays(run_folder, index, names=None):
    """Arrays of one stored state, only those asked for, without VTK.

    Args:
        run_folder: The run folder.
        index: Number of the state, or the name of a file beside the states, as :data:`MESH`.
        names: As "Points", "Connectivity", "PointData/displacement", "CellData/stress"; None:
            all names that there are, and no array.

    Returns:
        dict name -> array; with ``names`` None a dict name -> shape.

    Raises:
        InputError: The state or an array is absent or cannot be read.
    """
    name = index if isinstance(index, str) else f"{index:04d}.vtkhdf"
    path = Path(run_folder) / "fields" / name
    try:
        with h5py.File(regular(path), "r") as file:
            group = file["VTKHDF"]
            if names is None:
                found = {k: group[k] for k in ("Points", "Connectivity")}
                for folder in ("PointData", "CellData", "FieldData"):
                    found |= {f"{folder}/{k}": v for k, v in group[folder].items()}
                return {k: v.shape for k, v in found.items()}
            return {name: group[name][:] for name in names}
    except (OSError, KeyError, ValueError, AttributeError, TypeError, RuntimeError) as error:
        raise InputError(f"state {path} cannot be read ({reason(error)})") from error


def read_state(run_folder, index):
    """One stored state with the nodes at their reference positions.

    Args:
        run_folder: The run folder.
        index: Number of the state.

    Returns:
        pyvista.UnstructuredGrid.

    Raises:
        InputError: It is absent or cannot be read.
    """
    import pyvista

    path = Path(run_folder) / "fields" / f"{index:04d}.vtkhdf"
    try:
        with h5py.File(regular(path), "r") as file:
            group = file["VTKHDF"]
            cells = group["Connectivity"][:].reshape(-1, 4)
            points = group["Points"][:]
            grid = pyvista.UnstructuredGrid({VTK_TETRA: cells}, points)
            for target, name in (
                (grid.point_data, "PointData"),
                (grid.cell_data, "CellData"),
                (grid.field_data, "FieldData"),
            ):
                for key, dataset in group[name].items():
                    text = h5py.check_string_dtype(dataset.dtype) is not None
                    target[key] = dataset.asstr()[:] if text else dataset[:]
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"state {path} cannot be read ({reason(error)})") from error
    return grid
