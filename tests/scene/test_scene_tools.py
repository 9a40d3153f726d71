"""Schema, explanations and new scenes: what they say is what the program takes."""

import json
import shutil
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import tifffile
from mpi4py import MPI

from mufe_fenicsx.cli.main import main
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import load_scene, scene_to_toml
from mufe_fenicsx.scene.explanations import explain, tables
from mufe_fenicsx.scene.schema import scene_schema
from mufe_fenicsx.synthetic.scene_text import scene_text
from mufe_fenicsx.synthetic.settings import SynthesisSettings
from mufe_fenicsx.synthetic.starter_scenes import KINDS
from mufe_fenicsx.units import keys_of
from tests.loading import test_stages
from tests.scene import scene_files

ROOT = Path(__file__).resolve().parents[2]
SCENES = {path.name: path.read_text() for path in ROOT.glob("demos/*.toml")}
SCENES |= {f"new {kind}": text for kind, (text, _) in KINDS.items()}
SCENES |= {"synthetic": scene_text(SynthesisSettings())}
SCENES |= {
    "small": scene_files.SMALLEST,
    "planned": "accuracy = 0.05\nmodulus = '300 MPa'\n" + scene_files.SMALLEST,
    "full": scene_files.FULL,
    "stages": test_stages.TEXT,
}


@pytest.fixture(scope="module")
def validator():
    schema = scene_schema()
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


def check(validator, text):
    return [error.message for error in validator.iter_errors(tomllib.loads(text))]


@pytest.mark.parametrize("name", SCENES)
def test_schema_takes_every_scene_and_its_written_form(validator, name, tmp_path):
    assert check(validator, SCENES[name]) == []
    path = tmp_path / "scene.toml"
    path.write_text(SCENES[name], encoding="utf-8")
    assert check(validator, scene_to_toml(load_scene(path))) == []


@pytest.mark.parametrize(
    "old, new",
    [
        ("friction = 0.23", "frition = 0.23"),  # unknown key
        ("strain = 0.1", "strain = 1.5"),  # bound from the check of the class
        ("[material]", "accuracy = 2\n[material]"),  # outside of the tables
        ("strain = 0.1", ""),  # required
        ("[oedometer]", "[contact.pairs]\nmaterial-material = -1\n[oedometer]"),
        ("[oedometer]", "[contact.pairs]\nmaterial-material = true\n[oedometer]"),
        ("[oedometer]", "[contact.pairs]\nmaterial-material = {}\n[oedometer]"),
        ("speed = 2", 'speed = "fast"'),  # no number with a unit
        ("speed = 2", "speed = true"),
        ("[contact]", "[contact]\nlaw = 'hard'"),  # one of some texts
        ("[material]", "[material]\nmodel = 'elastic'"),  # with a yield stress
        ("[oedometer]", "[loading]\nspeed = 1\n[oedometer]"),  # two tests
    ],
)
def test_schema_refuses_what_the_program_refuses(validator, tmp_path, old, new):
    text = scene_files.SMALLEST.replace(old, new, 1)
    path = tmp_path / "scene.toml"
    path.write_text(text)
    with pytest.raises(InputError):
        load_scene(path)
    assert check(validator, text)


def test_every_key_is_documented():
    """A key without its meaning beside it would be one without an explanation."""
    silent = [
        f"{table}.{key.name}"
        for table, cls in tables().items()
        for key in keys_of(cls).values()
        if len(key.text) < 4
    ]
    assert silent == []


@pytest.mark.parametrize(
    "name, words",
    [
        ("oedometer.speed", ["of the top platen", "10 mm/s", "> 0", "has to be given"]),
        ("contact.points", ['"facets" or "facets4" or "nodes"', "left out: facets"]),
        ("solver.time_step_factor", ["> 0 and < 1", "left out: 0.9"]),
        ("contact.pairs", ["NAME-NAME in either order", "[contact.pairs.NAME]"]),
        ("contact.pairs.a-b.friction_kinetic", ["while they slip"]),
        ("walls.x_min.stress", ["mean pressure", "a stress such as"]),
        ("stage.z.stress", ["to hold from then on"]),
        ("materials.soft.E", ["Young's modulus"]),
        ("output", ["checkpoint_strain", "rows of history.csv"]),
        ("compliance", ["contact.compliance"]),
        ("accuracy", ["wanted error", "> 0 and < 1", "left out: not set"]),
        ("title", ["a text", "left out: not set"]),
    ],
)
def test_explanations(name, words):
    text = "\n".join(explain(name))
    assert all(word in text for word in words), text


def mufe(*arguments):
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return end.value.code


def test_commands(tmp_path, capsys):
    path = tmp_path / "schema.json"
    assert mufe("scene", "--schema", "-o", path) == 0
    assert json.loads(path.read_text()) == json.loads(json.dumps(scene_schema()))
    assert mufe("scene", "--explain", "oedometer.spead") == 2
    assert "expected oedometer.speed" in capsys.readouterr().err
    assert mufe("scene") == 2 and "expected SCENE" in capsys.readouterr().err
    assert mufe("scene", "x.toml", "--schema") == 2 and "expected" in capsys.readouterr().err
    scene = tmp_path / "a/scene.toml"
    assert mufe("new", "crushing", "-o", tmp_path / "a") == 0
    assert mufe("scene", scene, "--set", "stage.2.z.strain=0.02", "--set", "fracture.seed=7") == 0
    said = capsys.readouterr().out
    assert "z = { strain = 0.02" in said and "seed = 7" in said
    assert mufe("scene", scene, "--explain", "fracture", "--set", "fracture.seed=7") == 2
    assert "--set beside" in capsys.readouterr().err
    assert mufe("new", "oedometr", "-o", tmp_path / "x") == 2
    assert "expected oedometer" in capsys.readouterr().err and not (tmp_path / "x").exists()


def test_a_copied_scene_finds_its_schema_or_says_how_to_get_one(tmp_path, capsys):
    assert mufe("new", "scan", "-o", tmp_path / "a b") == 0
    (tmp_path / "else").mkdir()
    copy = Path(shutil.copy(tmp_path / "a b/scene.toml", tmp_path / "else/mine.toml"))
    capsys.readouterr()
    assert mufe("scene", copy) == 0 and "schema" not in capsys.readouterr().err
    (tmp_path / "a b").rename(tmp_path / "moved")
    assert mufe("scene", copy) == 0
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and f"`mufe scene --schema -o {tmp_path}/else/scene" in told


def test_an_explanation_beside_a_file_tells_what_it_says(tmp_path, capsys):
    path = tmp_path / "a.toml"
    path.write_text(
        '[material]\nmodel = "elastic"\nE = "1 GPa"\nnu = 0.2\nrho = 2650\n'
        "[contact]\nfriction = 0.5\n[walls.x_min]\nfriction = 0.1\n[loading]\nspeed = 1.0\n"
        '[[stage]]\nz.strain = 0.01\n[[stage]]\nz.stress = "1 MPa"\n'
    )
    for name, expected in (
        ("friction", ["contact.friction = 0.5", "walls.x_min.friction = 0.1"]),
        ("stage.z", ["stage[0].z.strain = 0.01", 'stage[1].z.stress = "1 MPa"']),
        ("walls.x_min", ["walls.x_min.friction = 0.1"]),
        ("stage.hold", []),
    ):
        assert mufe("scene", path, "--explain", name) == 0
        _, said, lines = capsys.readouterr().out.partition(f"{path} says:")
        assert [line.strip() for line in lines.splitlines() if line] == expected
        assert bool(said) == bool(expected)


def test_a_new_scene_of_a_scan_segments_it(tmp_path, monkeypatch, capsys):
    """Two bright balls in a dark image; its crop is made smaller to be quick."""
    folder = tmp_path / "mine"
    assert mufe("new", "scan", "-o", folder) == 0
    assert "mufe segment" in capsys.readouterr().out
    assert sorted(path.name for path in folder.iterdir()) == ["scene.schema.json", "scene.toml"]
    text = (folder / "scene.toml").read_text()
    (folder / "scene.toml").write_text(text.replace("100]", "28]"))
    z, y, x = np.mgrid[:28, :28, :28]
    balls = [(z - 14) ** 2 + (y - 14) ** 2 + (x - at) ** 2 < 36 for at in (7, 21)]
    tifffile.imwrite(folder / "scan.tif", np.where(balls[0] | balls[1], 200, 20).astype(np.uint8))
    monkeypatch.chdir(folder)
    assert mufe("segment", "--scene", "scene.toml", "-o", "labels.tif", "--json", "s.json") == 0
    assert json.loads((folder / "s.json").read_text())["num_grains"] == 2


@pytest.mark.parametrize("kind", [kind for kind, (_, make) in KINDS.items() if make])
def test_new_scenes_run(kind, tmp_path):
    folder = tmp_path / "test"
    assert mufe("new", kind, "-o", folder) == 0
    first = (folder / "scene.toml").read_text().partition("\n")[0]
    assert Path(first.removeprefix("#:schema file://")).is_file()  # wherever it is copied to
    scene = load_scene(folder / "scene.toml")
    out = folder / "results"
    result = run_scene(scene, scene.sample.grains, out, MPI.COMM_SELF, max_steps=40, quiet=True)
    assert result["num_steps"] == 40 and (out / "history.csv").is_file()
