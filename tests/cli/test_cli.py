"""The command line: what a user can do wrong ends in one line, status 2, and no output.

Where several ranks or the state of a process matter, a command is a process of its own, as a
user would start it; elsewhere the test calls `main`, which is quicker.
"""

import json
import math
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import meshio
import numpy as np
import pytest

import mufe_fenicsx.geometry.grains as grain_files
from mufe_fenicsx import __version__
from mufe_fenicsx.cli.arguments import known_names, parameters
from mufe_fenicsx.cli.main import main
from mufe_fenicsx.cli.summary_words import printed
from mufe_fenicsx.cli.terminal import Printer, plain, progress_bar
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.machine import doing
from mufe_fenicsx.machine.mpi_launcher import environment_without_launcher
from mufe_fenicsx.run.demo import demo_commands, demo_scene
from mufe_fenicsx.verification.case import case, compare
from mufe_fenicsx.verification.cases import CASES
from tests.cli.commands import FROM_HERE, assert_refused, complaints, run

SCENE = """
[material]
model = "elastic"
E = 100e9
nu = 0.15
rho = 2650
[contact]
friction = 0.23
[oedometer]
strain = 0.1
speed = 2
"""


@pytest.fixture
def mufe_here(monkeypatch, capfd):
    """Run `mufe` in this process."""

    def call(*arguments, cwd):
        monkeypatch.chdir(cwd)
        capfd.readouterr()
        with pytest.raises(SystemExit) as end:
            main([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        return subprocess.CompletedProcess(arguments, end.value.code, out, err)

    return call


@pytest.fixture
def inputs(tmp_path):
    """A folder of usable and unusable inputs, and an empty one to work in beside it."""
    folder, work = tmp_path / "inputs", tmp_path / "work"
    folder.mkdir()
    work.mkdir()
    rng = np.random.default_rng(1)
    grey = rng.integers(0, 255, (8, 9, 10)).astype(np.uint8)
    np.save(folder / "flat.npy", grey[0])
    np.save(folder / "constant.npy", np.full((8, 8, 8), 7, dtype=np.uint8))
    np.save(folder / "nan.npy", np.where(grey == grey.max(), np.nan, grey))
    np.savez(folder / "pickled.npz", grey=np.array([{"a": 1}], dtype=object))
    (folder / "text.tif").write_text("this is no image")

    box = np.zeros((12, 12, 24), dtype=np.int32)
    np.save(folder / "no_grain.npy", box)
    box[2:10, 2:10, 2:10] = 1
    box[2:10, 2:10, 14:22] = 2
    np.save(folder / "negative.npy", np.where(box == 2, -2, box))
    np.save(folder / "float.npy", box + 0.5)
    pieces = box.copy()
    pieces[2:10, 2:10, 5:7] = 0
    np.save(folder / "pieces.npy", pieces)
    thin = box.copy()
    thin[:, :, 12:] = 0
    thin[5, 2:10, 14:22] = 2
    np.save(folder / "thin.npy", thin)

    (folder / "scene.toml").write_text(SCENE)
    (folder / "unknown.toml").write_text(SCENE.replace("friction", "frition"))
    (folder / "unit.toml").write_text(SCENE.replace("speed = 2", 'speed = "5 kg"'))
    (folder / "nu.toml").write_text(SCENE.replace("0.15", "0.5"))
    (folder / "missing.toml").write_text(SCENE.replace("strain = 0.1", ""))
    grain_files.save_grains(folder / "grains", two_tetrahedra())
    return folder, work


def two_tetrahedra():
    """Two grains of one element each, apart from each other."""
    points = 1e-4 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    cells = np.array([[0, 1, 2, 3]])
    shifted = points + np.array([0, 0, 2e-4])
    return grain_files.Grains.from_list([1, 2], [(points, cells), (shifted, cells)], 1e-4)


def two_boxes():
    """A grey image of 12 x 12 x 24 voxels with two bright boxes of 8 x 8 x 8."""
    grey = np.full((12, 12, 24), 10, dtype=np.uint8)
    grey[2:10, 2:10, 2:10] = grey[2:10, 2:10, 14:22] = 200
    return grey


SEGMENT = [
    ("none.tif", "none.tif"),
    ("text.tif", "text.tif"),
    ("flat.npy", "flat.npy"),
    ("constant.npy", "constant"),
    ("nan.npy", "NaN"),
    ("pickled.npz", "pickled"),
]


@pytest.mark.parametrize("image, said", SEGMENT, ids=[image for image, _ in SEGMENT])
def test_image_that_cannot_be_used(inputs, mufe_here, image, said):
    folder, work = inputs
    result = mufe_here("segment", folder / image, "-o", "out.tif", "--voxel-size", "5 um", cwd=work)
    assert_refused(result, said, work, [])


MESH = [
    ("none.npy", "none.npy"),
    ("no_grain.npy", "no grain"),
    ("negative.npy", "-2"),
    ("float.npy", "float"),
    ("pieces.npy", "pieces"),
    ("thin.npy", "thin"),
]


@pytest.mark.parametrize("labels, said", MESH, ids=[labels for labels, _ in MESH])
def test_labels_that_cannot_be_used(inputs, mufe_here, labels, said):
    folder, work = inputs
    options = ("--voxel-size", "5 um", "--size", "10 um", "--processes", "1")
    result = mufe_here("mesh", folder / labels, "-o", "grains", *options, cwd=work)
    assert_refused(result, said, work, [])


def test_meshes_that_cannot_be_imported(inputs, mufe_here):
    folder, work = inputs
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    meshio.Mesh(points, [("tetra", np.array([[0, 1, 2, 3]] * 2))]).write(folder / "twice.vtu")
    result = mufe_here("import", folder / "twice.vtu", "-o", "grains", cwd=work)
    assert_refused(result, "1 cells that are there twice", work, [])
    (folder / "none.vtu").write_text("no mesh")
    result = mufe_here("import", folder / "none.vtu", "-o", "grains", cwd=work)
    assert_refused(result, "cannot be read", work, [])


RUN = [
    ("unknown.toml", "contact.frition = 0.23 is not a known key, expected contact.friction"),
    ("unit.toml", 'oedometer.speed = "5 kg", expected a speed'),
    ("nu.toml", "material.nu = 0.5, expected -1 < nu < 0.5"),
    ("missing.toml", "oedometer.strain is missing"),
    ("none.toml", "none.toml"),
]


@pytest.mark.parametrize("scene, said", RUN, ids=[scene for scene, _ in RUN])
def test_scene_that_cannot_be_used(inputs, mufe_here, scene, said):
    folder, work = inputs
    arguments = ("run", folder / scene, "--grains", folder / "grains", "-o", "results")
    assert_refused(mufe_here(*arguments, cwd=work), said, work, [])


def test_grains_that_are_not_there(inputs, mufe_here):
    folder, work = inputs
    for grains, said in ((("--grains", "none"), "none"), ((), "sample.grains is missing")):
        result = mufe_here("run", folder / "scene.toml", *grains, cwd=work)
        assert_refused(result, said, work, [])


def test_output_folder_that_is_not_empty(inputs, mufe_here):
    folder, work = inputs
    (work / "results").mkdir()
    (work / "results" / "mine.txt").write_text("keep")
    arguments = ("run", folder / "scene.toml", "--grains", folder / "grains", "-o", "results")
    result = mufe_here(*arguments, cwd=work)
    assert_refused(result, "expected a new one, or --overwrite to replace", work, ["results"])
    assert [path.name for path in (work / "results").iterdir()] == ["mine.txt"]


ON_TWO_RANKS = {
    "a scene, which all ranks read": ("run unknown.toml --grains grains", RUN[0][1]),
    "grains that are not there": ("run scene.toml --grains none", "none"),
    "more ranks than grains": ("run scene.toml --grains one", "number of ranks = 2, expected at m"),
    "a folder with other files": (
        "run scene.toml --grains grains -o results", "expected a new one, or --overwrite to replace"
    ),
    **{
        f"mufe {command}": (f"{command} {words}", f"mufe {command} on 2 ranks, expected one")
        for command, words in (
            ("segment", "a.tif -o x.tif"), ("mesh", "a.tif -o new"), ("report", "results"),
            ("demo", ""),
        )
    },
}  # fmt: skip

#: Calls `main` on each rank for one line of arguments after the other; what each said is kept.
EACH_BY_ALL = """
import contextlib, io, json, pathlib, sys
from mufe_fenicsx.cli.main import main
from mpi4py import MPI

said = []
for line in json.loads(sys.argv[1]):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(line.split())
        except SystemExit as end:
            status = end.code
    said.append([status, out.getvalue(), err.getvalue()])
pathlib.Path(f"said-{MPI.COMM_WORLD.rank}.json").write_text(json.dumps(said))
"""


def test_what_cannot_be_used_is_said_by_one_of_two_ranks(inputs):
    """Both end with status 2, rank 0 after its line, the other without a word."""
    folder, work = inputs
    tetrahedron = two_tetrahedra().grain(0)
    one_grain = grain_files.Grains.from_list([1], [tetrahedron], 1e-4)
    grain_files.save_grains(folder / "one", one_grain)
    (folder / "results").mkdir()
    (folder / "results" / "mine.txt").write_text("keep")
    before = sorted(path.name for path in folder.iterdir())
    lines = json.dumps([line for line, _ in ON_TWO_RANKS.values()])
    result = run([sys.executable, "-c", EACH_BY_ALL, lines], folder, num_ranks=2)
    assert result.returncode == 0, result.stderr
    zero, one = (json.loads((folder / f"said-{rank}.json").read_text()) for rank in range(2))
    for (what, (_, said)), first, other in zip(ON_TWO_RANKS.items(), zero, one, strict=True):
        assert first[:2] == [2, ""] and other == [2, "", ""], what
        (line,) = complaints(first[2])
        assert line.startswith("mufe: ") and said in line, what
    left = {"said-0.json", "said-1.json"}
    assert sorted({path.name for path in folder.iterdir()} - left) == before
    assert [path.name for path in (folder / "results").iterdir()] == ["mine.txt"]
    assert not list(work.iterdir())


def test_output_below_a_file(inputs, mufe_here):
    """A place that cannot be written to, whoever asks; nor a demonstration into another folder."""
    folder, work = inputs
    (work / "file").write_text("")
    arguments = ("run", folder / "scene.toml", "--grains", folder / "grains", "-o", "file/results")
    assert_refused(mufe_here(*arguments, cwd=work), "file", work, ["file"])
    assert_refused(mufe_here("demo", "-o", ".", cwd=work), "not empty", work, ["file"])


def test_a_case_that_stops_leaves_the_others(mufe_here, monkeypatch, tmp_path):
    def stops(comm):
        raise InputError("mesh = 0, expected more")

    monkeypatch.setitem(CASES, "column", stops)
    done = mufe_here("verify", "column", "stability-touch", "--json", "-", cwd=tmp_path)
    assert done.returncode == 1 and "column: FAILED, mesh = 0, expected more" in done.stderr
    first, second = json.loads(done.stdout)
    assert first["stopped"] and not first["passed"] and second["results"]


@pytest.mark.parametrize(
    ("bound", "verdict", "status", "said"),
    [
        (0.1, True, 0, "1 passed, 0 failed\n"),
        (0.01, False, 1, "0 passed, 1 failed\n"),
        (math.inf, None, 0, "0 passed, 0 failed, 1 measured without a bound\n"),
    ],
)
def test_a_number_without_a_bound_is_measured(
    bound, verdict, status, said, mufe_here, monkeypatch, tmp_path
):
    @case("column", 1)
    def measures(comm):
        return {"one": compare(1.05, 1.0, bound), "two": compare(2.0, 0.0, math.inf)}, []

    monkeypatch.setitem(CASES, "column", measures)
    done = mufe_here("verify", "column", "--json", "-", cwd=tmp_path)
    answer = json.loads(done.stdout)
    assert (done.returncode, answer["passed"]) == (status, verdict)
    assert said in done.stderr and answer["results"]["two"]["passed"] is None
    (line,) = (row for row in done.stderr.splitlines() if " two " in row)
    assert line.split()[-2:] == ["-", "measured"]


def test_disk_that_is_full(inputs, monkeypatch, capsys):
    """No file may grow beyond 100 bytes: as on a full disk, writing fails half-way."""
    folder, work = inputs
    np.save(folder / "grains.npy", two_boxes())
    monkeypatch.chdir(work)
    arguments = ["segment", str(folder / "grains.npy"), "-o", "out.tif", "--voxel-size", "5 um"]
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    told = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
        with pytest.raises(SystemExit) as end:
            main(arguments)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, told)
    out, err = capsys.readouterr()  # in memory, for files are short here
    result = subprocess.CompletedProcess(arguments, end.value.code, out, err)
    assert_refused(result, "File too large", work, [])


USAGE = [
    (("run",), "Missing argument 'SCENE'"),
    (("segment", "a.tif"), "Missing option '--output'"),
    (("segment", "-o", "x.tif"), "IMAGE is missing"),
    (("segment", "a.tif", "-o", "x.tif", "--axes", "zz"), "--axes = 'zz', expected an order"),
    (("segment", "a.tif", "-o", "x.tif", "--voxel-size", "5 kg"), '--voxel-size = "5 kg"'),
    (("segment", "a", "-o", "x.tif", "--voxel-size", "1", "--crop", "1-2"), '--crop = "1-2"'),
    (("segment", "a", "-o", "x.tif", "--voxel-size", "1", "--shape", "a"), '--shape = "a"'),
    (("mesh", "a.tif", "-o", "g", "--size", "0"), "--size = 0.0, expected a length > 0"),
    (("mesh", "a.tif", "-o", "g", "--processes", "two"), "--processes"),
    (("run", "s.toml", "--frobnicate"), "--frobnicate"),
    (("frobnicate",), "frobnicate"),
    (("report", "none"), "none"),
    (("report", "none", "--point", "1,2"), '--point "1,2", expected three coordinates'),
    (("report", "none", "--json", "/dev/null/x.json"), "x.json, expected a file in a folder"),
    (("verify", "frobnicate"), "case frobnicate is not known, expected"),
    (("verify", "--set", "nonsense"), '--set "nonsense", expected name=value'),
    (("bench", "frobnicate"), "case frobnicate is not known, expected"),
]


@pytest.mark.parametrize("arguments, said", USAGE, ids=[" ".join(a) for a, _ in USAGE])
def test_wrong_use(tmp_path, mufe_here, arguments, said):
    assert_refused(mufe_here(*arguments, cwd=tmp_path), said, tmp_path, [])


@pytest.mark.parametrize("arguments", [("-h",), ("run", "-h")])
def test_short_help(tmp_path, mufe_here, arguments):
    result = mufe_here(*arguments, cwd=tmp_path)
    assert result.returncode == 0 and "Usage: mufe" in result.stdout


def test_version(tmp_path, mufe_here):
    result = mufe_here("--version", cwd=tmp_path)
    assert (result.returncode, result.stdout) == (0, f"mufe_fenicsx {__version__}\n")
    told = json.loads(mufe_here("--version", "--json", cwd=tmp_path).stdout)
    assert told["mufe_fenicsx"] == __version__ and {"dolfinx", "machine"} <= set(told)
    assert mufe_here("--json", cwd=tmp_path).returncode == 2


@pytest.mark.parametrize("words, ends", [("mufe seg", "segment"), ("mufe run --res", "--resume")])
def test_shells_complete_commands_and_options(tmp_path, mufe_here, monkeypatch, words, ends):
    monkeypatch.setenv("_MUFE_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    result = mufe_here(cwd=tmp_path)
    assert (result.returncode, result.stdout.split()) == (0, [ends])


def test_json_stands_alone_on_standard_output(inputs, mufe_here):
    """Two boxes of 8 voxels a side; what people read goes to standard error."""
    folder, work = inputs
    np.save(folder / "grains.npy", two_boxes())
    options = ("--voxel-size", "5 um", "--filter", "none", "--json", "-")
    result = mufe_here("segment", folder / "grains.npy", "-o", "out.tif", *options, cwd=work)
    assert result.returncode == 0, result.stderr
    values = json.loads(result.stdout)
    assert values["num_grains"] == 2
    assert values["solid_fraction"] == 1024 / 3456
    assert "grains " in result.stderr


def test_summaries_are_in_words_with_units(capsys):
    Printer().summary(
        {"num_grains": 3, "element_size": 3e-5, "volume_ratio": 0.5, "wall_s": 2.0, "d10_m": 1e-4,
         "time_step_without_worst": 1.05, "min_dihedral_deg": 15.0, "voxel_size": None,
         "stress": -0.0}
    )  # fmt: skip
    lines = [line.split("  ") for line in capsys.readouterr().out.splitlines()]
    assert [(words[0], words[-1].strip()) for words in lines] == [
        ("grains", "3"),
        ("element size h", "30 µm"),
        ("volume of all meshes, over that given", "0.5"),
        ("time in all", "2 s"),
        ("d10", "100 µm"),
        ("time step without the flattest 0.1 % of tetrahedra, over now", "1.05"),
        ("angle between faces of a tetrahedron, smallest", "15 °"),
        ("voxel size", "-"),
        ("vertical stress at the end", "0 Pa"),
    ]


def test_a_table_keeps_words_in_brackets(capsys):
    Printer().table(["quantity [1]"], [["way of its front [mm]"]])
    said = capsys.readouterr().out
    assert "quantity [1]" in said and "front [mm]" in said


def test_progress_without_a_terminal_is_told_in_lines(capsys, monkeypatch):
    monkeypatch.setattr(doing, "SECONDS_BETWEEN_LINES", 0.05)
    with progress_bar("meshing") as progress:
        progress(1, 20)
        time.sleep(0.2)
        progress(50, None, "void ratio 0.9")
        time.sleep(0.2)
    lines = capsys.readouterr().err.splitlines()
    first, last = "mufe: meshing: 1 of 20, ", "mufe: meshing: step 50 void ratio 0.9, after 0 s"
    assert lines[0].startswith(first) and lines[-1] == last
    monkeypatch.setattr(doing, "SECONDS_BETWEEN_LINES", 100.0)
    with progress_bar("meshing") as progress:
        progress(1, 20)
    assert capsys.readouterr().err == ""


def test_workers_of_a_launched_process(inputs, mufe_here, monkeypatch):
    """`mpirun -n 1` and SLURM mark their process; its workers must not inherit that."""
    folder, work = inputs
    for name in ("PMI_RANK", "PMI_SIZE", "PMI_FD"):
        monkeypatch.setenv(name, "1")
    result = mufe_here("mesh", folder / "no_grain.npy", "-o", "grains", cwd=work)
    assert result.returncode == 2
    assert not [name for name in os.environ if name.startswith("PMI_")]


def test_options_come_before_the_scene(inputs, mufe_here):
    """The scene states the voxel size; the option replaces it; the rest stays."""
    folder, work = inputs
    np.save(folder / "grains.npy", two_boxes())
    image = '\n[image]\nfile = "grains.npy"\nvoxel_size = "5 um"\nfilter = "none"\nupsample = 2\n'
    (folder / "own.toml").write_text(SCENE + image)
    options = ("--scene", folder / "own.toml", "--voxel-size", "3 um", "--json", "a.json")
    result = mufe_here("segment", "-o", "out.tif", *options, cwd=work)
    assert result.returncode == 0, result.stderr
    values = json.loads((work / "a.json").read_text())
    assert values["shape"] == [24, 24, 48]
    # 3 um in two halves; only round-off of a division.
    assert values["voxel_size"] == pytest.approx(1.5e-6, rel=1e-15)


def test_demonstration_is_four_commands_on_the_scene_of_the_repository(tmp_path):
    root = Path(__file__).resolve().parents[2]
    assert demo_scene() == root / "demos" / "snow_oedometer.toml"
    commands = demo_commands(demo_scene(), tmp_path, overwrite=True)
    assert [command[0] for command in commands] == ["segment", "mesh", "run", "report"]
    # Each command reads what an earlier one wrote.
    labels, grains, results = (c[c.index("-o") + 1] for c in commands[:3])
    assert commands[1][1] == labels
    assert commands[2][commands[2].index("--grains") + 1] == grains
    assert commands[3][1] == results


def test_parameters_and_names_of_cases():
    assert parameters(["a=0.5", "name=p1", "n=2"]) == {"a": 0.5, "name": "p1", "n": 2.0}
    cases = {"column": None, "patch": None}
    assert known_names([], cases) == ["column", "patch"]
    with pytest.raises(InputError, match="colum is not known, expected column"):
        known_names(["colum"], cases)


def test_a_void_ratio_that_is_not_known_is_not_printed():
    """Of a sample too narrow for a place away from walls histories have 0."""
    known = {"void_ratio": 0.6, "void_ratio_inside": 0.5, "void_ratio_error": 0.01}
    assert printed(known | {"profile": {}}) == known
    assert printed(known | {"void_ratio_inside": 0.0, "void_ratio_error": 0.0}) == {
        "void_ratio": 0.6
    }


def test_json_holds_what_numpy_computes():
    result = {"a": np.float64(0.5), "b": np.arange(2), "c": (np.nan, np.int32(3)), "d": Path("x")}
    assert json.dumps(plain(result), allow_nan=False) == (
        '{"a": 0.5, "b": [0, 1], "c": [null, 3], "d": "x"}'
    )


def test_warnings_of_libraries_are_not_shown():
    """They concern who writes programs, and are more lines than the one that says what is wrong."""
    program = (
        "import warnings; from mufe_fenicsx.cli.exit_status import run_to_exit; "
        "run_to_exit(lambda: warnings.warn('x'))"
    )
    for options, shown in ([], False), (["-Wdefault"], True):
        done = subprocess.run(
            [sys.executable, *options, "-c", program], capture_output=True, text=True,
            env=environment_without_launcher() | FROM_HERE,
        )  # fmt: skip
        assert done.returncode == 0 and ("x" in done.stderr) == shown


@pytest.mark.parametrize("words", [["scene", "a.toml"], ["scene", "ü.toml"]])
def test_a_terminal_without_utf_8_gets_what_it_can_show(tmp_path, words):
    (tmp_path / "a.toml").write_text('title = "Über Ω"\n' + SCENE, encoding="utf-8")
    environment = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(
        [sys.executable, "-m", "mufe_fenicsx", *words], capture_output=True, cwd=tmp_path,
        env=environment_without_launcher() | environment | FROM_HERE,
    )  # fmt: skip
    assert done.returncode == (0 if words[1] == "a.toml" else 2)
    assert (done.stdout + done.stderr).isascii() and b"Traceback" not in done.stderr
