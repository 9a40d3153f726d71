"""Tools of scenes: what a run writes of them, resumed and on several ranks."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.measure import boundary_triangles
from mufe_fenicsx.geometry.tets.foreign import write_surface
from mufe_fenicsx.output.fields import read_state
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.run.opened import open_run
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.run.scene_tools import read_path, read_tools
from mufe_fenicsx.scene import load_scene, scene_to_toml
from tests.plates import ROCK, write_plate_and_spheres
from tests.ranks import on_first

COMM = MPI.COMM_WORLD

SCENE = (
    ROCK
    + """
[contact]
friction = 0.4
wall_friction = 0.2

[[tool]]
name = "pusher"
surface = "plate.stl"
unit = "1 mm"
turned = [0, "-90 deg", 0]
position = ["80 um", "-0.5 mm", "-0.5 mm"]
path = "path.csv"
friction = 0.3

[[tool]]
name = "lid"
surface = "plate.stl"
unit = "1 mm"
position = ["-0.5 mm", "-0.5 mm", "4.001 mm"]
free = "z"
force = [0, 0, "-2 kN"]

[loading]
speed = "1 m/s"

[[stage]]
name = "push"
until = { time = "1.5 us" }

[[stage]]
name = "load"
until = { time = "1.5 us" }
tools.lid = { force = [0, 0, "-3 kN"], ramp = "1 us" }

[output]
fields = 3
history = 21
"""
)
PATH = "time,x\n0,0\n1e-6,0\n3e-6,2e-5\n"


@pytest.fixture
def folder(tmp_path_factory):
    """A folder that all ranks share: two layers of spheres, a plate and a path."""

    def made():
        path = tmp_path_factory.mktemp("tools")
        write_plate_and_spheres(path)
        (path / "path.csv").write_text(PATH)
        (path / "scene.toml").write_text(SCENE)
        return path

    return on_first(COMM, made)


def run(folder, name, comm=COMM, **options):
    scene = load_scene(folder / "scene.toml")
    return run_scene(scene, folder / "grains", folder / name, comm, quiet=True, **options)


def _values(dataset):
    """Bytes of numbers, in which nan equals itself; texts as such."""
    values = np.asarray(dataset[()])
    return values.tolist() if values.dtype == object else values.tobytes()


def contents(path):
    """All arrays and texts of a run that hold results; run.json tells times of the clock.

    Not the bytes of the files of arrays: ranks that write one together place them as they come.
    """
    found = {}
    for file in path.rglob("*"):
        name = str(file.relative_to(path))
        if not file.is_file() or "checkpoints" in file.parts or file.name == "run.json":
            continue
        if file.suffix in (".vtkhdf", ".h5"):
            with h5py.File(file) as opened:
                opened.visititems(lambda key, item, name=name: found.update(
                    {(name, key): _values(item)} if isinstance(item, h5py.Dataset) else {}
                ))  # fmt: skip
        else:
            found[name] = file.read_bytes()
    return found


@pytest.mark.mpi
def test_tools_of_a_scene(folder):
    """One run, one that stops and goes on with the same bytes, and one on a single rank."""
    whole = run(folder, "whole")
    run(folder, "parts", max_steps=70)
    run(folder, "parts", resume=True)

    def compared():
        run(folder, "alone", MPI.COMM_SELF)
        assert contents(folder / "whole") == contents(folder / "parts")
        for name, (one, many) in columns(folder / "alone", folder / "whole").items():
            # Sums over ranks round in another order, and steps amplify that.
            assert np.allclose(one, many, rtol=0, atol=1e-6 * (np.abs(one).max() or 1.0)), name
        look_at(folder / "whole", whole)

    on_first(COMM, compared)
    assert whole["num_grains"] == 8 and [t["name"] for t in whole["tools"]] == ["pusher", "lid"]


def columns(*folders):
    """Columns of numbers of histories, name -> arrays of the folders."""
    tables = [read_history(folder / "history.csv") for folder in folders]
    numbers = [name for name, values in tables[0].items() if values.dtype.kind == "f"]
    return {name: [table[name] for table in tables] for name in numbers}


def look_at(path, summary):
    """Balance, loads against what carries them, and that tools are counted as no grains."""
    history = read_history(path / "history.csv")
    assert abs(history["residual"][-1]) < 1e-3 * history["work"][-1]
    assert history["displacement_pusher_x"][-1] == pytest.approx(
        np.interp(history["time"][-1], [1e-6, 3e-6], [0, 2e-5]), abs=1e-15
    )
    assert history["force_pusher_x"][-1] < -1.0 and history["force_lid_z"].max() > 100.0
    assert not history["force_pusher_x"][history["time"] < 1e-6].any()
    last = summary["tools"][0]
    assert last["force"][0] == history["force_pusher_x"][-1]
    opened = open_run(path)
    contacts, grains = opened.contacts(2), opened.grains(2)
    on_pusher = contacts[contacts["wall"] == "pusher"]
    assert len(grains) == 8 and len(on_pusher)
    # What the contacts list is what the tool feels.
    assert -on_pusher["force_x"].sum() == pytest.approx(last["force"][0], rel=1e-9)
    state = read_state(path, 2)
    assert set(state["grain"]) == set(range(1, 9))
    with h5py.File(path / "tools" / "0002.vtkhdf") as file:
        tool = file["VTKHDF/CellData/tool"][:]
        assert np.bincount(tool).tolist() == [12, 12]
        points = file["VTKHDF/Points"][:]
        corner = file["VTKHDF/Polygons/Connectivity"][:].reshape(-1, 3)[tool == 0].ravel()
    front = last["displacement"][0] + 80e-6
    assert points[corner, 0].max() == pytest.approx(front, rel=1e-6)


def test_a_scene_with_tools_comes_back_from_its_text(folder):
    scene = load_scene(folder / "scene.toml")
    again = folder / f"again-{COMM.rank}.toml"
    again.write_text(scene_to_toml(scene))
    assert load_scene(again).tools == scene.tools
    assert scene.tools[0].turned[1] == pytest.approx(-np.pi / 2)
    assert scene.tools[1].friction == 0.2 and scene.tools[1].freedoms == ("z",)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "lid"', 'name = "pusher"', r'tool\[2\].name = "pusher", expected names that'),
        ('name = "lid"', 'name = "x_max"', r'tool\[2\].name = "x_max", expected letters'),
        ('free = "z"', 'free = "z w"', r"tool\[2\].free = w, expected some of x y z"),
        ('friction = 0.3', "friction = -0.3", r"tool\[1\].friction = -0.3, expected >= 0"),
        ('unit = "1 mm"\nturned', 'unit = "1 kg"\nturned', r'tool\[1\].unit = "1 kg", expected a'),
        ('free = "z"\n', "", "has a load along z, expected none of what is told"),
        ("plate.stl", "path.csv", r"no surfaces|expected|cannot be read"),
        ("[loading]", '[solver]\nintegrator = "implicit"\n[loading]', "expected"),
        ("tools.lid", "tools.led", r"stage\[2\].tools.led is no tool, expected pusher, lid"),
        ("tools.lid", "tools.pusher", "tools.pusher has a load along z, expected none of what is"),
        ("[[stage]]", "[mass_scaling]\nadded = 0.1\n[[stage]]", r"expected none with \[\[tool\]\]"),
    ],
)  # fmt: skip
def test_what_a_scene_with_tools_cannot_say(folder, old, new, message):
    """Before anything is written, on all ranks."""
    text = SCENE.replace(old, new, 1)
    path = Path(folder / f"wrong-{COMM.rank}.toml")
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        run_scene(load_scene(path), folder / "grains", folder / "wrong", COMM, quiet=True)
    assert not (folder / "wrong").exists()


def test_paths_that_are_none(folder):
    for text, message in (
        ("time,q\n0,0\n1,1\n", '"q" is not a known column, expected one of time, x, y'),
        ("time,x\n0,a\n1,1\n", 'x = "a", expected a finite number'),
        ("time,x\n0,0\n0,1\n", "line 3: time = 0, expected more than 0"),
        ("time,x\n1,1\n2,1\n", "first row of a path = .*, expected zeros"),
    ):
        on_first(COMM, lambda text=text: (folder / "path.csv").write_text(text))
        with pytest.raises(InputError, match=message):
            run(folder, "wrong")
        COMM.Barrier()


def test_a_path_is_written_as_what_stages_follow(tmp_path):
    """Comments and units had been refused, and a last line without its end lost."""
    path = tmp_path / "path.csv"
    path.write_text("# a test\ntime [ms], x [mm], rz [deg]\n0, 0, 0\n\n2, 1, 90")
    found = read_path(path)
    assert found.time.tolist() == [0, 2e-3]
    assert found.at(1.0) == pytest.approx([1e-3, 0, 0, 0, 0, np.pi / 2])


def test_run_json_of_a_run_without_tools_says_nothing(folder):
    def alone():
        text = SCENE[: SCENE.index("[[tool]]")] + SCENE[SCENE.index("[loading]") :]
        text = text.replace("tools.lid", "# tools.lid")
        (folder / "plain.toml").write_text(text)
        scene = load_scene(folder / "plain.toml")
        run_scene(
            scene, folder / "grains", folder / "plain", MPI.COMM_SELF, quiet=True, max_steps=2
        )
        assert "tools" not in json.loads((folder / "plain" / "run.json").read_text())
        assert not (folder / "plain" / "tools").exists()

    on_first(COMM, alone)


def test_a_run_goes_on_with_the_files_of_its_tools_alone(folder):
    """Another surface or path, or one that is gone, is said in a line; the first ones do."""
    run(folder, "out", max_steps=5)
    for file, text, message in (
        ("plate.stl", "solid\nendsolid\n", "surface of tool pusher is another file than that of"),
        ("plate.stl", None, "tool pusher: .*plate.stl cannot be read"),
        ("path.csv", PATH + "4e-6,3e-5\n", "path of tool pusher is another file than that of"),
        ("path.csv", None, "tool pusher: .*path.csv cannot be read"),
    ):
        kept = on_first(COMM, (folder / file).read_bytes)
        on_first(COMM, lambda file=file, text=text: replaced(folder / file, text))
        with pytest.raises(InputError, match=message):
            run(folder, "out", resume=True, max_steps=7)
        on_first(COMM, lambda file=file, kept=kept: (folder / file).write_bytes(kept))
    assert run(folder, "out", resume=True, max_steps=7)["num_steps"] == 7


def replaced(path, text):
    path.unlink()
    if text is not None:
        path.write_text(text)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("plate.stl", "none.stl", "tool pusher: .*none.stl cannot be read .No such file"),
        ("plate.stl", "plate.step", "plate.step, expected a file of .stl, .ply"),
        ("plate.stl", "empty.stl", "empty.stl holds no triangle"),
        ("plate.stl", "open.stl", "open.stl is open, expected a closed one, or a thickness"),
        ("plate.stl", "nan.stl", "nan.stl has 1 points that are not finite, expected none"),
        ("plate.stl", "two.stl", "two.stl has 2 parts, expected one body"),
        ('"1 mm"', '"1 m"', "tool pusher is 5 m across, the grains 0.004 m, expected between"),
        ('"1 mm"', '"1 um"', "tool pusher is 5e-06 m across, the grains 0.004 m, expected"),
        ('"80 um"', '"80 m"', "tool pusher is 80 m away from the grains, expected at most 0.4 m"),
    ],
)
def test_surfaces_that_are_no_tools(folder, old, new, message):
    """One line on all ranks before anything is written, and from the check of a scene too."""
    scene = folder / f"wrong-{COMM.rank}.toml"
    scene.write_text(SCENE.replace(old, new, 1))
    on_first(COMM, lambda: write_bad_surfaces(folder))
    with pytest.raises(InputError, match=message):
        run_scene(load_scene(scene), folder / "grains", folder / "wrong", COMM, quiet=True)
    assert not (folder / "wrong").exists()
    if new.endswith(("stl", "step")):
        with pytest.raises(InputError, match=message.replace(" .No such", ".*No such")):
            read_tools(load_scene(scene))


def write_bad_surfaces(folder):
    points, cells = box((5.0, 5.0, 0.5), (1, 1, 1))
    triangles = boundary_triangles(cells)
    (folder / "plate.step").write_text("")
    (folder / "empty.stl").write_text("")
    write_surface(folder / "open.stl", points, triangles[1:])
    both = np.vstack([points, points + 9.0])
    write_surface(folder / "two.stl", both, np.vstack([triangles, triangles + len(points)]))
    corners = points[triangles]
    corners[0, 0] = np.nan
    loops = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in corner)
        + "endloop\nendfacet\n"
        for corner in corners
    )
    (folder / "nan.stl").write_text(f"solid\n{loops}endsolid\n")
