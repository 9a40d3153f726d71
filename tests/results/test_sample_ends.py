"""Walls of a run led by scans: places of known motions, and a run led by images of another one."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from mpi4py import MPI

from mufe_fenicsx.analysis.kinematics import grain_motion
from mufe_fenicsx.container import BOX, CYLINDER, HOLLOW_CYLINDER
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.geometry.image.label_files import write_labels
from mufe_fenicsx.geometry.tracking.track import Track
from mufe_fenicsx.loading.measured import read_measured
from mufe_fenicsx.loading.measured_paths import columns_of
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.peers.scans import compare_scans
from mufe_fenicsx.results import Run
from mufe_fenicsx.results.sample_ends import (
    SIDES,
    _with_centres,
    cut_walls,
    grain_ends,
    places_by_scans,
)
from mufe_fenicsx.results.scans import Start, moment_of, voxels_of
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import Contact, Output, Scene, Solver, load_scene, scene_to_toml
from mufe_fenicsx.scene.stages import Axis, Loading, Stage
from tests.bodies import RADIUS, packed_grains
from tests.made_up_run import write_run

VOXEL = RADIUS / 16


def test_how_far_grains_reach_out_to_walls():
    """A ring of points between radii of 2 and 3 about (5, 1), 4 high, and a grain within it."""
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    ring = np.concatenate([2 * circle, 3 * circle + np.array([0, 0, 4])]) + np.array([5, 1, 0])
    run = SimpleNamespace(
        container=HOLLOW_CYLINDER, summary={"container": {"centre": [5.0, 1.0]}}, path="run"
    )
    points, grain = np.concatenate([ring, [[7.5, 1.0, 1.0]]]), np.repeat([0, 1], [80, 1])
    ends = grain_ends(run, points, grain)
    walls = {"side": [3, 2.5], "inner": [-2, -2.5], "z_min": [0, -1], "z_max": [4, 1]}
    assert list(ends) == list(run.container.walls) == list(walls)
    assert np.array(list(ends.values())) == pytest.approx(np.array(list(walls.values())))
    run.container = BOX
    flat = [ends[0] for ends in grain_ends(run, points, grain).values()]
    assert flat == pytest.approx([-2, 8, 2, 4, 0, 4], abs=1e-12)


def made_up(folder):
    """A made-up run of eight balls, its state as meshed, one that is pressed, and its start."""
    write_run(folder, counts=(2, 2, 2))
    run = Run(folder)
    start = Start({10 + k: k for k in range(8)}, False, (1.0, 1.0), 8, 1.0)
    return run, run.state(0), moment_of(run, 1), start


def ends_of(run, state, points):
    """Ends of the grains of a state at other places of its nodes."""
    nodes, at = np.unique(state.cells, return_index=True)
    return grain_ends(run, points[nodes], np.repeat(state.grain, 4)[at] - 10)


def lengths_at(run, time):
    """Distances of the walls of a run at a time [m], shape (3,)."""
    return np.array(
        [np.interp(time, run.history["time"], side) for side in run.lengths(run.history).T]
    )


def test_walls_go_as_far_as_grains_that_move_and_turn_and_are_flattened(tmp_path):
    """Motion of the run and a quarter turn of all: bounds of y go to z; a lost grain moves none.

    Touching are the grains that end near a wall in the run; these are turned away in the scan. Ends
    stand out beyond walls of the run, alike at both of an axis.
    """
    run, first, moment, start = made_up(tmp_path)
    state = moment.state
    own = grain_motion(state.reference, state.points, state.cells, state.grain)
    middle, quarter = own.centre.mean(axis=0), np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    shift = np.array([3e-5, 0, -1e-5])

    def turned(x):
        return (x - middle) @ quarter.T + middle + shift

    track = Track(
        np.arange(8), np.arange(8), own.centre, turned(own.centre + own.translation) - own.centre,
        quarter @ own.rotation, np.zeros(8),
    )  # fmt: skip
    size = RADIUS / 50  # of which a tenth parts the grains: two to four touch a wall
    reach = ends_of(run, first, first.points)

    def out(most, time):
        pairs = zip(*[iter(run.container.walls)] * 2, lengths_at(run, time), strict=True)
        half = [(w, 0.5 * (most[a] + most[b] - now)) for a, b, now in pairs for w in (a, b)]
        return dict(half)

    most = {w: ends.max() for w, ends in reach.items()}
    start_out = out(most, run.history["time"].iloc[0])
    before = {w: SIDES[w] * (most[w] - start_out[w]) for w in reach}
    now, seen = (ends_of(run, state, x) for x in (state.points, turned(state.points)))
    for lost in (None, 7):
        displacement, left = track.displacement.copy(), np.arange(8) != lost
        displacement[~left] = np.nan
        known = replace(track, displacement=displacement)
        places = places_by_scans(run, start, [known], [moment], size)
        after, most = {}, {w: ends[left].max() for w, ends in now.items()}
        beyond = out(most, moment.time)
        for w, ends in now.items():
            touch = left & (ends >= most[w] - 0.1 * size)
            after[w] = SIDES[w] * (most[w] - beyond[w] + np.median((seen[w] - ends)[touch]))
        assert places[0] == pytest.approx(before, abs=1e-15)
        assert places[1] == pytest.approx(after, abs=1e-15)


def test_walls_at_cuts_go_with_the_centres(tmp_path):
    """Centres in a linear field: walls in it, too; round ones by half of both shortenings."""
    run, _, moment, start = made_up(tmp_path)
    state = moment.state
    centre = grain_motion(state.reference, state.points, state.cells, state.grain).centre
    field = np.diag([0.01, 0.02, -0.05]) + 0.03 * np.eye(3)[[1, 0, 2]] * [1, 1, 0]
    moved = centre @ field + np.array([1e-5, 2e-5, 3e-5])
    turn = np.tile(np.eye(3), (8, 1, 1))
    track = Track(np.arange(8), np.arange(8), centre, moved, turn, np.zeros(8))
    cut = ("y_max", "z_min")
    first, later = places_by_scans(run, start, [track], [moment], VOXEL, cut)
    beside = centre.mean(axis=0)[0]
    assert later["z_min"] == pytest.approx(0.95 * first["z_min"] + 3e-5, abs=1e-15)
    wanted = 1.02 * first["y_max"] + 0.03 * beside + 2e-5
    assert later["y_max"] == pytest.approx(wanted, abs=1e-15)
    on = places_by_scans(run, start, [track], [moment], VOXEL)[1]
    assert {w for w in first if later[w] != on[w]} == set(cut)
    assert _with_centres("side", 2.0, track) == pytest.approx(2.0 * 1.015, abs=1e-12)


@pytest.mark.parametrize("container", [BOX, CYLINDER])
def test_cuts_through_sand_have_its_share_of_solid(container):
    """Balls on a grid about the axis of the container, cut at two walls, whole at the others.

    A plane through the middle of touching balls has π/4 of solid where the volume has π/6; one that
    touches them has none, and the layer of a voxel on it 2πR/(4R²) of a voxel's half: 0.1.
    """
    n, radius = 48, 8
    z, y, x = np.ogrid[:n, :n, :n]
    off = [(c + 0.5) % (2 * radius) - radius for c in (z, y, x)]
    labels = (off[0] ** 2 + off[1] ** 2 + off[2] ** 2 < radius**2).astype(int)
    labels[40:], places = 0, {"z_min": 0.0, "z_max": 40.0}
    if container is BOX:
        labels[:, :, :8] = 0
        cut, places = ["x_min", "z_max"], {"x_min": 8.0, "x_max": 48.0, "y_min": 0.0} | places
        places["y_max"] = 48.0
    else:
        labels[:, np.hypot(y - 23.5, x - 23.5)[0] >= 20] = 0
        cut, places = ["side", "z_max"], {"side": 20.0} | places
    run = SimpleNamespace(
        container=container, summary={"container": {"centre": [2.4e-4, 2.4e-4]}}, path="run"
    )
    in_metres = {wall: 1e-5 * place for wall, place in places.items()}
    assert cut_walls(run, labels, in_metres, 1e-5) == cut


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Eight balls with gaps between that a platen and two sides push on."""
    folder = tmp_path_factory.mktemp("led")
    save_grains(folder / "grains", packed_grains((2, 2, 2), gap=0.2, h=0.9 * RADIUS))
    return folder


def pushed(place, name, *stages):
    """A run of them; damping stops a ball within 10 µm, a tenth of what walls move it by."""
    scene = Scene(
        material=Elastic(10e9, 0.2, 2650.0),
        contact=Contact(friction=0.0),
        solver=Solver(damping=1e5),
        loading=Loading(speed=1.0, ramp=5e-3),
        stages=stages,
        output=Output(fields=len(stages) + 1),
    )
    run_scene(scene, place / "grains", place / name, MPI.COMM_SELF, quiet=True)
    return Run(place / name)


def test_a_run_led_by_the_images_of_another_one(place, monkeypatch):
    """Scans, table, stages: walls stand as far apart as in the first run, at each scan.

    To 0.2 voxels a length: 0.1 at each of two walls, as tracks are held to in `test_tracking`.
    """
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **options: Path(path).touch())
    zed, sides = Axis(strain=0.02, walls="max"), Axis(strain=0.02)
    more, one = Axis(strain=0.03, walls="max"), Axis(strain=0.015, walls="min")
    run = pushed(place, "first", Stage("a", z=zed, x=sides), Stage("b", z=more, y=one))
    shape = (72, 72, 72)
    for k in run.states.index:
        labels = voxels_of(moment_of(run, int(k)), shape, VOXEL)
        write_labels(place / f"scan{k}.tif", labels, VOXEL)
    scans = [place / f"scan{k}.tif" for k in run.states.index]
    told = compare_scans(place / "first", scans, place / "out")
    assert [scan["beside"] for scan in told["scans"]] == ["motion"] * 2

    text = scene_to_toml(load_scene(place / "first" / "scene.toml"))
    head = text[: text.index("[[stage]]")]
    (place / "led.toml").write_text(head + (place / "out" / "stages.toml").read_text())
    run_scene(load_scene(place / "led.toml"), place / "grains", place / "second",
              MPI.COMM_SELF, quiet=True)  # fmt: skip
    second = Run(place / "second")
    for k in run.states.index:
        theirs, ours = (lengths_at(of, of.states["time"][k]) for of in (run, second))
        assert ours == pytest.approx(theirs, abs=0.2 * VOXEL)

    told = compare_scans(place / "second", scans, place / "again")
    assert [scan["beside"] for scan in told["scans"]] == ["stage"] * 2
    assert [scan["states"] for scan in told["scans"]] == [[1, 1], [2, 2]]
    assert max(scan["mean_difference_voxels"] for scan in told["scans"]) < 0.2


def test_platens_flatten_the_grains_of_a_low_sample(tmp_path, monkeypatch):
    """Balls two high: centres come nearer by 2.1 voxels, platens by 2.8, for they flatten balls.

    To 0.2 voxels a length: 0.1 at each of two walls, as tracks are held to in `test_tracking`.
    """
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **options: Path(path).touch())
    save_grains(tmp_path / "grains", packed_grains((2, 2, 2)))
    run = pushed(tmp_path, "run", Stage("a", z=Axis(strain=0.05, walls="max")))
    scans, moments = (
        [tmp_path / f"scan{k}.tif" for k in (0, 1)],
        [moment_of(run, k) for k in (0, 1)],
    )
    for scan, moment in zip(scans, moments, strict=True):
        write_labels(scan, voxels_of(moment, (72, 72, 72), VOXEL), VOXEL)
    told = compare_scans(run.path, scans, tmp_path / "out")
    assert set(told["walls"].values()) == {"surfaces"}
    motion = read_measured(tmp_path / "out" / "motion.csv", columns_of(run.container)).columns
    for k, moment in enumerate(moments):
        led = [motion[f"{a}_max"][k] - motion[f"{a}_min"][k] for a in "xyz"]
        assert led == pytest.approx(lengths_at(run, moment.time), abs=0.2 * VOXEL)
