"""What would take for ever, or lose all at its end, is known before: sizes, numbers, room."""

import os
import shutil
from collections import namedtuple
from dataclasses import replace

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies import tool_body
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.geometry.image.labels import plain_labels
from mufe_fenicsx.machine.files import new_files, new_folder
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.output.checkpoint import Checkpoint
from mufe_fenicsx.run import run as run_module
from mufe_fenicsx.run.resume_check import check_origin
from mufe_fenicsx.run.scene_tools import checksums_of_files
from mufe_fenicsx.scene import Axis, Contact, Loading, Oedometer, Scene, Stage, Tool, scene_to_toml
from tests.bodies import RADIUS, packed_grains

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)

ROCK = Elastic(100e9, 0.15, 2650.0)
SCENE = Scene(material=ROCK, contact=Contact(0.3), oedometer=Oedometer(0.1, 2.0))
Room = namedtuple("Room", "total used free")


def test_cycles_are_bounded_before_they_are_written_out():
    stages = [Stage(f"s{k}", z=Axis(strain=0.1), repeat=10_000) for k in range(300)]
    with pytest.raises(InputError, match=r"stage\[2\].repeat = 10000 of 1 stages, expected"):
        Scene(material=ROCK, contact=Contact(0.3), loading=Loading(2.0), stages=tuple(stages))


def test_a_file_larger_than_memory_is_not_read(tmp_path):
    """A sparse one takes no room on the disk."""
    path = tmp_path / "large.stl"
    path.touch()
    os.truncate(path, 10**12)
    tool = Tool(name="tool", surface=path)
    for read in (
        lambda: tool_body.read_tool(path),
        lambda: checksums_of_files(MPI.COMM_SELF, replace(SCENE, tools=(tool,))),
    ):
        with pytest.raises(InputError, match=r"large.stl takes 4e\+03 GB, expected at most the"):
            read()


def test_a_tool_of_too_many_facets_is_refused(tmp_path, monkeypatch):
    (tmp_path / "tool.off").write_text(
        "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
    )
    assert len(tool_body.read_tool(tmp_path / "tool.off")[1]) > 0
    monkeypatch.setattr(tool_body, "MOST_FACETS", 3)
    with pytest.raises(InputError, match=r"tool.off has 4 facets, expected at most 3: thin them"):
        tool_body.read_tool(tmp_path / "tool.off")


def test_a_disk_without_room_for_checkpoints_is_told_at_the_start(tmp_path, monkeypatch):
    """And nothing is left of the run."""
    save_grains(tmp_path / "grains", packed_grains((2, 1, 1), h=RADIUS))
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Room(1e9, 1e9, 1000))
    monkeypatch.setattr(run_module, "draw_report", None)
    with pytest.raises(InputError, match=r"free room in .*out = 0.001 MB, expected at least"):
        run_module.run_scene(
            SCENE, tmp_path / "grains", tmp_path / "out", MPI.COMM_SELF, quiet=True, max_steps=1
        )
    assert not (tmp_path / "out").exists()


def test_what_changed_of_a_tool_is_named(tmp_path):
    def text(**given):
        return scene_to_toml(replace(SCENE, tools=(Tool("t", tmp_path / "t.stl", **given),)))

    header = {"tools": {}, "state": {}, "loading": {}, "recorder": {}, "written_by": [],
              "rank_of_grain": [], "retries": [], "resumed_at_steps": [], "step": 1,
              "balanced_at_steps": [], "strain": 0.0, "wall_s": 0.0, "setup_s": 0.0,
              "separation": None, "grains": "", "scene": text()}  # fmt: skip
    found = Checkpoint(tmp_path, 1, header)
    now = {"scene": text(velocity=(0.0, 0.0, 1.0)), "grains": "", "tools": {}}
    with pytest.raises(InputError, match=r"tool\[1\].velocity = \[0.0, 0.0, 1.0\], was \[0.0, 0.0"):
        check_origin(MPI.COMM_SELF, found, now, tmp_path, True)


def test_true_and_false_are_labels():
    """Of one grain: they count as 0 and 1."""
    labels = plain_labels(np.ones((2, 2, 2), dtype=bool))
    assert labels.dtype.kind in "iu" and (labels == 1).all()


@pytest.mark.parametrize("make", [new_folder, new_files])
def test_a_refusal_leaves_no_folders(tmp_path, make):
    with pytest.raises(KeyError), make(tmp_path / "deep" / "er" / "x"):
        raise KeyError
    assert list(tmp_path.iterdir()) == []
    with make(tmp_path / "deep" / "er" / "x") as temporary:
        (temporary / "x").write_text("text")
    assert (tmp_path / "deep" / "er" / "x").exists()


def test_a_folder_that_is_a_link_is_not_replaced(tmp_path):
    (tmp_path / "outside").mkdir()
    (tmp_path / "x").symlink_to(tmp_path / "outside")
    with pytest.raises(InputError, match=r"x is a symbolic link, expected a folder"):
        with new_folder(tmp_path / "x", overwrite=True):
            pass
