"""Undrained stages, paths, cycles and a measured motion in one run, and in its scene."""

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.output.fields import read_states
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.scene import Contact, Output, Scene, Solver, load_scene, scene_to_toml
from mufe_fenicsx.scene.stages import Axis, Loading, Stage, Until, named
from tests.checkpoints import arrays
from tests.loading.staged import (
    COMM,
    MOTION,
    run,
    shared_folder,
)


def test_cycles_are_the_stages_written_out():
    cycle = Stage("load", z=Axis(strain=0.01)), Stage("unload", z=Axis(strain=0.0))
    seat, last = Stage(zero=True, xyz=Axis(stress=1e5)), Stage("more", z=Axis(strain=0.1))
    again = Stage("unload", z=Axis(strain=0.0), repeat=3, repeat_from="load")
    found = named([seat, cycle[0], again, last])
    written = [seat, *cycle]
    for k in (2, 3):
        written += [
            Stage(f"load {k}", z=Axis(strain=0.01)),
            Stage(f"unload {k}", z=Axis(strain=0.0)),
        ]
    assert found == named([*written, last]) and named(found) == found
    assert [s.name for s in named([Stage("one", hold=1e-6, repeat=2)])] == ["one", "one 2"]


@pytest.mark.parametrize(
    "stages, words",
    [
        ([Stage("a", hold=1.0, repeat=2, repeat_from="b"), Stage("b", hold=1.0)],
         r'stage\[1\].repeat_from = "b", expected the name of this stage or of one before it'),
        ([Stage("a", hold=1.0, repeat=2), Stage("b", hold=1.0, repeat=2, repeat_from="a")],
         r'stage\[2\].repeat_from = "a", expected a stage after those of the cycles before'),
        ([Stage("a", hold=1.0, zero=True, repeat=2)], "expected no stage with zero = true in it"),
        ([Stage("a 2", hold=1.0), Stage("a", hold=1.0, repeat=2)], 'name = "a 2", expected names'),
    ],
)  # fmt: skip
def test_what_cycles_must_not_be(stages, words):
    with pytest.raises(InputError, match=words):
        named(stages)


@pytest.fixture
def folder(tmp_path_factory):
    path = shared_folder(tmp_path_factory, grains=((1, 1, 2), 0.9))
    if COMM.rank == 0:
        (path / "motion.csv").write_text("time, strain_z\n0, 0\n1, 1e-3\n2, 1.5e-3\n")
    COMM.Barrier()
    return path


def scene(folder, **changes):
    """Seating, p and q, a path at constant p, undrained cycles by signed q, a file."""
    stages = (
        Stage(zero=True, xyz=Axis(stress=1e6)),
        Stage("path", p=3e6, q=1e6),
        Stage("constant p", z=Axis(strain=0.004), p=3e6, until=Until(q=2e6)),
        Stage("load", z=Axis(speed=0.5), undrained=True, until=Until(q=3e6, strain_z=0.01)),
        Stage("unload", z=Axis(speed=-0.5), undrained=True, until=Until(q=0.0, strain_z=-0.01),
              repeat=2, repeat_from="load"),
        Stage("follow", follow=folder / "motion.csv", xy=Axis(stress=2e6)),
    )  # fmt: skip
    values = {
        "material": J2(100e9, 0.15, 2650.0, ((0.0, 1e9), (0.05, 2e9))),
        "contact": Contact(friction=0.4, wall_friction=0.1),
        "solver": Solver(damping=2e5),
        "loading": Loading(speed=0.5, ramp=2e-4, tolerance=0.05),
        "stages": stages,
        "output": Output(fields=4, history=31, checkpoint_steps=300),
    }
    return Scene(**(values | changes))


def test_a_run_along_paths_resumes_to_the_same_bits(folder):
    given = scene(folder)
    whole = run(folder, "whole", given)
    names = [stage["name"] for stage in whole["stages"]]
    assert whole["finished"] and names == [
        "seating", "path", "constant p", "load", "unload", "load 2", "unload 2", "follow",
    ]  # fmt: skip
    history = read_history(folder / "whole" / "history.csv")
    stage, u = history["stage"], history["pore_pressure"]
    undrained = np.isin(stage, names[3:7])
    assert not u[~undrained].any() and u[undrained].any()
    total = (history["stress_x"] + history["stress_y"])[undrained] / 2 + u[undrained]
    assert np.ptp(total) < 1e-9 * total.mean()
    volume = (history["length_x"] * history["length_y"] * history["height"])[undrained]
    assert np.ptp(volume) < 1e-9 * volume[0]
    p = sum(history[f"stress_{a}"] for a in "xyz") / 3
    # While z comes down p is ahead by 1 %, what moves the sides at their speed by the servo's gain;
    # walls that brake at the end leave less.
    assert p[stage == "constant p"][-1] == pytest.approx(3e6, rel=0.01)
    # As many states as the scene says, at ends of stages, the last one among them.
    states = [state["stage"] for state in read_states(folder / "whole")]
    assert states == ["path", "path", "unload", "follow"]

    at = {stage["name"]: stage["step"] for stage in whole["stages"]}
    # One stop in each kind of stage; in the end with the file in its place, but not with another.
    cuts = [at["constant p"] + 30, at["load 2"] + 20, at["follow"] + 25]
    for number, cut in enumerate(cuts):
        run(folder, "parts", given, max_steps=cut, resume=number > 0)
    motion = folder / "motion.csv"
    text = COMM.bcast(motion.read_text() if COMM.rank == 0 else None)
    if COMM.rank == 0:
        motion.write_text(text + "3, 2e-3\n")
    COMM.Barrier()
    with pytest.raises(InputError, match='has changed, expected what stage "follow" of the run'):
        run(folder, "parts", given, resume=True)
    if COMM.rank == 0:
        motion.write_text(text)
    COMM.Barrier()
    parts = run(folder, "parts", given, resume=True)
    assert parts["num_steps"] == whole["num_steps"] and parts["stages"] == whole["stages"]
    assert arrays(folder / "parts") == arrays(folder / "whole")


def test_new_keys_are_read_as_they_are_written(tmp_path):
    path = tmp_path / "scene.toml"
    (tmp_path / "motion.csv").write_text(MOTION)
    path.write_text("""
[material]
model = "elastic"
E = 1e9
nu = 0.2
rho = 2650
[contact]
friction = 0.3
[loading]
speed = "10 mm/s"
[[stage]]
zero = true
xyz = { stress = "100 kPa" }
[[stage]]
name = "path"
p = "200 kPa"
eta = 0.5
[[stage]]
name = "load"
z = { speed = 0.1 }
undrained = true
until = { q = "50 kPa", pore_pressure = "99 kPa" }
repeat = 2
[[stage]]
follow = "motion.csv"
""")
    given = load_scene(path)
    assert [stage.name for stage in given.stages] == [
        "seating",
        "path",
        "load",
        "load 2",
        "stage 4",
    ]
    assert given.stages[4].follow == tmp_path / "motion.csv"
    path.write_text(scene_to_toml(given))
    assert load_scene(path) == given
    text = path.read_text().replace("undrained = true", "undrained = true\nxy = { speed = 0.0 }", 1)
    path.write_text(text)
    with pytest.raises(InputError, match=r"stage\[3\].undrained = true, expected an axis that is"):
        load_scene(path)
