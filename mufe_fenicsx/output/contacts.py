"""The contact network of the stored states: three tables and a picture for each.

In the folder ``contacts``, numbered as the states in ``fields``:

- ``contacts_0003.csv``: a row for each pair of grains, or grain and wall, that touch or whose
  friction did work before; the columns of :data:`CONTACT_COLUMNS`. Pieces of one grain that touch
  have a row with that grain twice, which `Run.contacts` leaves out unless they are asked for;
- ``grains_0003.csv``: a row for each grain; the columns of :data:`GRAIN_COLUMNS`;
- ``patches_0003.csv``: a row for each patch of contact, of which two grains may have several; the
  columns of :data:`PATCH_COLUMNS`;
- ``0003.vtkhdf`` and ``states.vtkhdf.series``: active contacts as lines from centre to centre
  (or from the wall to the centre) with what they carry as data, for ParaView.

``pandas.read_csv`` opens the tables. SI units; sign conventions of
:mod:`mufe_fenicsx.contact.results.network`: vectors are those on ``grain_a`` from ``grain_b``.

Format of the lines: VTK documentation, "VTKHDF file format", PolyData, version 2.
"""

import csv
import io
import json
from pathlib import Path

import h5py
import numpy as np

from mufe_fenicsx.container import WALLS
from mufe_fenicsx.errors import InputError, raise_together
from mufe_fenicsx.machine.files import own_folder, reason, replacing, write_atomically
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.output.quantities import describe_fields
from mufe_fenicsx.output.run_folder import read_run_json, remove_states_after

SERIES = "states.vtkhdf.series"


def _vector(name):
    return tuple(f"{name}_{axis}" for axis in "xyz")


CONTACT_COLUMNS = (
    "grain_a",  # label
    "grain_b",  # label; 0 for a wall
    "wall",  # name of the wall; empty between grains
    "num_points",  # with pressure > 0 on both sides, and crossings of edges; 0: contact is open
    "area",  # [m²], in the reference configuration
    "area_deformed",  # the same facets as they are now [m²]
    *_vector("normal"),  # mean over the area, from b to a
    *_vector("centroid"),  # of the area [m]
    *_vector("branch"),  # from the centre of b (or the centroid on the wall) to that of a [m]
    *_vector("force"),  # [N]
    "normal_force",  # along the mean normal, compression positive [N]
    *_vector("shear"),  # force less its part along the mean normal [N]
    *_vector("friction"),  # sum of the friction at points and crossings [N]
    *_vector("torque"),  # about the centroid [N m]
    "friction_work",  # dissipated so far, in springs let go at sharp edges too [J]
)

GRAIN_COLUMNS = (
    "grain",  # label
    "mass",  # [kg], with what mass scaling added
    *_vector("center"),  # of mass [m]
    "num_active_contacts",  # neighbours that press on it, N_cA of Nadimi & Fonseca (2018)
    "num_active_walls",  # walls that press on it
    "contact_area",  # with neighbours and walls [m²]
    *_vector("force"),  # of all contacts and walls: mass times acceleration [N]
    "friction_work",  # half of that with neighbours, all of that with walls [J]
    "num_fragments",  # pieces that it is in
)

PATCH_COLUMNS = (
    *("grain_a", "grain_b", "wall"),  # as of contacts
    "num_points",  # closed ones of both sides, and crossings of edges
    "area",  # [m²], in the reference configuration
    "area_deformed",  # the same facets as they are now [m²]
    "edge",  # h: mean edge of the facets there [m]
    "elements_per_radius",  # a/h, a = √(area/π)
    "elements_across",  # where the patch is narrowest
    "normal_force",  # sum of those at its points [N]
    "force_share",  # of all patches between grains, of all with walls, or of all within grains
    "overlap",  # volume within both bodies [m³]
    "yield_stress",  # reached in the elements there [Pa], of the softer side; 0: none yields
)
#: Those that runs of earlier versions lack.
NEWER_PATCH_COLUMNS = ("overlap",)


class ContactWriter:
    """Writes the network of stored states into the folder ``contacts``. Collective.

    Args:
        comm: MPI communicator; rank 0 writes.
        folder: The run folder, which exists.
        kept: What :attr:`kept` was, where a run goes on: later states are removed.

    Raises:
        InputError: The folder cannot be made; on all ranks together.
    """

    def __init__(self, comm, folder, kept=()):
        self.comm = comm
        self.folder = Path(folder) / "contacts"
        self._states = list(kept)
        self._on_first_rank(lambda: own_folder(self.folder))
        message = None
        if comm.rank == 0:
            message = remove_states_after(self.folder, self._states, "*.vtkhdf", "*.csv")
        raise_together(comm, message)

    @property
    def kept(self):
        """What a writer that goes on from here has to know, fit for JSON."""
        return list(self._states)

    def write(self, index, time, network):
        """Write one state.

        Args:
            index: Its number.
            time: Time [s].
            network: :class:`~mufe_fenicsx.contact.results.network.Network` on rank 0.

        Raises:
            InputError: It cannot be written; on all ranks together.
        """
        self._on_first_rank(lambda: self._write(index, float(time), network))

    def _on_first_rank(self, action):
        message = None
        if self.comm.rank == 0:
            try:
                action()
            except InputError as error:
                message = str(error)
            except (OSError, RuntimeError) as error:  # HDF5 raises either
                message = f"{self.folder} cannot be written ({reason(error)})"
        raise_together(self.comm, message)

    def _write(self, index, time, network):
        tables = (
            ("contacts", CONTACT_COLUMNS, contact_rows(network)),
            ("grains", GRAIN_COLUMNS, grain_rows(network)),
            ("patches", PATCH_COLUMNS, patch_rows(network)),
        )
        for name, columns, rows in tables:
            text = io.StringIO()
            table = csv.writer(text, lineterminator="\n")
            table.writerow(columns)
            table.writerows(rows)
            write_atomically(self.folder / f"{name}_{index:04d}.csv", text.getvalue())
        name = f"{index:04d}.vtkhdf"
        write_lines(self.folder / name, time, network)
        self._states = [state for state in self._states if state["name"] != name]
        self._states.append({"name": name, "time": time})
        series = {"file-series-version": "1.0", "files": self._states}
        write_atomically(self.folder / SERIES, json.dumps(series, indent=1) + "\n")


def _bodies(network, a, b):
    """Columns grain_a, grain_b and wall."""
    labels = np.append(network.labels, np.zeros(len(network.walls), network.labels.dtype))
    walls = [""] * network.labels.size + network.walls
    return network.labels[a], labels[b], [walls[k] for k in b]


def patch_rows(network):
    """Rows of the table of patches, as Python numbers and text."""
    p = network.patches
    columns = [
        *_bodies(network, p.a, p.b),
        p.num_points,
        p.area,
        p.area_deformed,
        p.edge,
        p.elements_per_radius,
        p.elements_across,
        p.normal_force,
        p.force_share,
        p.overlap,
        np.where(np.isfinite(p.yield_stress), p.yield_stress, 0.0),
    ]
    return _rows(columns)


def contact_rows(network):
    """Rows of the table of contacts, as Python numbers and text."""
    c = network.contacts
    columns = [
        *_bodies(network, c.a, c.b),
        c.num_points,
        c.area,
        c.area_deformed,
        *c.normal.T,
        *c.centroid.T,
        *c.branch.T,
        *c.force.T,
        c.normal_force,
        *c.shear_force.T,
        *c.friction.T,
        *c.torque.T,
        c.work,
    ]
    return _rows(columns)


def grain_rows(network):
    """Rows of the table of grains, as Python numbers."""
    c = network.contacts
    half = np.where(c.b < network.labels.size, 0.5 * c.work, c.work)
    area = np.where(c.within, 0.0, c.area)
    columns = [
        network.labels,
        network.mass,
        *network.centre.T,
        network.num_active(),
        network.num_active(walls=True),
        network.sum_over_contacts(area, area),
        *network.sum_over_contacts(c.force, -c.force).T,
        network.sum_over_contacts(half, half),
        network.num_fragments,
    ]
    return _rows(columns)


def _rows(columns):
    # As lists: Python writes numbers with as many digits as it takes to read them back.
    return zip(*(c if isinstance(c, list) else c.tolist() for c in columns), strict=True)


def write_lines(path, time, network):
    """Write the active contacts as lines, a VTKHDF file of type PolyData.

    Points are the centres of all grains, then the centroids on walls.
    """
    c, n = network.contacts, network.labels.size
    on = np.flatnonzero(c.active & ~c.within)
    at_wall = c.b[on] >= n
    to = c.b[on].copy()
    to[at_wall] = n + np.arange(at_wall.sum())
    lines = np.column_stack([c.a[on], to])
    points = np.concatenate([network.centre, c.centroid[on][at_wall]])
    on_walls = np.zeros(points.shape[0] - n, dtype=np.int64)
    data = {
        "area": c.area[on],
        "force": c.force[on],
        "friction_work": c.work[on],
        "normal": c.normal[on],
        "normal_force": c.normal_force[on],
        "shear_force": np.linalg.norm(c.shear_force[on], axis=1),
        "torque": c.torque[on],
        "wall": at_wall.astype(np.int8),
    }
    at_points = {
        "grain": np.append(network.labels, on_walls).astype(np.int64),
        "num_active_contacts": np.append(network.num_active(), on_walls),
    }
    write_poly_data(path, time, points, {"Lines": lines}, data, at_points)


def write_poly_data(path, time, points, cells, cell_data, point_data):
    """Write a VTKHDF file of type PolyData; it has its name only when it is complete.

    Args:
        path: The file.
        time: Time [s].
        points: [m], shape (num_points, 3).
        cells: "Lines" or "Polygons" -> points of each, shape (num_cells, k).
        cell_data, point_data: Name -> values, a row a cell or point.
    """
    with replacing(path) as part, h5py.File(part, "w") as file:
        group = file.create_group("VTKHDF")
        group.attrs["Version"] = np.array([2, 0], dtype=np.int64)
        group.attrs.create("Type", "PolyData", dtype=h5py.string_dtype("ascii", 8))
        group["NumberOfPoints"] = [points.shape[0]]
        group["Points"] = points
        for kind in ("Vertices", "Lines", "Polygons", "Strips"):
            of = cells.get(kind, np.empty((0, 2), np.int64))
            listed = group.create_group(kind)
            listed["NumberOfCells"] = [len(of)]
            listed["NumberOfConnectivityIds"] = [of.size]
            listed["Connectivity"] = of.ravel().astype(np.int64)
            listed["Offsets"] = of.shape[1] * np.arange(len(of) + 1, dtype=np.int64)
        for name, values in cell_data.items():
            group[f"CellData/{name}"] = values
        for name, values in point_data.items():
            group[f"PointData/{name}"] = values
        group["FieldData/TimeValue"] = [time]
        names = [f"CellData/{name}" for name in cell_data]
        describe_fields(group, names + [f"PointData/{name}" for name in point_data])


def tool_names(run_folder):
    """Names of the tools of a run, which tables of contacts list among the walls.

    Raises:
        InputError: run.json cannot be read.
    """
    path = Path(run_folder) / "run.json"
    if not path.is_file():
        return ()
    return tuple(str(tool["name"]) for tool in read_run_json(run_folder).get("tools", ()))


def contact_files(run_folder, index):
    """Paths of the tables of contacts and of grains of one stored state."""
    folder = Path(run_folder) / "contacts"
    return [folder / f"{name}_{index:04d}.csv" for name in ("contacts", "grains")]


def read_patches(run_folder, index):
    """The table of patches of one stored state, dict column -> array.

    Raises:
        InputError: There is none, as in runs of earlier versions, or it cannot be read.
    """
    path = Path(run_folder) / "contacts" / f"patches_{index:04d}.csv"
    patches = read_history(path)
    absent = [name for name in PATCH_COLUMNS if name not in {*patches, *NEWER_PATCH_COLUMNS}]
    if absent:
        raise InputError(f"{path} has no column {', '.join(absent)}")
    _check(path, patches, PATCH_COLUMNS, ("grain_a", "grain_b", "num_points"), "wall")
    return patches


def read_contacts(run_folder, index):
    """The tables of contacts and of grains of one stored state.

    Returns:
        Two dicts column -> array; no network of that state: two empty ones.

    Raises:
        InputError: A table cannot be read.
    """
    paths = contact_files(run_folder, index)
    if not all(path.exists() for path in paths):
        return {}, {}
    contacts, grains = (read_history(path) for path in paths)
    _check(paths[0], contacts, CONTACT_COLUMNS, ("grain_a", "grain_b", "num_points"), "wall")
    _check(paths[1], grains, GRAIN_COLUMNS, ("grain", "num_active_contacts", "num_active_walls"))
    labels = grains["grain"]
    if labels.size and (np.any(np.diff(labels) <= 0) or labels[0] <= 0):
        raise InputError(f"{paths[1]} has labels out of order, expected each once, increasing")
    wall = contacts["wall"] != ""
    for name, needed in (("grain_a", slice(None)), ("grain_b", ~wall)):
        if not np.isin(contacts[name][needed], labels).all():
            raise InputError(f"{paths[0]} has a {name} that {paths[1].name} has not")
    known = (*WALLS, *tool_names(run_folder))
    if not np.isin(contacts["wall"][wall], known).all() or contacts["grain_b"][wall].any():
        raise InputError(f"{paths[0]} has a wall that is none, expected {', '.join(known)}")
    return contacts, grains


#: Columns that a contact which has opened lacks: it has no place any more.
PLACES = ("centroid_", "branch_")


def _check(path, table, columns, whole, *texts):
    """Raise InputError unless a table has those columns that are there of their kind."""
    absent = [name for name in (*whole, *texts) if name not in table]
    if absent:
        raise InputError(f"{path} has no column {', '.join(absent)}")
    for name in columns:
        values = table.get(name)
        if values is None or name in texts or not len(values):
            continue
        if values.dtype.kind not in ("iu" if name in whole else "iuf"):
            raise InputError(f"{path} has a {name} that is no number, expected finite ones")
        wrong = ~np.isfinite(values)
        if name.startswith(PLACES):
            wrong &= table["num_points"] != 0
        if wrong.any():
            raise InputError(
                f"fault: {path.name} has {wrong.sum()} values that are not numbers, the first of "
                f"column {name} in line {int(wrong.argmax()) + 2}"
            )
