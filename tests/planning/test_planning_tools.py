"""Plans of tests that tools load or that have a membrane: their cost, and what is not known."""

from dataclasses import replace

import pytest
from mpi4py import MPI

from mufe_fenicsx.planning.cost import Benchmark, predict
from mufe_fenicsx.planning.course import course_of
from mufe_fenicsx.planning.errors import sample_errors
from mufe_fenicsx.planning.reasons import unknown
from mufe_fenicsx.planning.run import make_plan, present
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import load_scene
from mufe_fenicsx.synthetic.starter_scenes import write_new_scene
from tests.planning.samples import point
from tests.plates import ROCK, write_plate_and_spheres

COMM = MPI.COMM_SELF
SCENE = (
    ROCK
    + """
[contact]
friction = 0.4

[[tool]]
name = "press"
surface = "plate.stl"
unit = "1 mm"
position = ["-0.5 mm", "-0.5 mm", "4.001 mm"]
velocity = [0, 0, "-2 m/s"]

[loading]
speed = "1 m/s"

[[stage]]
name = "press"
until = { time = "8 us" }

[[stage]]
name = "on"
until = { time = "6 us" }
hold = "2 us"

[output]
fields = 3
history = 11
"""
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("plan")
    write_plate_and_spheres(path)
    (path / "scene.toml").write_text(SCENE)
    return path


def test_a_test_that_tools_load_takes_the_time_of_its_stages(folder):
    """16 us in steps of the benchmark; no platen seats it, and its speed is the user's."""
    scene = load_scene(folder / "scene.toml")
    found, cost = present(scene, folder / "grains", COMM)
    assert not course_of(scene).presses and found.parts["loading"] == 0.0
    # Its grains have too few elements per contact for the table.
    assert any("forces on tools" in line and "no error is known" in line for line in found.unknown)
    assert cost.num_steps == pytest.approx(16e-6 / cost.time_step, abs=2)
    made, _ = make_plan(scene, folder / "grains", COMM, 0.6, measure=False)
    assert not {"loading.speed", "mass_scaling.added"} & made.settings.keys()
    result = run_scene(scene, folder / "grains", folder / "out", COMM, quiet=True)
    assert result["finished"] and result["num_cells"] == cost.num_cells
    # Contacts that close under the press shorten its steps, others are longer.
    assert 0.7 < cost.num_steps / result["num_steps"] < 1.4


def test_a_plan_says_the_error_of_a_smooth_tool(folder):
    """Half-way in logarithms between 12 and 3 % of two meshes; nothing without such points."""
    scene = load_scene(folder / "scene.toml")
    base = [
        point(0.1, 1.0, "hertz", elements_per_radius=1.0),
        *(point(e, 1.0, "sample", elements_per_diameter=n, fidelity="elastic")
          for e, n in ((0.2, 10.0), (0.1, 20.0))),
    ]  # fmt: skip
    tool = [point(e, 1.0, "tool", elements_per_radius=n) for e, n in ((0.12, 1.0), (0.03, 2.0))]
    for points, said in ((base + tool, "smooth tools are 6 % off"), (base, "no error is known")):
        errors = sample_errors(points, yields=False)
        (line,) = (line for line in unknown(scene, errors, 2**0.5) if "forces on tools" in line)
        assert said in line


def test_a_membrane_costs_tetrahedra_and_steps_of_its_own(tmp_path):
    write_new_scene("triaxial", tmp_path / "round", membrane=True)
    scene = load_scene(tmp_path / "round" / "scene.toml")
    found, cost = present(scene, tmp_path / "round" / "grains", COMM)
    assert course_of(scene).presses and any("membrane" in line for line in found.unknown)
    grains = 46 * found.tets
    assert 0.05 < cost.num_cells / grains - 1 < 1.0, "a sleeve of some thousand tetrahedra"


def test_finer_grains_leave_the_membrane_as_it_is(folder):
    b = Benchmark(
        1, 8, 8000, 3000, 1e-3, 2.0, 1e-3, (0, 0), (0.0, 0.0), 0.0, 1e-9, 1e-9, 4e8, of_sleeve=2000,
    )  # fmt: skip
    scene = load_scene(folder / "scene.toml")
    once, finer = predict(scene, b), predict(scene, b, finer=2.0)
    assert (once.num_cells, finer.num_cells) == (10000, 18000)
    alone = predict(scene, replace(b, num_cells=10000, of_sleeve=0), finer=1.8)
    assert finer == alone
