"""A sweep: refused before it begins, killed and resumed, an array of jobs, table and report."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from copy import copy
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pandas
import pytest
from matplotlib.figure import Figure

from mufe_fenicsx.cli.main import main
from mufe_fenicsx.errors import InputError, Interrupted
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.planning.sweep import runs
from mufe_fenicsx.planning.sweep.plan import kept_sweep, make_sweep, open_folder, value_of
from mufe_fenicsx.planning.sweep.results import (
    results_of,
    table_of,
    write_loop_files,
    write_sweep_report,
)
from mufe_fenicsx.planning.sweep.runs import Runner, folder_of, make_packings
from mufe_fenicsx.planning.sweep.slurm import write_array
from mufe_fenicsx.report import style
from mufe_fenicsx.report.compare import draw_parameter
from mufe_fenicsx.report.run_names import name_runs
from mufe_fenicsx.report.source import Source
from mufe_fenicsx.synthetic.rigid_packing import pipeline
from tests.bodies import RADIUS, packed_grains
from tests.cli.commands import FROM_HERE
from tests.made_up_run import fake_history, write_history, write_whole_run

SCENE = """
[sample]
grains = "grains"
[material]
E = 100e9
nu = 0.15
rho = 2650
yield_stress = [[0.0, 10e6], [0.05, 110e6]]
[contact]
friction = 0.23
[oedometer]
strain = 0.01
speed = 20
seating_stress = 1e4
[output]
fields = 2
history = 11
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "tiny.toml"
    path.write_text(SCENE)
    (tmp_path / "grains").mkdir()
    (tmp_path / "grains" / "grains.h5").touch()
    return path


@pytest.mark.parametrize(
    ("changes", "more", "said"),
    [
        ([], {}, "no parameter is given, expected --set name=value,value or --table"),
        (["contact.frction=0.1"], {}, "contact.frction = 0.1 is not a known key, expected"),
        (["contact.friction=0.1,-1"], {}, "contact.friction = -1.0, expected"),
        (["material.E=5 um:6 um"], {"num_samples": 2}, 'material.E = "5 um", expected a stress'),
        (["contact.friction=0.1:0.2"], {}, "contact.friction = 0.1:0.2 is a range, expected --sam"),
        (["contact.friction=0.1"], {"num_samples": 2}, "--samples 2, expected a range such as"),
        (["mesh.size=5 um,6 um"], {}, "mesh.size is a parameter, expected one that changes a run"),
        (["pack.seed=1,2"], {}, "pack.count is missing, expected a number of grains, or pack.box"),
        (["pack.cuont=5"], {}, "pack.cuont = 5 is not a known key, expected pack.count"),
        (["pack.spheres=1"], {}, "pack.spheres = 1, expected true or false"),
        (["pack.count=5"], {"grains": Path("g")}, "--grains beside pack.count, expected one"),
        (["contact.friction=0.1"], {"grains": Path("g")}, "grains = g has no grains, expected a"),
    ],
)  # fmt: skip
def test_what_cannot_be_run_is_one_line_before_anything_is(scene, changes, more, said):
    with pytest.raises(InputError) as error:
        make_sweep(scene, changes, **more)
    assert str(error.value).startswith(said)


def test_a_scene_without_grains_is_refused(scene):
    scene.write_text(SCENE.replace('grains = "grains"', ""))
    with pytest.raises(InputError, match=r"sample\.grains is missing, expected"):
        make_sweep(scene, ["contact.friction=0.1"])


def test_a_measured_curve_that_cannot_be_read_is_told_before_anything_is_made(scene):
    scene.write_text(SCENE + '[[reference]]\nfile = "absent.csv"\n')
    with pytest.raises(InputError, match=r"absent\.csv cannot be read"):
        make_sweep(scene, ["contact.friction=0.1"])


def test_an_interrupt_while_packing_says_how_to_go_on(scene, tmp_path, monkeypatch):
    """Ctrl-C, and a request to end of which the new folder has told."""
    sweep = make_sweep(scene, ["pack.count=4"])
    for error, number, words in (
        (KeyboardInterrupt(), signal.SIGINT, "Ctrl-C"),
        (Interrupted(signal.SIGTERM, ", nothing is left"), signal.SIGTERM, r".* \(SIGTERM\)"),
    ):
        monkeypatch.setattr(pipeline, "pack", Mock(side_effect=error))
        with pytest.raises(Interrupted, match=f"stopped by {words}; --resume goes on") as caught:
            make_packings(sweep, tmp_path)
        assert caught.value.signal == number
        again = copy(caught.value)  # as it goes from process to process
        assert (again.signal, str(again)) == (number, str(caught.value))


@pytest.mark.parametrize("kept", [
    '{"runs": 3, "grains": null, "described": null}',
    '{"runs": [3], "grains": null, "described": null}',
    '{"runs": [{"contact.friction": 3}], "grains": null, "described": null}',
    '{"runs": [{"contact.friction": "3"}], "grains": 3, "described": null}',
    '{"runs": [], "grains": null, "described": null}', "[]", "",
])  # fmt: skip
def test_a_folder_of_something_else_is_not_resumed(scene, tmp_path, kept):
    (tmp_path / "sweep.json").write_text(kept)
    with pytest.raises(
        InputError, match=r"sweep\.json cannot be read .*, expected the folder of a"
    ):
        kept_sweep(scene, tmp_path)


def test_a_folder_is_that_of_one_sweep(scene, tmp_path):
    """Resumed with the same scene and parameters alone; nothing is written over."""
    two, folder = make_sweep(scene, ["contact.friction=0.1,0.2"]), tmp_path / "out"
    with pytest.raises(InputError, match="cannot be read"):
        open_folder(folder, two, resume=True)
    open_folder(folder, two, resume=False)
    assert (folder / "parameters.txt").read_text() == "# contact.friction\n0.1\n0.2\n"
    open_folder(folder, two, resume=True)
    with pytest.raises(InputError, match="is not empty, expected a new one, or --resume"):
        open_folder(folder, two, resume=False)
    assert kept_sweep(scene, folder) == two
    with pytest.raises(InputError, match="the parameters are others since the sweep in"):
        open_folder(folder, make_sweep(scene, ["contact.friction=0.1"]), resume=True)
    scene.write_text(SCENE.replace("speed = 20", "speed = 21"))
    with pytest.raises(InputError, match="the scene was changed since the sweep in"):
        open_folder(folder, two, resume=True)


#: Stands for `mufe`: notes how it was called, and is finished at once; but the first time run 003
#: writes a checkpoint and then waits for the signal that a run gets.
STAND_IN = """
import json, pathlib, signal, sys, time
own = pathlib.Path(sys.argv[sys.argv.index("-o") + 1])
how = sys.argv[-1] if sys.argv[-1] in ("--resume", "--overwrite") else "new"
with open(own.parent.parent / "calls.txt", "a") as file:
    file.write(f"{own.name} {how}\\n")
own.mkdir(parents=True, exist_ok=True)
if own.name == "003" and how == "new":
    signal.signal(signal.SIGUSR1, lambda *_: sys.exit(138))
    (own / "checkpoints" / "step-000000000").mkdir(parents=True)
    (own / "checkpoints" / "step-000000000" / "manifest.json").write_text("{}")
    time.sleep(60)
(own / "run.json").write_text(json.dumps({"finished": True}))
"""


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    path = tmp_path / "stand_in.py"
    path.write_text(STAND_IN)
    monkeypatch.setattr(runs, "PROGRAM", (sys.executable, str(path)))


def calls(folder):
    return (folder / "calls.txt").read_text().splitlines()


def test_three_by_two_runs_killed_and_resumed(scene, tmp_path, stand_in):
    """What is finished is not begun again, what has begun goes on from its checkpoint."""
    sweep = make_sweep(scene, ["contact.friction=0.1,0.23,0.4", "material.nu=0.15,0.2"])
    folder, said = tmp_path / "out", []
    open_folder(folder, sweep, resume=False)

    def kill():
        third = folder_of(folder, "003") / "checkpoints" / "step-000000000" / "manifest.json"
        while not third.exists():
            time.sleep(0.02)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=kill).start()
    with pytest.raises(Interrupted, match=r"\(SIGTERM\); --resume goes on with the sweep"):
        Runner(sweep, folder, [None] * 6, say=said.append).run_all(jobs=1)
    assert calls(folder) == ["001 new", "002 new", "003 new"]
    log = (folder / "logs" / "003.log").read_text()
    assert log.startswith("the sweep was stopped by a request to end (SIGTERM); --resume")
    # Another one was killed before it had a checkpoint.
    folder_of(folder, "004").mkdir()
    runner = Runner(sweep, folder, [None] * 6, say=said.append)
    runner.run_all(jobs=2)
    assert calls(folder)[:3] == ["001 new", "002 new", "003 new"]
    assert sorted(calls(folder)[3:]) == ["003 --resume", "004 --overwrite", "005 new", "006 new"]
    assert not runner.failed and "6 runs, 2 of them finished" in said
    runner.run_all(jobs=2)
    assert len(calls(folder)) == 7


def test_a_run_that_another_process_writes_is_waited_for(scene, tmp_path, stand_in):
    """As one that outlived the sweep which began it: it is not run beside it, nor again."""
    sweep = make_sweep(scene, ["contact.friction=0.1,0.2"])
    folder, said = tmp_path / "out", []
    open_folder(folder, sweep, resume=False)
    own = folder_of(folder, "001")
    own.mkdir(parents=True)
    writer = (
        "import sys; from mpi4py import MPI; from mufe_fenicsx.output.run_lock import RunLock\n"
        f"lock = RunLock(MPI.COMM_SELF, {str(own)!r}); lock.take(); print('taken', flush=True)\n"
        f"sys.stdin.read(); open({str(own / 'run.json')!r}, 'w').write('{{\"finished\": true}}')\n"
        "lock.free()"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", "import mufe_fenicsx\n" + writer], stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, env=os.environ | FROM_HERE,
    )  # fmt: skip
    assert other.stdout.readline() == b"taken\n"
    threading.Timer(0.5, other.stdin.close).start()
    Runner(sweep, folder, [None] * 2, say=said.append).run_all(jobs=1)
    assert other.wait(timeout=60) == 0
    assert calls(folder) == ["002 new"]
    assert "run 001 is written by another process: waiting for it" in said


def test_a_run_that_fails_is_told_and_others_go_on(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "PROGRAM", (sys.executable, "-c", "print('mufe: no'); exit(1)"))
    sweep = make_sweep(scene, ["contact.friction=0.1,0.2"])
    open_folder(tmp_path / "out", sweep, resume=False)
    runner = Runner(sweep, tmp_path / "out", [None] * 2, say=lambda line: None)
    runner.run_all(jobs=2)
    assert runner.failed == {0: "mufe: no", 1: "mufe: no"}


def test_an_array_of_jobs_runs_each_line_and_leaves_what_is_finished(scene, tmp_path):
    """Under stand-ins of SLURM: new, resumed, begun anew, finished; SIGTERM puts it back."""
    sweep = make_sweep(scene, ["contact.friction=0.1,0.2,0.3,0.4", 'title="it\'s", "b"'])
    (tmp_path / "out").mkdir()
    job = write_array(sweep, tmp_path / "out", [tmp_path / "my grains"] * 8, num_ranks=4)
    assert "#SBATCH --array=1-8\n#SBATCH --ntasks=4" in job.read_text()
    programs = tmp_path / "bin"
    programs.mkdir()
    for name, text in (
        ("srun", 'for word; do printf "%s\\n" "$word"; done; exit ${STATUS:-0}'),
        ("scontrol", 'echo "scontrol $*"'),
    ):
        (programs / name).write_text(f"#!/bin/bash\n{text}\n")
        (programs / name).chmod(0o755)

    def task(number, **more):
        done = subprocess.run(
            ["bash", job], capture_output=True, text=True, check=False,
            env={"PATH": f"{programs}:{os.environ['PATH']}", "SLURM_ARRAY_TASK_ID": str(number),
                 "SLURM_ARRAY_JOB_ID": "7", **more},
        )  # fmt: skip
        assert done.stderr == ""
        return done.returncode, done.stdout.splitlines()

    own = [folder_of((tmp_path / "out").resolve(), name) for name in sweep.names]
    status, words = task(1)
    assert status == 0
    assert words == [
        sys.executable, "-m", "mufe_fenicsx", "run", str(scene), "-o", str(own[0]),
        "--grains", str(tmp_path / "my grains"), "--set=contact.friction=0.1",
        '--set=title="it\'s"', "--quiet",
    ]  # fmt: skip
    own[1].mkdir(parents=True)
    assert task(2)[1][-1] == "--overwrite"
    (own[1] / "checkpoints" / "step-000000000").mkdir(parents=True)
    (own[1] / "checkpoints" / "step-000000000" / "manifest.json").touch()
    assert task(2)[1][-1] == "--resume"
    status, words = task(2, STATUS="143")
    assert status == 143 and words[-1] == "scontrol requeue 7_2"
    (own[1] / "run.json").write_text(json.dumps({"finished": True}, indent=2))
    assert task(2) == (0, [])


def test_table_report_and_files_have_what_the_runs_have(scene, tmp_path, monkeypatch):
    """Made-up runs: stresses of their history; a [[reference]] with a tenth less stress."""
    folder = tmp_path / "out"
    for name in ("001", "002"):
        own = folder_of(folder, name)
        own.mkdir(parents=True)
        history = write_whole_run(own, n=2)
        with (own / "scene.toml").open("a") as file:  # as of the sweep's
            file.write(f'[[reference]]\nfile = "{tmp_path}/lab.csv"\n')
    rows = history["stage"] == "loading"
    strain, stress = history["strain"][rows], history["stress"][rows]
    lab = pandas.DataFrame({"strain [%]": 100 * strain, "stress [MPa]": stress / 1.1e6})
    lab.to_csv(tmp_path / "lab.csv", index=False)
    scene.write_text(SCENE + '[[reference]]\nfile = "lab.csv"\n')
    sweep = make_sweep(scene, ["contact.friction=0.1,0.2", "material.E=50 GPa"])
    table = table_of(sweep, folder)
    assert table[0]["material.E"] == 50e9 and table[1]["contact.friction"] == 0.2
    assert table[0]["peak stress [Pa]"] == stress.max()
    assert table[0]["strain at the end [-]"] == strain[-1]
    # The line through the last fifth of a curve that is given.
    last = strain >= strain[-1] - 0.2 * np.ptp(strain)
    slope = np.polyfit(strain[last], stress[last], 1)[0]
    assert table[0]["modulus of loading [Pa]"] == pytest.approx(slope, rel=1e-9)
    mean = table[0]["lab: stress of loading, mean difference [-]"]
    assert mean == pytest.approx(0.1, abs=1e-12)
    assert table[0]["lab: stress of loading, points measured [-]"] == len(strain)
    assert pandas.read_csv(folder / "table.csv")["run"].tolist() == [1, 2]
    # Pictures stay empty: what is asked is what the page says.
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **options: Path(path).touch())
    page = Path(write_sweep_report(sweep, table, folder)).read_text()
    assert "The sweep (table.csv)" in page and "Beside measured curves" in page

    names = [Path(path).name for path in write_loop_files(sweep, folder)]
    assert names == [
        f"tiny_Iter0_Sample{k}_{what}.txt" for k in (0, 1) for what in ("sim", "param")
    ]
    simulated = np.genfromtxt(folder / "grainlearning" / names[0], names=True)
    np.testing.assert_allclose(simulated["stress"], stress, rtol=1e-12)
    parameters = (folder / "grainlearning" / names[3]).read_text()
    assert parameters == "# contact.friction material.E\n0.2 50000000000.0\n"


def test_runs_of_friction_and_seed_are_named_and_joined_by_both(scene, tmp_path):
    """Stress = 1, 2, 3, 4 times that of the first: friction 0.1 seed 1, seed 2, then 0.2."""
    changes = ["contact.friction=0.1,0.2", "pack.count=4", "pack.seed=1,2"]
    sweep = make_sweep(scene, changes)
    sources = []
    for number, name in enumerate(sweep.names):
        own = folder_of(tmp_path, name)
        own.mkdir(parents=True)
        history = fake_history(60)
        history["stress"] = (1 + number) * history["stress"]
        write_history(own, history)
        text = SCENE.replace("0.23", sweep.changes(number)["contact.friction"])
        (own / "scene.toml").write_text(text)
        packing = {key: value_of(text) for key, text in sweep.packing(number)}
        sources.append(Source(own, packing=packing))
    names = name_runs(sources)
    assert names == [f"friction {f}, seed {s}" for f in (0.1, 0.2) for s in (1, 2)]
    with style.look():
        drawing = draw_parameter(sources, names)
    columns = drawing.tables[""]
    assert columns["contact.friction [-]"].tolist() == [0.1, 0.1, 0.2, 0.2]
    assert columns["pack.seed"] == ["1", "2", "1", "2"]
    lines = [line.get_xdata().tolist() for line in drawing.figure.axes[0].lines]
    assert [x for x in lines if len(x)] == [[0.1, 0.2]] * 8  # two seeds at four strains
    shown = [text.get_text() for text in drawing.figure.axes[0].get_legend().get_texts()]
    assert {"seed 1", "seed 2"} <= set(shown)


def test_a_run_that_has_not_loaded_has_no_numbers(tmp_path):
    assert results_of(tmp_path) == {"finished": False}


@pytest.mark.slow
def test_seeds_of_packings_are_parameters(scene, tmp_path):
    """Each packing is made once, and stays where it is when the sweep is resumed."""
    scene.write_text(SCENE.replace('grains = "grains"', ""))
    sweep = make_sweep(
        scene,
        ["pack.spheres=true", "pack.count=4", "pack.element_size=120 um", "pack.seed=1,2",
         "contact.friction=0.1,0.2"],
    )  # fmt: skip
    places = make_packings(sweep, tmp_path)
    assert places == [tmp_path / "packings" / n / "grains" for n in ("001", "001", "002", "002")]
    written = [(place / "grains.h5").stat().st_mtime_ns for place in places]
    assert make_packings(sweep, tmp_path) == places
    assert written == [(place / "grains.h5").stat().st_mtime_ns for place in places]
    assert len({(place / "grains.h5").read_bytes() for place in places}) == 2


@pytest.mark.slow
def test_real_runs_killed_and_resumed_have_the_steps_of_one_piece(scene, tmp_path, monkeypatch):
    """Six runs of four balls: killed in the third, resumed; each history as in one piece."""
    from mufe_fenicsx.geometry.grains import save_grains

    save_grains(tmp_path / "grains", packed_grains((2, 2, 1), h=0.7 * RADIUS))
    monkeypatch.setenv("PYTHONPATH", FROM_HERE["PYTHONPATH"])
    monkeypatch.chdir(tmp_path)
    words = "sweep tiny.toml -o out --set contact.friction=0.1,0.23,0.4 --set oedometer.speed=1,2"
    process = subprocess.Popen([sys.executable, "-m", "mufe_fenicsx", *words.split()])
    third = Path("out/runs/003/history.csv")
    while not (third.exists() and len(third.read_text().splitlines()) > 2):
        time.sleep(0.05)
        assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    assert process.wait() == 128 + signal.SIGTERM
    first = {n: Path(f"out/runs/{n}/run.json").stat().st_mtime_ns for n in ("001", "002")}
    with pytest.raises(SystemExit) as end:
        main([*words.split(), "--resume", "--json", "out.json"])
    assert end.value.code == 0
    assert first == {n: Path(f"out/runs/{n}/run.json").stat().st_mtime_ns for n in first}
    assert json.loads(Path("out/runs/003/run.json").read_text())["resumed_at_steps"]
    assert all(row["finished"] for row in json.loads(Path("out.json").read_text())["runs"])
    # Friction does nothing to four balls in a row: runs of a speed are the same to the last bit.
    whole, resumed = (read_history(Path(f"out/runs/{n}/history.csv")) for n in ("001", "003"))
    assert np.array_equal(whole["stress"], resumed["stress"])
