"""Links in a folder of results lead nothing out of it: by every name that a command writes."""

import contextlib
import os
import shutil

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.geometry.image.label_files import write_labels, write_table
from mufe_fenicsx.machine.files import append_line
from mufe_fenicsx.report.paraview import write_paraview
from mufe_fenicsx.report.write import write_report
from mufe_fenicsx.results import Run
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import load_scene
from tests.bodies import RADIUS, packed_grains
from tests.scene.scene_files import UNLOADED

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)

#: A state and a row at the start and the second step.
SCENE = (
    UNLOADED
    + """
[loading]
speed = 2.0
[[stage]]
until = { time = 1e-3 }
[output]
fields = 100000
history = 100000
"""
)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with grains, a scene, and a run of a step with its report and for ParaView."""
    path = tmp_path_factory.mktemp("links")
    save_grains(path / "grains", packed_grains((2, 1, 1), gap=0.1 * RADIUS, h=RADIUS))
    (path / "scene.toml").write_text(SCENE)
    for command in (start, report, paraview):
        command(path, path / "run")
    (path / "run" / "retries.log").touch()
    return path


def start(place, folder, **options):
    scene = load_scene(place / "scene.toml")
    options = {"max_steps": 1, "quiet": True} | options
    run_scene(scene, place / "grains", folder, MPI.COMM_SELF, **options)


def overwrite(place, folder):
    start(place, folder, overwrite=True)


def resume(place, folder):
    start(place, folder, max_steps=2, resume=True)
    append_line(MPI.COMM_SELF, folder / "retries.log", "a retry")


def report(place, folder):
    write_report(folder, only=["stress-strain", "contact-age"])


def paraview(place, folder):
    write_paraview(Run(folder))


def written(place, command):
    """Names of files and folders in the folder of the run that a command changes."""
    folder = place / "watched"
    shutil.copytree(place / "run", folder)
    before = stamps(folder)
    command(place, folder)
    after = stamps(folder)
    shutil.rmtree(folder)
    return sorted(name for name in after if after[name] != before.get(name))


def stamps(folder):
    found = {p.relative_to(folder).as_posix(): p.stat() for p in folder.rglob("*")}
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in found.items()}


def tree(folder):
    return {p: p.is_file() and p.read_bytes() for p in folder.rglob("*")}


@pytest.mark.parametrize("command", [overwrite, resume, report, paraview])
def test_nothing_is_written_through_links(place, command):
    """Each name that a command writes leads elsewhere: that place stays as it is.

    What refuses none of its own names, but removes them, meets all at once.
    """
    names = written(place, command)
    assert len(names) > 3
    folders = [name for name in names if (place / "run" / name).is_dir()]
    single = [name for name in names if name not in folders]
    each = [single] if command is overwrite else [[name] for name in single]
    for link, groups in ((os.symlink, each + [[n] for n in folders]), (os.link, [single])):
        for group in groups:
            put_links_and_call(place, command, group, link)
    put_links_and_call(place, command, [name + ".part" for name in names], os.symlink)


def put_links_and_call(place, command, names, link):
    folder, outside = place / "linked", place / "outside"
    shutil.copytree(place / "run", folder)
    outside.mkdir()
    for number, path in enumerate(folder / name for name in names):
        there = outside / str(number)
        if path.is_dir():
            os.rename(path, there)
            path.symlink_to(there)
        elif path.parent.is_dir():
            there.write_bytes(path.read_bytes() if path.exists() else b"precious")
            path.unlink(missing_ok=True)
            link(there, path)
    before, said = tree(outside), None
    try:
        command(place, folder)
    except InputError as error:
        said = str(error)
    assert tree(outside) == before, (names, link)
    assert said is None or "link" in said, (names, link, said)
    shutil.rmtree(folder)
    shutil.rmtree(outside)


@pytest.mark.parametrize("name", ["grains.h5", "grains.xdmf", "labels.tif", "labels.csv"])
@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_functions_of_python_write_through_no_link(tmp_path, name, link):
    outside, folder = tmp_path / "outside", tmp_path / "folder"
    folder.mkdir()
    outside.write_bytes(b"precious")
    link(outside, folder / name)
    write = {
        ".tif": lambda path: write_labels(path, np.ones((2, 2, 2), dtype=int), 1e-6),
        ".csv": lambda path: write_table(path, [{"label": 1}]),
    }.get(name[-4:], lambda path: save_grains(path.parent, packed_grains((1, 1, 1))))
    with contextlib.suppress(InputError):
        write(folder / name)
    assert outside.read_bytes() == b"precious"
    assert not list(folder.glob("*.part"))
