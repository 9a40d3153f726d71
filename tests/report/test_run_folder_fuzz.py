"""Run folders that were damaged: report, watch and paraview show what is there, and never fall."""

import contextlib
import json
import math
import os
import random
import shutil

import pytest

from mufe_fenicsx.cli.watch import _line, _panel
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output.run_kinds import sorted_out
from mufe_fenicsx.report.parts import TABLES, Job, draw_job
from mufe_fenicsx.results import Run
from mufe_fenicsx.results.watch import Watch
from tests.geometry.image.test_image_door import in_time
from tests.made_up_run import write_whole_run

#: What may stand in place of any value of JSON.
VALUES = [None, True, "text", "", "\x1b[2J", "9" * 3000, -1, 0, 1e308, math.nan, math.inf, 10**40,
          [], {}, [None], {"a": []}, [[[]]], ["x"] * 50, {"name": 1, "step": "a"}]  # fmt: skip
CELLS = ["", "nan", "inf", "-1", "0", "1e300", "text", "999999999", "=1+1", "1;2", "a,b", '"']
TABLES_OF_CONTACTS = ("contacts/contacts_0001.csv", "contacts/contacts_0002.csv",
                      "contacts/grains_0001.csv", "contacts/grains_0002.csv",
                      "contacts/patches_0001.csv", "contacts/patches_0002.csv")  # fmt: skip


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A made-up run that lacks nothing."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    folder.mkdir()
    write_whole_run(folder, n=2)
    return folder


def damage_json(chance, path):
    """One to three entries of JSON, at any depth, are others; or the text is cut or nested."""
    if not path.is_file():  # any more
        return
    text = path.read_text(encoding="utf-8")
    what = chance.random()
    if what < 0.1:
        path.write_text(text[: chance.randrange(len(text))], encoding="utf-8")
        return
    if what < 0.15:
        path.write_text("[" * 5000 + "]" * 5000, encoding="utf-8")
        return
    content = json.loads(text)
    for _ in range(chance.randint(1, 3)):
        at = content
        while True:
            keys = list(at) if isinstance(at, dict) else list(range(len(at)))
            if not keys:
                break
            key = chance.choice(keys)
            if isinstance(at[key], dict | list) and chance.random() < 0.6:
                at = at[key]
                continue
            if isinstance(at, dict) and chance.random() < 0.2:
                del at[key]
            else:
                at[key] = chance.choice(VALUES)
            break
    path.write_text(json.dumps(content), encoding="utf-8")


def damage_table(chance, path):
    """Cells, rows and columns of a CSV file are others or gone, or bytes of it."""
    if not path.is_file():
        return
    lines = path.read_text(encoding="utf-8").splitlines()
    what = chance.random()
    if len(lines) < 3:
        return
    if what < 0.6:
        for _ in range(chance.randint(1, 3)):
            at = chance.randrange(1, len(lines))
            cells = lines[at].split(",")
            cells[chance.randrange(len(cells))] = chance.choice(CELLS)
            lines[at] = ",".join(cells)
    elif what < 0.75:
        column = chance.randrange(len(lines[0].split(",")))
        rows = [line.split(",") for line in lines]
        lines = [",".join(row[:column] + row[column + 1 :]) for row in rows]
    elif what < 0.85:
        lines = lines[: chance.randrange(len(lines))]
    elif what < 0.9:
        lines.insert(chance.randrange(len(lines)), chance.choice(lines))
    else:
        data = bytearray(path.read_bytes())
        for _ in range(chance.randint(1, 8)):
            data[chance.randrange(len(data))] = chance.randrange(256)
        path.write_bytes(data)
        return
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def damaged(chance, whole, folder):
    """A copy of a run with one to three damaged files."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(whole, folder)
    for _ in range(chance.randint(1, 3)):
        what = chance.random()
        with contextlib.suppress(FileNotFoundError, ValueError, RecursionError):
            _damage(chance, folder, what)


def _damage(chance, folder, what):
    if what < 0.45:
        damage_json(chance, folder / "run.json")
    elif what < 0.55:
        damage_json(chance, folder / "fields" / "states.vtkhdf.series")
    elif what < 0.65:
        damage_table(chance, folder / "history.csv")
    elif what < 0.95:
        damage_table(chance, folder / chance.choice(TABLES_OF_CONTACTS))
    else:
        path = folder / chance.choice(["run.json", "history.csv", "scene.toml"])
        path.unlink(missing_ok=True)
        chance.choice([lambda: None, path.mkdir, lambda: os.mkfifo(path)])()


def look(folder):
    """All that looks at a run, but for pictures; InputErrors are answers of one line."""
    watched = Watch(folder).look()
    json.dumps(watched.as_dict(), allow_nan=True)
    _line(watched), _panel(watched)
    run = Run(folder)
    for sentence in run.missing:
        assert "\n" not in sentence and len(sentence) < 3000
    for read in (run.network, run.contact_ages, run.stresses, run.wall_friction, run.grain_table):
        try:
            read()
        except InputError as error:
            assert "\n" not in str(error)


def test_what_no_page_can_count_with_is_left_out():
    """Integers beyond 64 bits, and text among the numbers of contact."""
    run = {"reference_height": 10**40, "contact": {"num_closed": "few"}, "strain": 0.1}
    assert sorted_out(run) == ({"strain": 0.1}, ["reference_height", "contact"])


def test_damaged_run_folders_are_looked_at(whole, tmp_path):
    chance, folder = random.Random(40), tmp_path / "run"
    for number in range(25):
        damaged(chance, whole, folder)
        try:
            with in_time(120):  # a machine with other programs
                look(folder)
        except InputError as error:
            assert "\n" not in str(error), number
        except Exception as error:
            raise AssertionError(f"run folder {number}: {error!r}") from error


def test_what_is_damaged_is_said_and_the_rest_is_shown(whole, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(whole, folder)
    content = json.loads((folder / "run.json").read_text())
    content |= {"wall_s": math.nan, "num_cells": "many", "stages": {"a": 1}, "finished": "yes"}
    (folder / "run.json").write_text(json.dumps(content))
    run = Run(folder)
    assert run.summary["num_grains"] == content["num_grains"] and "wall_s" not in run.summary
    assert "run.json: finished, num_cells, stages, wall_s, which is not what" in run.missing[0]
    job = Job((TABLES,), folder, tmp_path, None, None, 45.0, (), None)
    (tables,) = draw_job(job)
    assert any(heading == "Run" for heading, *_ in tables.content)


FILES = ["run.json", "scene.toml", "history.csv", "fields/states.vtkhdf.series",
         "fields/0001.vtkhdf", *TABLES_OF_CONTACTS]  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_pipes_are_not_waited_for(whole, tmp_path, name):
    folder = tmp_path / "run"
    shutil.copytree(whole, folder)
    (folder / name).unlink()
    os.mkfifo(folder / name)
    with in_time(120), contextlib.suppress(InputError):
        look(folder)
