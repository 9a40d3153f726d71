"""Damaged files and nonsense through all doors: a line at most, nothing left after a refusal.

Commands end with a status; Python's names raise an InputError.

What reads each kind of file has tests of its own with many more of them.
"""

import os
import random
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest

import mufe_fenicsx as mufe
from mufe_fenicsx.errors import InputError, SolverError
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.geometry.tets.foreign_meshes import import_grains
from tests.bodies import RADIUS, packed_grains
from tests.doors import check_answer, warm
from tests.doors import mufe as run_mufe
from tests.geometry.image.test_image_door import damaged
from tests.geometry.image_samples import write_samples
from tests.geometry.tets.test_mesh_door import write_meshes
from tests.made_up_run import write_whole_run
from tests.report.test_run_folder_fuzz import damaged as damaged_run
from tests.scene.scene_files import FULL, SMALLEST
from tests.scene.test_scene_fuzz import STAGES, mutated
from tests.test_python_door import CELLS, GLASS, POINTS, UP, build, tool, wall

pytestmark = pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork")
FIGURES = ["stress-strain", "contact-age"]
#: Scenes of round samples with a membrane, of tools, of files to follow.
ROUND = '[container]\nshape = "cylinder"\n[membrane]\n' + STAGES.replace("z = { str", "rz = { str")
TOOL = (
    SMALLEST
    + """
[[tool]]
name = "cone"
surface = "cone.off"
unit = "1 mm"
position = [0.0, 0.0, 1e-3]
velocity = ["0 m/s", "0 m/s", "-1 m/s"]
path = "path.csv"
"""
)
FOLLOW = STAGES.partition("[[stage]]\nz")[0] + '[[stage]]\nfollow = "path.csv"\n'
SCENES = [SMALLEST, FULL, STAGES, ROUND, TOOL, FOLLOW]
CONE = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
#: What stands where Python expects something else.
NONSENSE = [
    None, True, -1, 0, 10**40, 10**400, 1e300, 1e-300, np.nan, np.inf, "", "x", [], [1], {}, b"x",
    [[1, 2], [3]], {"a": 1}, {1: 2}, np.zeros(3), np.zeros((2, 3)), np.full((8, 3), np.nan), object,
    1 + 2j, np.array(["a"]), np.array([None]), lambda *_: 0, lambda *_: None, (1.0, 2.0, "z"),
]  # fmt: skip
#: Calls with arguments that hold, of which some are replaced.
CALLS = [
    (wall, {"name": "w", "point": UP, "normal": UP, "friction": 0.3, "velocity": UP, "speed": 1.0,
            "friction_kinetic": 0.2, "bonded": False, "radius": 0.0, "growth_rate": 0.0,
            "angular_velocity": UP, "mirror": False}),
    (wall, {"target": 1.0, "speed": 1.0}),
    (tool, {"name": "t", "points": POINTS, "cells": CELLS, "friction": 0.3, "velocity": UP,
            "angular_velocity": UP, "point": UP, "free": ("x",), "force": (1.0, 0.0, 0.0),
            "torque": (0.0, 0.0, 0.0), "density": 1.0, "path": None}),
    (mufe.ToolPath, {"time": [0.0, 1.0], "place": [[0.0] * 6, [1.0] * 6]}),
    (mufe.Elastic, {"E": 1e9, "nu": 0.2, "rho": 1e3}),
    (mufe.J2, {"E": 1e9, "nu": 0.2, "rho": 1e3, "yield_stress": ((0.0, 1e7),), "beyond": "flat"}),
    (mufe.box, {"lengths": (1, 1, 1), "divisions": (1, 1, 1), "origin": (0, 0, 0)}),
    (mufe.half_ball, {"radius": 1.0, "h_contact": 0.5, "growth": 0.1, "direction": UP}),
    (build, {"bodies": [(POINTS, CELLS)], "material": GLASS, "low": (0, 0, 0), "high": (1, 1, 1),
             "axes": "z", "wall_friction": {"z_min": 0.1}, "velocity": lambda x, grain: 0.0 * x,
             "walls": [], "tools": [], "sleeves": (), "friction": 0.1, "damping": 0.0,
             "gravity": (0, 0, -9.81), "time_step_factor": 0.9, "refresh": 150, "element": "p1",
             "points": "facets", "law": "matched", "compliance": 0.1, "assembled": True}),
    (build, {"increment": 1e-3, "spectral_radius": None, "tolerance": 1e-6, "max_iterations": 9}),
]  # fmt: skip


def short_and_long(short, long):
    """A number of files that takes seconds, and one for `make verify`."""
    return pytest.mark.parametrize("count", [short, pytest.param(long, marks=pytest.mark.slow)])


@short_and_long(5, 300)
def test_scenes(tmp_path, count):
    """Those that can be run are, for two steps."""
    save_grains(tmp_path / "grains", packed_grains((2, 1, 1), h=RADIUS))
    chance, scene, output = random.Random(count), tmp_path / "scene.toml", tmp_path / "out"
    (tmp_path / "cone.off").write_text(CONE)
    (tmp_path / "path.csv").write_text("time,z\n0,0\n1e-6,-1e-6\n")
    words = ["run", scene, "--grains", tmp_path / "grains", "-o", output, "--max-steps", 2]
    for k in range(count + 1):
        text = mutated(chance, chance.choice(SCENES)) if k else SMALLEST
        scene.write_bytes(text.encode("utf-8", "surrogateescape"))
        if k == 0:
            warm(*words, "--quiet")
        else:
            check_answer(*run_mufe(*words, "--quiet"), text, output)
        shutil.rmtree(output, ignore_errors=True)


@short_and_long(5, 500)
def test_images(tmp_path, count):
    chance, output = random.Random(count), tmp_path / "labels.tif"
    samples = write_samples(tmp_path)
    more = ["-o", output, "--voxel-size", "5 um", "--overwrite", "--min-grain-voxels", 5]
    warm("segment", samples[0][0], *more)
    for k in range(count):
        path, options = samples[(k if count > 100 else chance.randrange(1000)) % len(samples)]
        data = path.read_bytes()
        path.write_bytes(damaged(data, chance))
        words = ["segment", path, *more]
        if options:
            words += ["--shape", ",".join(map(str, options["shape"])), "--dtype", options["dtype"]]
        output.unlink(missing_ok=True)
        check_answer(*run_mufe(*words), f"{k}: {path.name}", output)
        path.write_bytes(data)


@short_and_long(10, 300)
def test_meshes(tmp_path, count):
    chance, output = random.Random(count), tmp_path / "grains"
    samples = write_meshes(tmp_path)
    warm("import", samples[0][0], "-o", tmp_path / "tets")
    warm("mesh", samples[-1][0], "-o", tmp_path / "surfaces", "--size", 0.5, "--processes", 1)
    for k in range(count):
        path, read = samples[(k if count > 100 else chance.randrange(1000)) % len(samples)]
        data = path.read_bytes()
        path.write_bytes(damaged(data, chance))
        words = ["import"] if read is import_grains else ["mesh", "--size", 0.5, "--processes", 1]
        check_answer(*run_mufe(*words, path, "-o", output), f"{k}: {path.name}", output)
        shutil.rmtree(output, ignore_errors=True)
        path.write_bytes(data)


@short_and_long(1, 200)
def test_run_folders(tmp_path, count):
    whole, folder = tmp_path / "whole", tmp_path / "run"
    whole.mkdir()
    write_whole_run(whole, n=2)
    chance, drawn = random.Random(count), 0
    only = [word for name in FIGURES for word in ("--only", name)]
    for words in (["watch", "--once", whole], ["report", whole, *only], ["paraview", whole]):
        warm(*words)
    for k in range(count):
        damaged_run(chance, whole, folder)
        check_answer(*run_mufe("watch", "--once", folder), f"{k}: watch")
        status, lines = run_mufe("report", folder, *only)
        check_answer(status, lines, f"{k}: report")
        drawn += status == 0
        check_answer(*run_mufe("paraview", folder), f"{k}: paraview")
    assert drawn >= count // 2  # what is left of most runs can be shown


@short_and_long(150, 5000)
def test_python(count):
    """Arguments of public names, one or two of them nonsense: taken, or told in a line."""
    chance, refused, simulation = random.Random(count), 0, build()
    calls = [
        *CALLS,
        (mufe.Pressure, {"mesh": simulation.mesh, "pressure": 1e4, "labels": [1], "origin": UP,
                         "where": lambda c, n: n[:, 2] > 0.5, "name": "pressure"}),
        (mufe.drive, {"simulation": simulation, "moves": {"z_max": 0 * UP}, "duration": 1e-8,
                      "turns": {"z_max": 0 * UP}, "at_step": lambda: None}),
        (mufe.settle, {"simulation": simulation, "ratio": 1.0, "max_steps": 2, "every": 1}),
    ]  # fmt: skip
    for k in range(count):
        function, given = chance.choice(calls)
        given = dict(given)
        for name in chance.sample(list(given), chance.randint(1, min(2, len(given)))):
            given[name] = chance.choice(NONSENSE)
        try:
            function(**given)
        except (InputError, SolverError) as error:
            assert len(str(error).splitlines()) == 1, (k, given)
            refused += 1
        except Exception as error:
            told = {name: str(value)[:60] for name, value in given.items()}
            raise AssertionError(f"{k}: {function.__name__} {told}: {error!r}") from error
    assert refused > count / 3


@short_and_long(8, 200)
def test_commands(tmp_path, count):
    """`new`, `pack` and `export` with words that nobody means: nothing is left of a refusal."""
    chance = random.Random(count)
    save_grains(tmp_path / "grains", packed_grains((2, 1, 1), h=RADIUS))
    words = [
        "",
        "x",
        "-1",
        "0",
        "nan",
        "1e300",
        "1 km",
        "1,1",
        "1e-9,1e-9,1e-9",
        "1000000",
        "../..",
    ]
    for k in range(count):
        output = tmp_path / "deep" / "er" / "x"
        command = chance.choice([
            ["new", chance.choice(["scan", "x", ""])],
            ["pack", "--spheres", "--count", chance.choice(words), "--box", chance.choice(words)],
            ["export", chance.choice(["mesh", "surfaces", "clumps", "x"]), tmp_path / "grains"],
        ])  # fmt: skip
        if chance.random() < 0.5:
            command += [chance.choice(["--seed", "--voxel-size", "--d50"]), chance.choice(words)]
        status, lines = run_mufe(*command, "-o", output)
        check_answer(status, lines, f"{k}: {command}", tmp_path / "deep")
        assert status != 2 or not (tmp_path / "deep").exists(), (command, lines)
        shutil.rmtree(tmp_path / "deep", ignore_errors=True)


@pytest.mark.skipif(os.getuid() != 0, reason="only root may become another user")
def test_a_folder_of_another_user():
    """What would write into it, or cannot read it, is refused in a line; nothing changes.

    Modules are loaded before: the other user may not read those of a Python in root's home.
    """
    nobody = 65534
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        place.chmod(0o755)
        (place / "scene.toml").write_text(SMALLEST)
        save_grains(place / "grains", packed_grains((2, 1, 1), h=RADIUS))
        run = ["run", place / "scene.toml", "--grains", place / "grains", "-o", place / "run"]
        warm(*run, "--max-steps", 1, "--quiet")
        before = {path: path.stat().st_mtime_ns for path in place.rglob("*")}
        for mode in (0o755, 0o700):
            (place / "run").chmod(mode)
            for more in (["--resume"], ["--overwrite"], []):
                status, lines = run_mufe(*run, *more, "--quiet", user=nobody)
                check_answer(status, lines, more)
                assert status == 2, (more, lines)
        assert before == {path: path.stat().st_mtime_ns for path in place.rglob("*")}
