"""`mufe run` of a scene whose grains break."""

import csv
import json
import random
import re
import shutil
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import pyvista
from mpi4py import MPI

from mufe_fenicsx.analysis import energy_check
from mufe_fenicsx.cli.summary_words import breakage_line
from mufe_fenicsx.errors import InputError, UnstableError
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.kernels.cracks.cracks import ENERGIES
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.fracture import Fracture
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.output.contacts import read_contacts
from mufe_fenicsx.output.fields import SERIES, read_state, read_states
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.output.run_folder import read_run_json
from mufe_fenicsx.report import breakage, style, write_report
from mufe_fenicsx.report.paraview import write_paraview
from mufe_fenicsx.report.source import Source
from mufe_fenicsx.report.style import number
from mufe_fenicsx.results import Run
from mufe_fenicsx.run.recorder import Recorder
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import (
    Contact,
    MassScaling,
    Oedometer,
    Output,
    Scene,
    Solver,
    load_scene,
    scene_to_toml,
)
from mufe_fenicsx.verification.case import on_first_ranks
from tests.bodies import RADIUS, packed_grains
from tests.checkpoints import arrays
from tests.report.test_report_axes import legends_beside_axes
from tests.run.test_checkpoint import files, kill_and_resume, start

COMM = MPI.COMM_WORLD
SCENE = Scene(
    material=Elastic(10e9, 0.2, 2650.0),
    contact=Contact(friction=0.4),
    oedometer=Oedometer(strain=0.004, speed=30.0, ramp=0.002, seating_stress=1e4),
    output=Output(fields=3, history=21),
    fracture=Fracture(50e6, 60.0, modulus=6.0, seed=1),
)


def run(folder, name, scene=SCENE, **options):
    return run_scene(scene, folder / "grains", folder / name, COMM, quiet=True, **options)


@pytest.fixture(scope="module")
def broken(tmp_path_factory):
    """A folder with a run of three balls one on the other that break, and the same in two parts."""
    path = COMM.bcast(tmp_path_factory.mktemp("broken") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        save_grains(path / "grains", packed_grains((1, 1, 3), h=0.7 * RADIUS))
    COMM.Barrier()
    run(path, "whole")
    steps = int(read_history(path / "whole" / "history.csv")["step"][-1])
    run(path, "parts", max_steps=3 * steps // 4)
    run(path, "parts", resume=True)
    return path


@pytest.mark.mpi
def test_a_resumed_run_breaks_on_with_the_same_bytes(broken):
    whole, parts = files(broken / "whole"), files(broken / "parts")
    assert whole.keys() == parts.keys() and "events.csv" in whole
    assert not [name for name in whole if whole[name] != parts[name]]
    edges = [read_run_json(broken / name)["edges_per_diameter"] for name in ("whole", "parts")]
    assert edges[0] == edges[1]  # of the first mesh
    assert arrays(broken / "whole") == arrays(broken / "parts")


@pytest.mark.mpi
def test_mass_is_left_for_cracks(broken):
    scene = replace(SCENE, mass_scaling=MassScaling(0.2))
    run(broken, "scaled", scene)
    history = read_history(broken / "scaled" / "history.csv")
    whole = history["num_opened"] == 0
    assert (history["added_mass"][whole] == 0.0).all() and history["added_mass"][-1] > 0.0


@pytest.mark.mpi
def test_events_and_energies_tell_of_the_same_cracks(broken):
    with (broken / "whole" / "events.csv").open() as file:
        events = list(csv.DictReader(file))
    history = read_history(broken / "whole" / "history.csv")
    stages = {stage["name"] for stage in read_run_json(broken / "whole")["stages"]}
    assert {e["stage"] for e in events} <= stages
    assert len(events) > 3 and {e["grain"] for e in events} <= {"1", "2", "3"}
    taken = sum(float(e["energy"]) for e in events)
    assert taken == pytest.approx(SCENE.fracture.energy * sum(float(e["area"]) for e in events))
    fracture = history["cracks_fracture"]
    assert 0.0 < fracture[-1] <= taken
    parts = [history[f"cracks_{name}"] for name in ENERGIES]
    stored, *lost, begun = parts
    assert (stored >= 0.0).all() and (begun <= 0.0).all()
    # What is lost stays so, where pieces part too; the dashpot's trapezoids may turn back a little.
    assert all((np.diff(of) > -1e-9 * fracture[-1]).all() for of in lost)
    assert sum(parts) == pytest.approx(history["energy_cracks"], abs=1e-9 * fracture[-1])
    assert np.abs(history["residual"]).max() < 2e-3 * history["work"].max()
    # The columns close it too, but for what changes of the time step do to the kinetic energy.
    of_columns = np.abs(energy_check.residual(history) - history["residual"]).max()
    assert 0.0 < of_columns < 1e-3 * history["work"].max() < np.abs(history["parting"]).max()


@pytest.mark.mpi
def test_pieces_are_in_fields_tables_and_the_history(broken):
    folder, history = broken / "whole", read_history(broken / "whole" / "history.csv")
    state = read_state(folder, read_states(folder)[-1]["index"])
    grain, piece = state.cell_data["grain"], state.cell_data["fragment"]
    pieces = [np.unique(piece[grain == k]) for k in (1, 2, 3)]
    assert all(np.array_equal(of, np.arange(of.size)) for of in pieces)
    # A piece shares no node with another one.
    cells = state.cells.reshape(-1, 5)[:, 1:]
    of_node = np.full(state.n_points, -1)
    of_node[cells] = (4 * piece + grain)[:, None]
    assert np.array_equal(of_node[cells], np.repeat(4 * piece + grain, 4).reshape(-1, 4))
    numbers = read_contacts(folder, read_states(folder)[-1]["index"])[1]["num_fragments"]
    assert numbers.tolist() == [of.size for of in pieces] and max(numbers) > 2
    several = numbers[numbers > 1]
    assert history["num_fragments"][-1] == several.sum() > history["num_fragments"][0] == 0
    assert history["broken_grains"][-1] == several.size
    opened, failed = history["opened_area"], history["failed_area"]
    run, spent, ulps = Run(folder), SCENE.fracture.energy * failed, 1e-12
    assert run.events["area"].sum() == pytest.approx(opened[-1]) and opened[-1] > failed[-1] > 0.0
    assert (spent <= history["cracks_fracture"] * (1.0 + ulps)).all()
    assert (np.diff(failed) >= -ulps * failed[-1]).all()
    assert state.cell_data["crack"].max() == 1.0 and 0.0 <= state.cell_data["crack"].min()
    breaks = read_run_json(folder)["breakage"]
    assert breaks["failed_area"] == failed[-1] and breaks["num_opened"] == history["num_opened"][-1]
    # Drawn by Weibull's law: the median of each grain's is near that of all, (ln 2)^(1/m) σ.
    drawn = run.strengths
    assert drawn["grain"].tolist() == [1, 2, 3] and (drawn["least"] < drawn["median"]).all()
    median = SCENE.fracture.strength * np.log(2.0) ** (1.0 / SCENE.fracture.modulus)
    assert drawn["median"].to_numpy() == pytest.approx(median, rel=0.1)
    assert (run.events["strength"] >= drawn["least"].min()).all()
    line = breakage_line(read_run_json(folder))
    assert f"{breaks['num_opened']} facets opened" in line and "fracture work" in line
    for read in (Run(folder).contacts, Run(folder).patches):  # of pieces only where they are asked
        every, between = read(within=True), read()
        own = every["grain_a"] == every["grain_b"]
        assert own.any() and between.equals(every[~own].reset_index(drop=True))
    assert read_run_json(folder)["contact"]["num_overlaps_at_start"] == 0  # balls one on the other
    table, last = Run(folder).breakage(), read_run_json(folder)["breakage"]
    assert table["num_fragments"].iloc[-1] == last["num_fragments"] == several.sum()
    assert table["broken"].iloc[-1] == pytest.approx(several.size / 3)
    einav = table["einav"].to_numpy()
    assert 0.0 < einav[-1] == pytest.approx(last["einav"])
    assert (table.attrs["units"]["d50"], table.attrs["units"]["split"]) == ("m", "-")


@pytest.mark.mpi
def test_paraview_gets_a_point_a_piece(broken, tmp_path):
    """As many as history tells; volumes and middles of mass of all pieces are those of a grain."""
    folder = shutil.copytree(broken / "whole", tmp_path / "copy")
    history, run = read_history(folder / "history.csv"), Run(folder)
    result, state = write_paraview(run), run.state(-1)
    points = pyvista.read(folder / "paraview" / f"fragments_{state.index:04d}.vtp")
    num = history["num_fragments"][-1] + 3 - history["broken_grains"][-1]
    assert result["fragments"] == points.n_points == num
    for grain in (1, 2, 3):
        mine, cells = points["grain"] == grain, state.grain == grain
        volume, middle = state.volume[cells], state.points[state.cells[cells]].mean(axis=1)
        assert points["fragment"][mine].tolist() == list(range(mine.sum()))
        # Sums in another order.
        assert points["volume"][mine].sum() == pytest.approx(volume.sum(), rel=1e-12)
        moment = points["volume"][mine] @ points.points[mine]
        assert moment == pytest.approx(volume @ middle, abs=1e-12 * RADIUS * volume.sum())
    assert points["crack"].max() == state.field("crack").max() == 1.0
    series = json.loads((folder / "paraview" / "fragments.vtp.series").read_text())["files"]
    assert [s["time"] for s in series] == run.states["time"].tolist()
    most = state.field("fragment").max()
    assert f"'fragments': {most}" in (folder / "paraview_state.py").read_text()


@pytest.mark.mpi
def test_states_have_the_mesh_of_their_time(broken):
    """Nodes that have parted are there, and all fields on them."""
    folder = broken / "whole"
    states = [read_state(folder, state["index"]) for state in read_states(folder)]
    assert states[-1].n_points > states[0].n_points and len(list(folder.glob("fields/mesh*"))) > 1
    for state in states:
        assert len(state.point_data["displacement"]) == state.n_points
        assert state.cells.reshape(-1, 5)[:, 1:].max() == state.n_points - 1


def test_the_report_shows_what_broke(broken, tmp_path):
    """Figures, table, and all states in the view, which is of the mesh with all cracks."""
    folder, names = broken / "whole", ["breakage", "fragments", "energies"]
    result = write_report(folder, tmp_path, only=names)
    assert {Path(path).stem for path in result["figures"]} == set(names)
    assert result["missing"] == []
    page, numbers = (tmp_path / "report.html").read_text(), read_run_json(folder)["breakage"]
    history, events = (read_history(folder / f"{name}.csv") for name in ("history", "events"))
    drawn, energies, sizes = (
        read_history(tmp_path / "figures" / f"{name}.csv")
        for name in ("breakage", "energies", "fragments-fragments")
    )
    assert drawn["fragments [-]"][-1] == numbers["num_fragments"]
    for mode in ("tension", "shear"):
        area = events["area"][events["mode"] == mode].sum()
        assert drawn[f"area opened by {mode} [m²]"][-1] == pytest.approx(area)
    assert energies["cracks_fracture [J]"][-1] == history["cracks_fracture"][-1]
    assert len(sizes["diameter [m]"]) == numbers["num_fragments"] + 3 - history["broken_grains"][-1]
    broke, num_states = int(np.argmax(history["broken_grains"] > 0)), len(read_states(folder))
    state = next(s for s in map(Run(folder).state, range(num_states))
                 if s.time >= history["time"][broke] * (1 - 1e-9))  # fmt: skip
    grains = [g for g in (1, 2, 3) if state.field("fragment")[state.grain == g].any()]
    grains = ("grain " if len(grains) == 1 else "one of grains ") + ", ".join(map(str, grains))
    for text in (
        f"B (Einav 2007)</td><td>{number(numbers['einav'])}<",
        f"Fragments of broken grains</td><td>{number(numbers['num_fragments'])}<",
        f"First piece loose</td><td>{grains}, {history['stage'][broke]}, strain",
        "Fracture work</td>",
        '"name": "fragment"',
        f"at {num_states} of {num_states} stored states",
    ):
        assert text in page, text
    with matplotlib.rc_context(style.RC):
        for draw in (breakage.draw_breakage, breakage.draw_fragments):
            assert legends_beside_axes(draw(Source(folder)).figure)


def test_the_table_of_breakage_is_of_one_moment(broken, tmp_path):
    """A run killed after its last stored state: rows of tables beyond that do not count."""
    folder = shutil.copytree(broken / "whole", tmp_path / "killed")
    series, events = folder / "fields" / SERIES, read_history(folder / "events.csv")
    listed = json.loads(series.read_text())
    times = Run(folder).states["time"].to_numpy()
    before = np.flatnonzero((times > events["time"][0]) & (times < events["time"][-1]))[-1]
    listed["files"] = listed["files"][: before + 1]
    series.write_text(json.dumps(listed))
    rows = dict(breakage.breakage_rows(Source(folder)))
    for mode in ("tension", "shear"):
        num = np.sum((events["mode"] == mode) & (events["time"] <= times[before]))
        assert rows[f"Opened by {mode}"].startswith(f"{num} openings")
    state = Run(folder).state(-1)
    strain = f"strain {style.strain(state.strain)}"
    assert rows["At the last stored state"] == f"{state.stage}, {strain}"


def test_a_run_that_goes_back_closes_what_had_opened_since(broken, monkeypatch):
    """To a checkpoint of another mesh; half the step from there on."""
    scene = replace(SCENE, output=replace(SCENE.output, checkpoint_steps=10))
    seen, check = [], Recorder.check_energy

    def fail_once(recorder, energies):
        if not seen and recorder.simulation.mesh.version > 2:
            seen.append(recorder.simulation)
            raise UnstableError("once")
        check(recorder, energies)
        seen[1:] = [recorder.simulation] * bool(seen)

    monkeypatch.setattr(Recorder, "check_energy", fail_once)
    summary = run(broken, "again", scene)
    assert summary["finished"] and len(summary["retries"]) == 1
    mesh, (cracks,) = seen[-1].mesh, seen[-1].specimen.opening_terms
    opened = np.sort(np.sort(np.concatenate(mesh.opened)[:, :2]), axis=0)
    assert np.array_equal(opened, np.sort(np.sort(cracks.facets.across[cracks.opened]), axis=0))
    history = read_history(broken / "again" / "history.csv")
    assert history["cracks_fracture"][-1] > 0.0
    assert np.abs(history["residual"]).max() < 1e-2 * history["work"].max()


@pytest.mark.slow
def test_thirty_kills_leave_the_same_bytes(tmp_path):
    """By SIGKILL at random moments, before the first crack and with pieces that are loose."""
    if COMM.size > 1:
        pytest.skip("starts processes of its own")
    save_grains(tmp_path / "grains", packed_grains((1, 1, 3), h=0.7 * RADIUS))
    often = replace(SCENE, output=replace(SCENE.output, checkpoint_steps=60))
    start(tmp_path, "whole", of=often).communicate()
    whole, chance, killed = files(tmp_path / "whole"), random.Random(4), []
    first = csv.DictReader(whole["events.csv"].decode().splitlines())
    opened, at = float(next(iter(first))["time"]), []
    while len(killed) < 30:
        shutil.rmtree(tmp_path / "parts", ignore_errors=True)
        killed += kill_and_resume(tmp_path, "parts", 8, chance, of=often)
        assert files(tmp_path / "parts") == whole, len(killed)
        at += read_run_json(tmp_path / "parts")["resumed_at_steps"]
    history = read_history(tmp_path / "whole" / "history.csv")
    cracked = np.interp(opened, history["time"], history["step"])
    assert min(at) < cracked < max(at)


@pytest.mark.slow
@pytest.mark.mpi
def test_ranks_open_as_many_facets(tmp_path_factory):
    """Alike up to the first crack; afterwards rounding grows, and numbers agree in the mean.

    Of twenty seeds, whose numbers scatter by some tenth each: 5 % is twice the error of the mean.
    """
    path = COMM.bcast(tmp_path_factory.mktemp("seeds") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        save_grains(path / "grains", packed_grains((1, 1, 3), h=0.7 * RADIUS))
    COMM.Barrier()
    found = []
    for seed in range(20):
        scene = replace(SCENE, fracture=replace(SCENE.fracture, seed=seed))
        run(path, f"{seed}", scene)

        def alone(part, scene=scene, name=f"{seed}-alone"):
            run_scene(scene, path / "grains", path / name, part, quiet=True)

        on_first_ranks(COMM, 1, alone)
        tables = [read_history(path / f"{seed}{of}" / "events.csv") for of in ("", "-alone")]
        assert tables[0]["time"][0] == pytest.approx(tables[1]["time"][0], rel=1e-9)
        histories = [read_history(path / f"{seed}{of}" / "history.csv") for of in ("", "-alone")]
        ends = [history["num_opened"][-1] for history in histories]
        found.append([*(table["time"].size for table in tables), *ends])
    found = np.array(found)
    print(found)
    rows, alone, facets, facets_alone = found.sum(axis=0)
    assert rows == pytest.approx(alone, rel=0.05) and facets == pytest.approx(
        facets_alone, rel=0.05
    )


def test_a_scene_with_fracture_is_written_and_read_again(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(scene_to_toml(SCENE))
    assert load_scene(path) == SCENE
    before, table = path.read_text().split("[fracture]\n")
    table = re.sub("^strength = .*", 'strength = "50 MPa"', table, flags=re.MULTILINE)
    table = re.sub("^energy = .*", 'energy = "60 J/m^2"', table, flags=re.MULTILINE)
    path.write_text(f"{before}[fracture]\n{table}")
    assert load_scene(path) == SCENE


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"material": Rigid(1e9, 0.2, 2650.0)}, "expected none for material, which is rigid"),
        ({"solver": Solver(integrator="static")}, 'integrator = "static", expected "explicit"'),
        ({"contact": Contact(friction=0.4, self_contact=True)}, "self_contact = true"),
        ({"contact": Contact(friction=0.4, law="kinematic")}, 'law = "kinematic"'),
    ],
)
def test_where_grains_cannot_break_is_one_line(changes, line):
    with pytest.raises(InputError, match=line):
        replace(SCENE, **changes)
