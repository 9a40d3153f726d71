"""A scene becomes a run folder."""

import json
import os
import time
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx import report
from mufe_fenicsx.analysis.checks import check_run, holds_from
from mufe_fenicsx.analysis.contact_resolution import contact_resolution
from mufe_fenicsx.errors import InputError, SolverError
from mufe_fenicsx.geometry.bodies.shapes import sphere
from mufe_fenicsx.geometry.grains import Grains, load_grains, save_grains
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.output.contacts import read_contacts, read_patches
from mufe_fenicsx.output.fields import read_state, read_states
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.output.run_folder import LOCK
from mufe_fenicsx.output.run_lock import RunLock
from mufe_fenicsx.run import recorder
from mufe_fenicsx.run import run as run_module
from mufe_fenicsx.run.from_scene import load_mesh, make_simulation
from mufe_fenicsx.run.preparation import Prepared
from mufe_fenicsx.run.recorder import Recorder
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import (
    Contact,
    MassScaling,
    Oedometer,
    Output,
    Sample,
    Scene,
    Solver,
    load_scene,
)
from tests.bodies import RADIUS, packed_grains


@pytest.fixture
def folder(tmp_path_factory):
    """A folder that all ranks share."""
    comm = MPI.COMM_WORLD
    return comm.bcast(tmp_path_factory.mktemp("run") if comm.rank == 0 else None)


@pytest.fixture
def grains(folder):
    """2 x 2 x 1 spheres, as `mufe mesh` would store them."""
    comm = MPI.COMM_WORLD
    if comm.rank == 0:
        save_grains(folder / "grains", packed_grains((2, 2, 1), h=0.7 * RADIUS))
    comm.Barrier()
    return folder / "grains"


def small_scene(**changes):
    values = dict(strain=0.01, speed=20.0, seating_stress=1e4)
    return Scene(
        material=J2(100e9, 0.15, 2650.0, ((0.0, 10e6), (0.05, 110e6))),
        contact=Contact(friction=0.23),
        oedometer=Oedometer(**(values | changes)),
        output=Output(fields=3, history=21),
    )


@pytest.mark.mpi
def test_every_rank_that_returns_finds_the_folder_free(folder, grains, monkeypatch):
    comm, free = MPI.COMM_WORLD, RunLock.free

    def late(self):
        time.sleep(0.2 if comm.rank == 0 else 0.0)
        free(self)

    monkeypatch.setattr(RunLock, "free", late)
    run_scene(small_scene(), grains, folder / "out", comm, quiet=True, max_steps=1)
    assert not (folder / "out" / LOCK).exists()


def test_grains_have_their_own_mass_and_centre_where_mass_is_added(folder, grains):
    """Those of the lumped masses before, whatever was added: volume by density."""
    scene = replace(small_scene(), mass_scaling=MassScaling(0.2), output=Output(2, 2, report=False))
    run_scene(scene, grains, folder / "out", MPI.COMM_SELF, quiet=True, max_steps=1)
    assert read_history(folder / "out" / "history.csv")["added_mass"][-1] > 0.1
    (_, table), bodies = read_contacts(folder / "out", 0), load_grains(grains)
    # A step at 20 m/s moves nothing by more than the separation did.
    assert table["mass"] == pytest.approx(2650.0 * bodies.volumes, rel=1e-3)


@pytest.mark.mpi
def test_run_writes_what_it_did(folder, grains):
    comm = MPI.COMM_WORLD
    out = folder / "out"
    result = run_scene(small_scene(), grains, out, comm, quiet=True, command=["mufe", "run"])
    assert result["finished"]
    history = read_history(out / "history.csv")
    loading = history["stage"] == "loading"
    # The last step may overshoot by what the platen moves in it.
    step = 20.0 * history["dt"].max() / history["height"][0]
    assert 0.01 <= history["strain"][-1] < 0.01 + 2 * step
    assert loading.sum() in (20, 21, 22)
    assert history["length_x"] * history["length_y"] == pytest.approx(result["area"], rel=1e-12)
    work = history["work"][-1]
    assert work > 0
    # The budget of the demonstration is 1 %; this sample is small and fast.
    assert abs(history["residual"][-1]) < 0.01 * work

    states = read_states(out)
    assert [state["stage"] for state in states] == ["loading"] * 3
    last = read_state(out, 2)
    assert last.n_cells == result["num_cells"]
    stress = last.cell_data["stress"]
    mean = stress[:, :3].mean(axis=1)
    assert np.allclose(mean, -last.cell_data["pressure"])
    deviator = stress.copy()
    deviator[:, :3] -= mean[:, None]
    mises = np.sqrt(1.5 * (deviator**2 * [1, 1, 1, 2, 2, 2]).sum(axis=1))
    assert np.allclose(mises, last.cell_data["von_mises"])
    contacts, grains = read_contacts(out, 2)
    # State and row of the last step hold the same numbers, added up in another order.
    assert contacts["friction_work"].sum() == pytest.approx(history["friction"][-1], rel=1e-9)
    top = contacts["normal_force"][contacts["wall"] == "z_max"].sum()
    assert top == pytest.approx(history["force_z_max"][-1], rel=1e-9)
    assert grains["num_active_contacts"].mean() == history["num_active_contacts"][-1]
    assert np.sum(contacts["num_points"] > 0) >= 4
    slip, gap = last.point_data["contact_slip"], last.point_data["contact_gap"]
    assert slip.max() > 0 and np.all((last.point_data["contact_pressure"] > 0) <= (gap < 0))
    assert load_scene(out / "scene.toml").oedometer == small_scene().oedometer
    summary = json.loads((out / "run.json").read_text())
    assert summary["num_ranks"] == comm.size
    assert summary["stress"] == history["stress"][-1] > 0  # that at the end
    patches, closed = read_patches(out, 2), contacts["num_points"] > 0
    assert patches["area"].sum() == pytest.approx(contacts["area"][closed].sum(), rel=1e-9)
    assert patches["num_points"].sum() == contacts["num_points"].sum()
    # The first yield stress, and what it has grown to.
    assert patches["yield_stress"].min() >= 10e6 and patches["yield_stress"].max() <= 110e6
    found, names = summary["contact_resolution"], ("elements_per_radius", "normal_force")
    between = patches["grain_b"] != 0
    kind = between if patches["normal_force"][between].sum() > 0 else ~between
    expected = contact_resolution(*(patches[name][kind] for name in names))
    assert found["half"] == history["elements_per_radius"][-1] == pytest.approx(expected.half)
    assert found["tenth"] == history["elements_per_radius_tenth"][-1] > 0
    checks = check_run(history, summary["mass"], (expected, "", summary["edges_per_diameter"]))
    found = holds_from(checks, history)  # few grains are no sample, of which no check speaks
    assert summary["holds_from"] == found == result["holds_from"]
    # Void ratios: that of the container, of all rows and of the ends of stages.
    size = np.array([history["length_x"][-1], history["length_y"][-1], history["height"][-1]])
    solid = size.prod() / (1 + summary["void_ratio"])
    assert solid == pytest.approx(summary["mass"] / small_scene().material.rho, rel=1e-9)
    assert summary["porosity"] == pytest.approx(1 - solid / size.prod(), rel=1e-9)
    assert summary["voids"][-1]["end"]["void_ratio"] == history["void_ratio"][-1]
    assert summary["added_mass"] == pytest.approx(0.0, abs=1e-12 * summary["mass"])


def test_a_scene_asks_for_a_report(folder, grains, monkeypatch):
    """When the test has ended, by rank 0 alone; what it cannot write is an error of all ranks."""
    comm, out = MPI.COMM_WORLD, folder / "out"
    drawn = []

    def draw(run, processes):
        drawn.append(json.loads((run / "run.json").read_text())["finished"])
        (run / "report.html").write_text("page")
        time.sleep(0.2)
        if len(drawn) == 2:
            raise InputError("report cannot be written")

    monkeypatch.setattr(report, "write_report", draw)
    scene = replace(small_scene(), output=Output(fields=2, history=3, report=True))
    result = run_scene(scene, grains, out, comm, quiet=True)
    assert (out / "report.html").read_text() == "page"  # on all ranks
    assert result["report"] == str(out / "report.html")
    assert drawn == ([True] if comm.rank == 0 else [])
    with pytest.raises(InputError, match="report cannot be written"):
        run_scene(scene, grains, out, comm, quiet=True, overwrite=True)
    cut = run_scene(scene, grains, folder / "cut", comm, quiet=True, max_steps=3)
    assert "report" not in cut and not (folder / "cut" / "report.html").exists()


def test_a_run_ends_with_one_row_of_its_last_step(folder, grains):
    """Whether a row of that step is due or not, and when the run is resumed to it."""
    comm, scene = MPI.COMM_WORLD, small_scene()

    def steps(max_steps, **more):
        run_scene(scene, grains, folder / "out", comm, quiet=True, max_steps=max_steps, **more)
        return read_history(folder / "out" / "history.csv")["step"].tolist()

    due = steps(60)[1]  # a step whose row is due
    assert 1 < due < 60
    for last in (due, due + 1):
        assert steps(last, overwrite=True) == [0, due, due + 1][: last - due + 2]
        assert steps(last, resume=True) == [0, due, due + 1][: last - due + 2]


def test_seating_that_never_ends_stops_with_what_it_has(folder, grains):
    out = folder / "out"
    with pytest.raises(SolverError, match="seating"):
        run_scene(
            small_scene(speed=100.0, seating_stress=1e12), grains, out, MPI.COMM_WORLD, quiet=True
        )
    assert "seating" in json.loads((out / "run.json").read_text())["stop_reason"]
    assert len(read_history(out / "history.csv")["step"]) > 1


def test_a_balance_that_does_not_close_stops_with_state_and_history(folder, grains):
    """No time step is that exact: the limit is far below what central differences conserve."""
    out, scene = folder / "out", small_scene()
    scene = replace(scene, solver=Solver(energy_limit=1e-9))
    expected = r"J (came from nowhere|went missing) at strain .* is in grain \d+, .* element \d+ "
    with pytest.raises(SolverError, match=expected):
        run_scene(scene, grains, out, MPI.COMM_WORLD, quiet=True)
    summary = json.loads((out / "run.json").read_text())
    assert "energy_limit = 1e-09" in summary["stop_reason"] and not summary["finished"]
    history, states = read_history(out / "history.csv"), read_states(out)
    assert abs(history["residual"][-1]) > 1e-9 * history["work"][-1]
    assert read_state(out, len(states) - 1).n_cells == summary["num_cells"]
    assert states[-1]["time"] == history["time"][-1]


def test_a_last_state_that_cannot_be_written_does_not_hide_the_first_error(
    folder, grains, monkeypatch
):
    """Of a motion that is not finite there is no state; the cause is told and kept."""

    def run_time_loop(simulation, *_):
        simulation.state.x[:] = simulation.state.v[:] = np.nan
        raise SolverError("the first error")

    monkeypatch.setattr(run_module, "run_time_loop", run_time_loop)
    with pytest.raises(SolverError, match="the first error"):
        run_scene(small_scene(), grains, folder / "out", MPI.COMM_WORLD, quiet=True)
    assert "the first error" in json.loads((folder / "out/run.json").read_text())["stop_reason"]


@pytest.mark.parametrize(("where", "name"), [(Recorder, "write_state"), (run_module, "judged")])
def test_a_failure_at_the_end_does_not_hide_the_first_error(tmp_path, monkeypatch, where, name):
    """Whatever it is."""
    save_grains(tmp_path / "grains", packed_grains((2, 1, 1), h=RADIUS))

    def fail(*_):
        raise KeyError("something else")

    def run_time_loop(*_):
        raise SolverError("the first error")

    monkeypatch.setattr(run_module, "run_time_loop", run_time_loop)
    monkeypatch.setattr(where, name, fail)
    with pytest.raises(SolverError, match="the first error"):
        run_scene(small_scene(), tmp_path / "grains", tmp_path / "out", MPI.COMM_SELF, quiet=True)
    assert "first error" in json.loads((tmp_path / "out/run.json").read_text())["stop_reason"]


def test_grains_that_lie_in_each_other_stop_a_run(tmp_path, monkeypatch):
    """With what was computed; here overlaps of any size are too many."""
    save_grains(tmp_path / "grains", packed_grains((2, 1, 1), h=RADIUS))
    monkeypatch.setattr(recorder, "MOST_OVERLAP", -1.0)
    with pytest.raises(SolverError, match=r"grains lie in each other by 0%.* at most -100%"):
        run_scene(small_scene(), tmp_path / "grains", tmp_path / "out", MPI.COMM_SELF, quiet=True)
    told = json.loads((tmp_path / "out/run.json").read_text())
    assert "lie in each other" in told["stop_reason"] and not told["finished"]
    assert len(read_history(tmp_path / "out/history.csv")["time"]) > 0


def test_what_begins_anew_has_the_walls_of_the_start(grains):
    """Their targets change in a test that holds its seating stress; they are found once."""
    prepared = Prepared.of(small_scene(), load_mesh(MPI.COMM_WORLD, grains))
    wall = make_simulation(small_scene(), prepared).walls.walls[0]
    wall.target = 1.0
    assert make_simulation(small_scene(), prepared).walls.walls[0].target is None


def test_unusable_folders_are_refused_together(folder, grains):
    comm = MPI.COMM_WORLD
    with pytest.raises(InputError, match="nowhere"):
        load_mesh(comm, folder / "nowhere")
    with pytest.raises(InputError, match="not empty"):
        run_scene(small_scene(), grains, grains, comm, quiet=True)


@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts with one rank's view of many")
def test_more_ranks_than_grains(grains):
    class Many:
        """A communicator that claims five ranks."""

        rank, size = 0, 5
        allgather = staticmethod(lambda value: [value])
        bcast = staticmethod(lambda value: value)

    with pytest.raises(InputError, match=r"number of ranks = 5, expected at most .* 4"):
        load_mesh(Many(), grains)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_unwritable_folder(folder, grains):
    folder.chmod(0o500)
    with pytest.raises(InputError, match="cannot"):
        run_scene(small_scene(), grains, folder / "out", MPI.COMM_WORLD, quiet=True)


@pytest.mark.mpi
def test_a_profile_changes_nothing_and_adds_up(folder, grains):
    """The same bits as without; every part is there once, and "other" is what is left."""
    comm = MPI.COMM_WORLD
    plain = run_scene(small_scene(), grains, folder / "a", comm, quiet=True, max_steps=60)
    timed = run_scene(
        small_scene(), grains, folder / "b", comm, quiet=True, max_steps=60, profile=True
    )
    assert timed["time"] == plain["time"] and "profile" not in plain
    last = [read_history(folder / run / "history.csv")["work"][-1] for run in ("a", "b")]
    assert last[0] == last[1]
    profile = timed["profile"]
    assert profile["steps"] == 60 and len(profile["ranks"]) == comm.size
    for rank in profile["ranks"]:
        seconds = rank["seconds"]
        # A part counted twice would leave less than nothing for the rest.
        assert min(seconds.values()) >= 0.0 and seconds["tets"] > 0.0 and seconds["other"] > 0.0
        assert (rank["bytes_per_step"] > 0) == (comm.size > 1)
    assert sum(rank["cells"] for rank in profile["ranks"]) == timed["num_cells"]
    table = read_history(folder / "b" / "profile.csv")
    assert table.pop("steps")[-1] == 60 and table.pop("strain")[-1] == timed["strain"]
    assert table.keys() == profile["ranks"][0]["seconds"].keys()
    assert all((np.diff(seconds) > -1e-6).all() for seconds in table.values())  # it has 9 digits


@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="two grains")
@pytest.mark.parametrize("case", ["coincident", "nested"])
def test_a_refusal_leaves_nothing_and_the_mended_scene_can_use_the_folder(tmp_path, case):
    """What only grains, contact and solver find out; an earlier run is not overwritten either."""
    comm, out = MPI.COMM_WORLD, tmp_path / "runs" / "out"
    points, cells = sphere(1e-3, 1e-3)
    other = points if case == "coincident" else 0.5 * points
    good = [(points, cells), (points + np.array([2e-3, 0, 0]), cells)]
    save_grains(tmp_path / "good", Grains.from_list([1, 2], good, 1e-3))
    save_grains(tmp_path / "bad", Grains.from_list([1, 2], [good[0], (other, cells)], 1e-3))
    bad = replace(small_scene(), sample=Sample(separation=case == "coincident"))
    with pytest.raises(InputError, match=r"inside grain 2|deep in grain 1"):
        run_scene(bad, tmp_path / "bad", out, comm, quiet=True)
    assert not out.parent.exists()
    assert run_scene(small_scene(), tmp_path / "good", out, comm, quiet=True, max_steps=2)
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=r"inside grain 2|deep in grain 1"):
        run_scene(bad, tmp_path / "bad", out, comm, quiet=True, overwrite=True)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_an_option_that_there_is_not_is_named(tmp_path):
    with pytest.raises(TypeError, match="option of a run = overwrit, expected one of overwrite, "):
        run_scene(small_scene(), tmp_path, tmp_path / "out", MPI.COMM_SELF, overwrit=True)
