"""Checkpoints that somebody made, with checksums that hold: a line, no traceback, no hang."""

import hashlib
import json
import random
import shutil

import h5py
import numpy as np
import pytest

from mufe_fenicsx.errors import InputError, SolverError
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.output import checkpoint as checkpoints
from mufe_fenicsx.output.run_kinds import KINDS, sorted_out
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import load_scene
from tests.bodies import RADIUS, packed_grains
from tests.scene.scene_files import SMALLEST

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)

VALUES = [None, True, -1, 0, 10**9, 1e300, float("nan"), "x", "../../x", [], [1], {}, {"a": 1}]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    path = tmp_path_factory.mktemp("forged")
    save_grains(path / "grains", packed_grains((2, 1, 1), h=RADIUS))
    (path / "scene.toml").write_text(SMALLEST.replace("speed = 2", "speed = 50"))
    resume(path, path / "run", 100, resume=False)
    shutil.rmtree(path / "run" / "checkpoints" / "step-000000000")  # that a bad one would leave
    return path


def resume(place, folder, steps, resume=True):
    scene = load_scene(place / "scene.toml")
    options = {"max_steps": steps, "quiet": True, "resume": resume}
    return run_scene(scene, place / "grains", folder, MPI.COMM_SELF, **options)


def forge(folder, change, tables=None):
    """Change the last checkpoint of a run, with the checksums that belong to it."""
    path = max(folder.glob("checkpoints/step-*"))
    if tables is not None:
        with h5py.File(path / "rank-0000.h5", "r+") as file:
            tables(file)
    content = json.loads((path / "manifest.json").read_text())["content"]
    with (path / "rank-0000.h5").open("rb") as file:
        entry = {"name": "rank-0000.h5", "size": (path / "rank-0000.h5").stat().st_size}
        content["files"] = [entry | {"checksum": checkpoints.file_checksum(file.name)}]
    change(content)
    text = json.dumps(content)
    checksum = hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
    head = {"format": checkpoints.FORMAT, "version": checkpoints.VERSION, "checksum": checksum}
    (path / "manifest.json").write_text(json.dumps(head)[:-1] + ', "content": ' + text + "}")


def check(place, change, tables=None):
    """The line that refuses a forged checkpoint, or None where it is taken."""
    folder = place / "try"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(place / "run", folder)
    forge(folder, change, tables)
    try:
        resume(place, folder, 103)
    except (InputError, SolverError) as error:
        assert len(str(error).splitlines()) == 1
        return str(error)
    return None


def nothing(content):
    pass


def test_a_checkpoint_that_is_not_forged_is_taken(place):
    assert check(place, nothing) is None


def test_every_entry_of_run_json_has_a_kind(place):
    """Those without one reach reports as somebody may have written them."""
    run = json.loads((place / "run" / "run.json").read_text())
    assert not set(run) - set(KINDS)
    assert sorted_out(run) == (run, [])


@pytest.mark.parametrize(
    "name", ["files", "num_ranks", "scene", "recorder", "state", "loading", "written_by", "tools"]
)
def test_what_is_missing_is_told(place, name):
    said = check(place, lambda content: content.pop(name))
    assert name in said or "does not list" in said


def test_a_number_of_ranks_without_files_is_refused_at_once(place):
    said = check(place, lambda content: content.update(num_ranks=10**9))
    assert "does not list one file of each rank" in said


def test_a_manifest_nested_deep_is_torn(place):
    folder = place / "try"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(place / "run", folder)
    (max(folder.glob("checkpoints/step-*")) / "manifest.json").write_text("[" * 10**6)
    with pytest.raises(InputError, match=r"manifest.json is torn"):
        resume(place, folder, 103)


def test_a_table_of_another_length_is_refused(place):
    def shorten(file):
        values = file["tables/nodes/state.x"][:-1]
        del file["tables/nodes/state.x"]
        file["tables/nodes/state.x"] = values

    assert "columns of table nodes have different lengths" in check(place, nothing, shorten)


@pytest.mark.parametrize(
    ("table", "column", "value"),
    [
        ("wall_pairs", "wall", 6),
        ("wall_pairs", "wall", -1),
        ("pairs", "partner", 2),
        ("pairs", "count", 30),
        ("pairs", "count", -1),
        ("pairs", "closest", 10**6),
        ("points", "met", 2),
        ("edge_pairs", "partner", 2),
        ("cells", "grain", 2),
    ],
)
def test_a_number_of_a_wall_or_grain_out_of_range_is_refused(place, table, column, value):
    """Before anything is indexed with it."""

    def change(file):
        file[f"tables/{table}/{column}"][-1:] = value

    said = check(place, nothing, change)
    assert f"{column} of {table} = " in said and "expected" in said


@pytest.mark.parametrize(
    "entry", [{"first_height": None}, {"stage": []}, {"stages": "x"}, {"reference_height": None}]
)
def test_a_value_of_another_type_is_told_before_the_test_goes_on(place, entry):
    said = check(place, lambda content: content["loading"]["common"].update(entry))
    assert "holds what no run wrote (TypeError" in said


def replaced(chance, value, depth=6):
    """A value with something within replaced, or left out."""
    if isinstance(value, dict | list) and value and depth and chance.random() < 0.9:
        place = chance.choice(list(value) if isinstance(value, dict) else range(len(value)))
        if chance.random() < 0.15:
            del value[place]
        else:
            value[place] = replaced(chance, value[place], depth - 1)
        return value
    return chance.choice(VALUES)


def damaged_column(chance, file):
    names = []
    file.visititems(
        lambda name, item: (isinstance(item, h5py.Dataset) and names.append(name)) or None
    )
    name = chance.choice(names)
    values = file[name][()]
    del file[name]
    what = chance.randrange(5)
    if what == 0 or not np.size(values):
        return
    if what == 1:
        values = np.concatenate([np.atleast_1d(values)] * 2)
    elif what == 2:
        values = np.atleast_1d(values)[:-1]
    elif what == 3:
        value = np.array(chance.choice([-1, 0, 1, 10**6, 2**31 - 1]))
        values = np.full_like(values, value.astype(values.dtype))
    else:
        values = np.atleast_1d(values).astype(float) + 0.5
    file[name] = values


@pytest.mark.parametrize("count", [6, pytest.param(400, marks=pytest.mark.slow)])
def test_forged_entries(place, count):
    """Of the manifest and of its tables: each is taken, or refused in a line."""
    chance, refused = random.Random(count), 0
    for _ in range(count):
        if chance.random() < 0.6:
            refused += bool(check(place, lambda content: replaced(chance, content)))
        else:
            refused += bool(check(place, nothing, lambda file: damaged_column(chance, file)))
    assert refused > count / 4
