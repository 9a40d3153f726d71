"""Damaged files through the command line: a status, at most one line, nothing left after a refusal.

What reads each kind of file has tests of its own with many more of them.
"""

import random
import shutil

import pytest

from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.geometry.tets.foreign_meshes import import_grains
from tests.bodies import RADIUS, packed_grains
from tests.doors import check_answer, mufe, warm
from tests.geometry.image.test_image_door import damaged
from tests.geometry.image_samples import write_samples
from tests.geometry.tets.test_mesh_door import write_meshes
from tests.made_up_run import write_whole_run
from tests.report.test_run_folder_fuzz import damaged as damaged_run
from tests.scene.scene_files import FULL, SMALLEST
from tests.scene.test_scene_fuzz import STAGES, mutated

pytestmark = pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork")
FIGURES = ["stress-strain", "contact-age"]


def short_and_long(short, long):
    """A number of files that takes seconds, and one for `make verify`."""
    return pytest.mark.parametrize("count", [short, pytest.param(long, marks=pytest.mark.slow)])


@short_and_long(5, 300)
def test_scenes(tmp_path, count):
    """Those that can be run are, for two steps."""
    save_grains(tmp_path / "grains", packed_grains((2, 1, 1), h=RADIUS))
    chance, scene, output = random.Random(count), tmp_path / "scene.toml", tmp_path / "out"
    words = ["run", scene, "--grains", tmp_path / "grains", "-o", output, "--max-steps", 2]
    for k in range(count + 1):
        text = mutated(chance, chance.choice([SMALLEST, FULL, STAGES])) if k else SMALLEST
        scene.write_bytes(text.encode("utf-8", "surrogateescape"))
        if k == 0:
            warm(*words, "--quiet")
        else:
            check_answer(*mufe(*words, "--quiet"), text, output)
        shutil.rmtree(output, ignore_errors=True)


@short_and_long(10, 500)
def test_images(tmp_path, count):
    chance, output = random.Random(count), tmp_path / "labels.tif"
    samples = write_samples(tmp_path)
    warm("segment", samples[0][0], "-o", output, "--voxel-size", "5 um")
    for k in range(count):
        path, options = samples[(k if count > 100 else chance.randrange(1000)) % len(samples)]
        data = path.read_bytes()
        path.write_bytes(damaged(data, chance))
        words = ["segment", path, "-o", output, "--voxel-size", "5 um", "--overwrite"]
        if options:
            words += ["--shape", ",".join(map(str, options["shape"])), "--dtype", options["dtype"]]
        output.unlink(missing_ok=True)
        check_answer(*mufe(*words), f"{k}: {path.name}", output)
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
        check_answer(*mufe(*words, path, "-o", output), f"{k}: {path.name}", output)
        shutil.rmtree(output, ignore_errors=True)
        path.write_bytes(data)


@short_and_long(1, 200)
def test_run_folders(tmp_path, count):
    whole, folder = tmp_path / "whole", tmp_path / "run"
    whole.mkdir()
    write_whole_run(whole, n=2)
    chance = random.Random(count)
    only = [word for name in FIGURES for word in ("--only", name)]
    for words in (["watch", "--once", whole], ["report", whole, *only], ["paraview", whole]):
        warm(*words)
    for k in range(count):
        damaged_run(chance, whole, folder)
        check_answer(*mufe("watch", "--once", folder), f"{k}: watch")
        check_answer(*mufe("report", folder, *only), f"{k}: report")
        check_answer(*mufe("paraview", folder), f"{k}: paraview")
