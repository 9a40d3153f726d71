"""Files of a run: states, history, folder."""

import json
import os
import resource

import numpy as np
import pytest
import pyvista

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.machine.memory import peak_memory
from mufe_fenicsx.output import fields, history, run_folder
from mufe_fenicsx.output.run_lock import RunLock

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)

COMM = MPI.COMM_WORLD
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], float)
TWO_TETS = np.array([[0, 1, 2, 3], [1, 3, 2, 4]])


@pytest.fixture
def folder(tmp_path):
    """One folder for all ranks."""
    return COMM.bcast(tmp_path)


def rank_mesh(rank):
    """rank + 1 copies of two tets, so that the ranks differ in size."""
    copies = range(rank + 1)
    points = np.vstack([CORNERS + np.array([2 * i, 2 * rank, 0]) for i in copies]) * 1e-3 / 3
    cells = np.vstack([TWO_TETS + 5 * i for i in copies])
    return points, cells, np.repeat(100 * rank + np.arange(rank + 1), 2)


def rank_data(rank, index):
    points, cells, _ = rank_mesh(rank)
    rng = np.random.default_rng([rank, index])
    point = {
        "displacement": rng.normal(size=points.shape),
        "contact_pressure": rng.random(len(points)),
    }
    cell = {"stress": rng.normal(size=(len(cells), 6)), "von_mises": rng.random(len(cells))}
    return point, cell


def write_states(folder, num_states):
    writer = fields.FieldWriter(COMM, folder, *rank_mesh(COMM.rank))
    for index in range(num_states):
        writer.write(index, 0.1 * index, 0.01 * index, "loading", *rank_data(COMM.rank, index))
    return writer


@pytest.mark.mpi
def test_computed_values_end_where_a_rank_ends(folder):
    """What knows more rows than are asked for writes nothing into those of the next rank."""
    points, cells, labels = rank_mesh(COMM.rank)
    writer = fields.FieldWriter(COMM, folder, points, cells, labels)
    more = np.arange(len(cells) + 5.0) + 100 * COMM.rank
    values = fields.Computed((len(cells),), lambda rows: more[rows])
    writer.write(0, 0.0, 0.0, "loading", {}, {"pressure": values, "von_mises": values})
    COMM.barrier()
    expected = [np.arange(len(rank_mesh(r)[1])) + 100.0 * r for r in range(COMM.size)]
    found = fields.read_state(folder, 0)
    for name in ("pressure", "von_mises"):
        assert np.array_equal(found[name], np.concatenate(expected)), name
    COMM.barrier()


@pytest.mark.mpi
def test_state_returns_unchanged(folder):
    """What the ranks wrote is read back bit by bit, rank after rank."""
    write_states(folder, 2)
    COMM.barrier()
    meshes = [rank_mesh(r) for r in range(COMM.size)]
    data = [rank_data(r, 1) for r in range(COMM.size)]
    for grid in (fields.read_state(folder, 1), pyvista.read(folder / "fields/0001.vtkhdf")):
        assert isinstance(grid, pyvista.UnstructuredGrid)
        assert np.array_equal(grid.points, np.vstack([m[0] for m in meshes]))
        corners = grid.points[grid.cells_dict[fields.VTK_TETRA]]
        assert np.array_equal(corners, np.vstack([m[0][m[1]] for m in meshes]))
        assert np.array_equal(grid.cell_data["grain"], np.concatenate([m[2] for m in meshes]))
        for kind, found in ((0, grid.point_data), (1, grid.cell_data)):
            for name in data[0][kind]:
                assert np.array_equal(found[name], np.concatenate([d[kind][name] for d in data]))
        assert grid.field_data["TimeValue"][0] == 0.1
        assert grid.field_data["strain"][0] == 0.01
    COMM.barrier()


def test_series_lists_the_states(folder):
    write_states(folder, 3)
    COMM.barrier()
    series = json.loads((folder / "fields/states.vtkhdf.series").read_text())
    assert series["file-series-version"] == "1.0"
    assert [f["name"] for f in series["files"]] == ["0000.vtkhdf", "0001.vtkhdf", "0002.vtkhdf"]
    states = fields.read_states(folder)
    assert [s["index"] for s in states] == [0, 1, 2]
    assert states[2]["time"] == 0.2 and states[2]["stage"] == "loading"
    assert not list((folder / "fields").glob("*.part"))
    COMM.barrier()


@pytest.mark.mpi
def test_full_disk_stops_all_ranks(folder):
    """One rank that cannot write (a limit on file size stands for a full disk) stops all."""
    writer = write_states(folder, 1)
    COMM.barrier()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    if COMM.rank == COMM.size - 1:
        resource.setrlimit(resource.RLIMIT_FSIZE, (16, hard))
    try:
        with pytest.raises(InputError, match=r"0001\.vtkhdf cannot be written"):
            writer.write(1, 0.1, 0.01, "loading", *rank_data(COMM.rank, 1))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    COMM.barrier()
    assert {p.name for p in (folder / "fields").iterdir()} == {
        "mesh.h5",
        "0000.vtkhdf",
        "states.vtkhdf.series",
    }
    # The first state is untouched and the next one can be written.
    writer.write(1, 0.1, 0.01, "loading", *rank_data(COMM.rank, 1))
    assert len(fields.read_states(folder)) == 2
    COMM.barrier()


def test_wrong_shape_stops_all_ranks(folder):
    writer = write_states(folder, 0)
    point, cell = rank_data(COMM.rank, 0)
    if COMM.rank == 0:
        cell["von_mises"] = np.zeros(1)
    with pytest.raises(InputError, match="von_mises"):
        writer.write(0, 0.0, 0.0, "loading", point, cell)


def row(step, **values):
    """A row of the history whose numbers need all their digits."""
    numbers = {name: (step + 1) / 3 for name in history.COLUMNS}
    return {**numbers, "step": step, "stage": "loading, slow", **values}


def test_history_returns_unchanged(tmp_path):
    with history.HistoryWriter(tmp_path / "history.csv") as writer:
        for step in range(3):
            writer.append(row(step, num_contacts=np.int32(7), stress=np.float64(-1e-300)))
            assert len(history.read_history(tmp_path / "history.csv")["step"]) == step + 1
    found = history.read_history(tmp_path / "history.csv")
    assert tuple(found) == history.COLUMNS
    assert np.array_equal(found["work"], [1 / 3, 2 / 3, 1.0])
    assert found["stress"][0] == -1e-300
    assert found["num_contacts"].dtype == np.int64 and found["num_contacts"][2] == 7
    assert list(found["stage"]) == ["loading, slow"] * 3


@pytest.mark.parametrize("lost", [1, 2, 30])
def test_torn_last_line_is_left_out(tmp_path, lost):
    path = tmp_path / "history.csv"
    with history.HistoryWriter(path) as writer:
        for step in range(3):
            writer.append(row(step))
    path.write_bytes(path.read_bytes()[:-lost])
    assert np.array_equal(history.read_history(path)["step"], [0, 1])


def test_history_of_another_version_is_not_gone_on_with(tmp_path):
    """Rows of other columns would follow; the rows that are there stay."""
    path = tmp_path / "history.csv"
    with history.HistoryWriter(path, history.COLUMNS[:-2]) as writer:
        kept = writer.sync()
    before = path.read_bytes()
    with pytest.raises(InputError, match="columns are those of another version"):
        history.HistoryWriter(path, kept=kept)
    assert path.read_bytes() == before


def test_short_line_in_the_middle_is_refused(tmp_path):
    path = tmp_path / "history.csv"
    path.write_text("step,work\n0,1.0\n1\n2,3.0\n")
    with pytest.raises(InputError, match="line 3 has 1 values, expected 2"):
        history.read_history(path)


def test_history_names_a_wrong_column(tmp_path):
    with history.HistoryWriter(tmp_path / "history.csv") as writer:
        with pytest.raises(ValueError, match="wrok"):
            writer.append(row(0, wrok=1.0))


def test_run_folder_that_is_not_empty_is_refused(folder):
    run = folder / "a" / "run"
    lock = RunLock(COMM, run)

    def create(**options):
        made = run_folder.create_run_folder(COMM, run, lock, **options)
        lock.free()
        COMM.barrier()
        return made

    made = create()
    assert made == ([run, run.parent] if COMM.rank == 0 else [])
    assert create() == []
    if COMM.rank == 0:
        (run / "history.csv").write_text("old")
        (run / "thesis.tex").write_text("mine")
    COMM.barrier()
    for there, said in ((False, "new one, or --over"), (True, "new one, --resume to go on with")):
        if there and COMM.rank == 0:
            (run / "checkpoints" / "step-000000001").mkdir(parents=True)
        COMM.barrier()
        with pytest.raises(InputError, match=f"not empty, expected a {said}"):
            create()
    create(overwrite=True)
    assert [p.name for p in run.iterdir()] == ["thesis.tex"]
    COMM.barrier()


@pytest.mark.parametrize("where", ["fields", "checkpoints/step-000000001", "checkpoints"])
def test_nothing_outside_of_a_run_folder_is_deleted(tmp_path, where):
    """A part of it that leads elsewhere is refused; a file that does is removed as a link."""
    run, outside = tmp_path / "run", tmp_path / "outside"
    outside.mkdir()
    names = ["0000.vtkhdf", "rank-0000.h5", "step-000000002"]
    for name in names:
        (outside / name).write_text("precious")
    (run / where).parent.mkdir(parents=True)
    (run / where).symlink_to(outside)
    with pytest.raises(InputError, match=f"run/{where} is a symbolic link, expected a folder"):
        run_folder.check_run_folder(MPI.COMM_SELF, run, overwrite=True)
    (run / where).unlink()
    (run / "run.json").symlink_to(outside / names[0])
    lock = RunLock(MPI.COMM_SELF, run)
    run_folder.create_run_folder(MPI.COMM_SELF, run, lock, overwrite=True)
    lock.free()
    assert not (run / "run.json").is_symlink() and sorted(os.listdir(outside)) == names


@pytest.mark.parametrize("name", ["file", "file/run", "/proc/run"])
def test_run_folder_that_cannot_be_written_is_refused(folder, name):
    if COMM.rank == 0:
        (folder / "file").write_text("")
    COMM.barrier()
    lock = RunLock(COMM, folder / name)
    with pytest.raises(InputError, match="output folder"):
        run_folder.create_run_folder(COMM, folder / name, lock)


@pytest.mark.parametrize("name", ["=1+1", "+a", "-a", "@SUM(A1)", "'=b", "'plain", "a=b"])
def test_a_stage_is_no_formula_of_a_spreadsheet(tmp_path, name):
    """Quoted in the file where it would be one, and the name that it was when it is read."""
    with history.HistoryWriter(tmp_path / "h.csv") as writer:
        writer.append(row(1, stage=name))
    text = (tmp_path / "h.csv").read_text().splitlines()[1].split(",")[3]
    assert text[0] not in "=+-@"
    assert history.read_history(tmp_path / "h.csv")["stage"][0] == name


def test_run_json(tmp_path):
    run = {"num_cells": np.int64(3), "area": np.float64(0.1), "failed_grains": np.array([2, 5])}
    run_folder.write_run_json(tmp_path, run)
    found = run_folder.read_run_json(tmp_path)
    assert found == {"num_cells": 3, "area": 0.1, "failed_grains": [2, 5]}
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(InputError, match="JSON"):
        run_folder.read_run_json(tmp_path)


@pytest.mark.mpi
def test_peak_memory_counts_what_was_touched():
    before = peak_memory(COMM)
    block = np.ones(25_000_000)
    after = peak_memory(COMM)
    # The peak may have been higher before; it never falls.
    assert after >= before and after > block.nbytes * COMM.size


def test_versions_are_known():
    found = run_folder.versions()
    assert found["numpy"] == np.__version__
    assert "absent" not in found.values()
