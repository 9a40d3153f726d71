"""Walls of a run led by scans: places of known motions, and a run led by images of another one."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from mpi4py import MPI

from mufe_fenicsx.container import BOX, HOLLOW_CYLINDER
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.geometry.image.label_files import write_labels
from mufe_fenicsx.geometry.tracking.track import Track
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.peers.scans import compare_scans
from mufe_fenicsx.results import Run
from mufe_fenicsx.results.sample_ends import places_by_scans, wall_places
from mufe_fenicsx.results.scans import Start, moment_of, voxels_of
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import Contact, Output, Scene, Solver, load_scene, scene_to_toml
from mufe_fenicsx.scene.stages import Axis, Loading, Stage
from tests.bodies import RADIUS, packed_grains
from tests.made_up_run import write_run

VOXEL = RADIUS / 16


def test_walls_touch_points_from_outside():
    """A ring of points between radii of 2 and 3 about (5, 1), 4 high."""
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    ring = np.concatenate([2 * circle, 3 * circle + np.array([0, 0, 4])]) + np.array([5, 1, 0])
    run = SimpleNamespace(
        container=HOLLOW_CYLINDER, summary={"container": {"centre": [5.0, 1.0]}}, path="run"
    )
    assert wall_places(run, ring) == pytest.approx(
        {"side": 3.0, "inner": 2.0, "z_min": 0.0, "z_max": 4.0}
    )
    run.container = BOX
    assert list(wall_places(run, ring).values()) == pytest.approx([2, 8, -2, 4, 0, 4], abs=1e-12)


def test_walls_go_as_far_as_the_grains_that_move_and_turn(tmp_path):
    """Quarter turns about x and a shift take bounds of y to z; a lost grain moves no wall."""
    write_run(tmp_path, counts=(2, 2, 2))
    run = Run(tmp_path)
    state = run.state(0)
    points = state.points[np.unique(state.cells)]
    middle, quarter = points.mean(axis=0), np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    centre = np.array([state.points[state.cells[state.grain == g]].mean(axis=(0, 1))
                       for g in range(10, 18)])  # fmt: skip
    shift = np.array([3e-5, 0, -1e-5])
    track = Track(
        np.arange(8), np.arange(8), centre, (centre - middle) @ (quarter.T - np.eye(3)) + shift,
        np.tile(quarter, (8, 1, 1)), np.zeros(8),
    )  # fmt: skip
    start = Start({10 + k: k for k in range(8)}, False, (1.0, 1.0), 8, 1.0)
    first, later = places_by_scans(run, start, [track])

    def turned(x):
        return (x - middle) @ quarter.T + middle + shift

    assert first == pytest.approx(wall_places(run, points), abs=1e-15)
    assert later == pytest.approx(wall_places(run, turned(points)), abs=1e-15)
    displacement = track.displacement.copy()
    displacement[0] = np.nan
    without = places_by_scans(run, start, [replace(track, displacement=displacement)])[1]
    rest = state.points[np.unique(state.cells[state.grain != 10])]
    before, after = wall_places(run, rest), wall_places(run, turned(rest))
    wanted = {w: first[w] + after[w] - before[w] for w in first}
    assert without == pytest.approx(wanted, abs=1e-15)


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
    """Scans, table, stages: walls stand where the grains of the first run end, at each scan.

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
    history, used = second.history, np.unique(run.state(0).cells)
    for k in run.states.index:
        ends = np.ptp(run.state(k).points[used], axis=0)
        at = second.states["time"][k]
        walls = [np.interp(at, history["time"], side) for side in second.lengths(history).T]
        assert walls == pytest.approx(ends, abs=0.2 * VOXEL)

    told = compare_scans(place / "second", scans, place / "again")
    assert [scan["beside"] for scan in told["scans"]] == ["stage"] * 2
    assert [scan["states"] for scan in told["scans"]] == [[1, 1], [2, 2]]
    assert max(scan["mean_difference_voxels"] for scan in told["scans"]) < 0.2
