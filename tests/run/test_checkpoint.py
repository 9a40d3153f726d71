"""A run that stops, by whatever, goes on as if it had not."""

import contextlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.cli.main import main
from mufe_fenicsx.contact.snapshot import find_rows
from mufe_fenicsx.errors import InputError, Interrupted
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.machine.mpi_launcher import environment_without_launcher, find_mpirun
from mufe_fenicsx.materials.auto import Auto
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.output import checkpoint as checkpoints
from mufe_fenicsx.output.fields import read_state, read_states
from mufe_fenicsx.output.history import HistoryWriter, read_history
from mufe_fenicsx.run import run as run_module
from mufe_fenicsx.run import signals
from mufe_fenicsx.run.recorder import Recorder
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import (
    Contact,
    Group,
    MassScaling,
    Oedometer,
    Output,
    Pair,
    QuasiStatic,
    Scene,
    Wall,
    scene_to_toml,
)
from tests.bodies import RADIUS, packed_grains
from tests.checkpoints import arrays
from tests.ranks import on_first

COMM = MPI.COMM_WORLD
ROCK = (100e9, 0.15, 2650.0)
TABLE = ((0.0, 10e6), (0.05, 110e6))
PACKAGE = Path(run_module.__file__).parents[1]
#: Time for a process, which may have to compile first [s].
PATIENCE = 600


def scene(strain=0.008, speed=20.0, **output):
    """Friction, yielding, a rigid grain, one that is so until loaded, and a wall with a servo."""
    return Scene(
        material=J2(*ROCK, TABLE),
        materials={
            "hard": Group((2,), Rigid(*ROCK)),
            "late": Group((3, 5), Auto(*ROCK, TABLE, margin=0.05)),
        },
        contact=Contact(friction=0.4, friction_kinetic=0.3, wall_friction=0.2),
        oedometer=Oedometer(strain=strain, speed=speed, seating_stress=1e4),
        walls={"x_max": Wall(stress=2e5, speed=1.0)},
        output=Output(fields=3, history=41, **output),
        quasi_static=QuasiStatic(kinetic=0.5, unbalanced=0.2, loaded=0.004),
    )


#: With coefficients of pairs of materials and many checkpoints.
OFTEN = scene(checkpoint_steps=40)
PAIRS = {"material-late": Pair(0.5, 0.15), "hard-material": Pair(0.1)}
OFTEN = replace(
    OFTEN,
    contact=replace(OFTEN.contact, pairs=PAIRS),
    oedometer=replace(OFTEN.oedometer, strain=0.004, ramp=0.002),
)
FIRST_STOP = 100


@pytest.fixture
def folder(tmp_path_factory):
    """A folder that all ranks share, with the grains: two layers of spheres."""
    return _shared(tmp_path_factory)


def _shared(tmp_path_factory):
    path = COMM.bcast(tmp_path_factory.mktemp("keep") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        save_grains(path / "grains", packed_grains((2, 2, 2), h=0.7 * RADIUS))
    COMM.Barrier()
    return path


def run(folder, name, **options):
    given = options.pop("scene", scene())
    return run_scene(given, folder / "grains", folder / name, COMM, quiet=True, **options)


def files(path):
    """All files of a run that hold results, with their bytes; run.json tells times of the clock."""
    names = [p for p in path.rglob("*") if p.is_file() and "checkpoints" not in p.parts]
    return {str(p.relative_to(path)): p.read_bytes() for p in names if p.name != "run.json"}


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A folder with a run that was not stopped, one that was twice, and a copy of its first part.

    Before and after grains begin to deform; all kinds of contact are there.
    """
    path = _shared(tmp_path_factory)
    run(path, "whole", scene=OFTEN)
    run(path, "parts", scene=OFTEN, max_steps=FIRST_STOP)
    on_first(COMM, lambda: shutil.copytree(path / "parts", path / "other"))
    run(path, "parts", scene=OFTEN, max_steps=145, resume=True)
    return path


@pytest.mark.mpi
def test_resumed_runs_give_the_same_bytes(stopped, monkeypatch):
    """Stopped at two steps, then by a signal that one rank receives."""
    handler = signal.getsignal(signal.SIGINT)  # ignored where tests run in the background
    write_state = Recorder.write_state

    def interrupt(recorder):
        write_state(recorder)
        monkeypatch.setattr(Recorder, "write_state", write_state)  # a second one would kill
        if COMM.rank == COMM.size - 1:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Recorder, "write_state", interrupt)
    monkeypatch.setattr(signals, "LATENCY", 1e-3)
    with pytest.raises(Interrupted, match="stopped by Ctrl-C") as ended:
        run(stopped, "parts", scene=OFTEN, resume=True)
    assert ended.value.signal == signal.SIGINT
    assert signal.getsignal(signal.SIGINT) is handler
    monkeypatch.undo()
    parts = run(stopped, "parts", scene=OFTEN, resume=True)
    assert parts["finished"] and parts["resumed_at_steps"][:2] == [FIRST_STOP, 145]
    assert len(parts["resumed_at_steps"]) == 3
    whole = json.loads((stopped / "whole" / "run.json").read_text())
    assert whole["finished"]
    if COMM.rank == 0:
        assert files(stopped / "parts") == files(stopped / "whole")
        assert last_step(stopped / "whole") == last_step(stopped / "parts")
        # Those of dents too: rows of the first half come before the last stop.
        dents = read_history(stopped / "whole" / "history.csv")["plastic_dents"]
        assert dents[-1] > dents[dents.size // 2] > 0.0
    for one, other in zip(*(arrays(stopped / name) for name in ("whole", "parts")), strict=True):
        assert one == other
    assert parts["stages"] == whole["stages"] and parts["contact"] == whole["contact"]
    with pytest.raises(InputError, match="is finished"):
        run(stopped, "parts", scene=OFTEN, resume=True)


@pytest.fixture
def serial():
    if COMM.size > 1:
        pytest.skip("starts processes of its own")


def start(folder, name, num_ranks=1, resume=False, of=None, **changes):
    """Start the command `mufe run` as an MPI world of its own.

    Of the scene ``of``, or of that above with a checkpoint every 20 steps.
    """
    path = folder / "scene.toml"
    path.write_text(scene_to_toml(of or scene(checkpoint_steps=20, **changes)))
    command = [sys.executable, "-m", "mufe_fenicsx", "run", path, "--grains", folder / "grains"]
    command += ["-o", folder / name, "--quiet", *(["--resume"] if resume else [])]
    if num_ranks > 1:
        command = [find_mpirun(), "-n", num_ranks, *command]
    environment = environment_without_launcher()
    return subprocess.Popen(
        [str(word) for word in command], env=environment | {"OMP_NUM_THREADS": "1"}, text=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        start_new_session=True,
    )  # fmt: skip


def wait_for_checkpoint(process, run_folder, after=-1):
    """Wait for a checkpoint of a later step than ``after``, or the end of the process."""
    deadline = time.monotonic() + PATIENCE
    while process.poll() is None:
        assert time.monotonic() < deadline, "no checkpoint"
        steps = [int(p.name[5:]) for p in run_folder.glob("checkpoints/step-*[0-9]")]
        if max(steps, default=-1) > after:
            return
        time.sleep(0.002)


def last_step(run_folder):
    return int(max(run_folder.glob("checkpoints/step-*[0-9]")).name[5:])


def _kill(process, one_rank):
    """Kill a run, or one of its ranks, at whose end the launcher ends the others.

    Returns:
        Whether it was one rank: none is there while the launcher starts.
    """
    ranks = (
        [p for p in _descendants(process.pid) if b"mufe_fenicsx" in _words(p)] if one_rank else []
    )
    if ranks:
        with contextlib.suppress(ProcessLookupError):
            os.kill(random.choice(ranks), signal.SIGKILL)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.communicate(timeout=30)
            return True
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    return False


def _descendants(parent):
    """Numbers of the processes that a process started, and that these did."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            if int(path.read_text().rpartition(")")[2].split()[1]) == parent:
                found.append(int(path.parent.name))
    return found + [p for one in found for p in _descendants(one)]


def _words(process):
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/cmdline").read_bytes()
    return b""


def kill_and_resume(folder, name, kills, chance, num_ranks=1, of=None):
    """Kill a run so often at random moments, some of them while it starts to go on; of as above.

    Returns:
        For each time that it was killed, whether it was one rank alone.
    """
    killed, process = [], start(folder, name, num_ranks, of=of)
    for _ in range(kills):
        known = any((folder / name).glob("checkpoints/step-*[0-9]"))
        if known and chance.random() < 0.25:
            time.sleep(chance.uniform(0.0, 2.0))
        else:
            wait_for_checkpoint(process, folder / name, last_step(folder / name) if known else -1)
            time.sleep(chance.uniform(0.0, 0.05))
        if process.poll() is not None:
            break
        killed.append(_kill(process, one_rank=num_ranks > 1 and chance.random() < 0.5))
        if json.loads((folder / name / "run.json").read_text())["finished"]:
            return killed  # while it was leaving
        process = start(folder, name, num_ranks, resume=True, of=of)
    _, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, error
    return killed


def copy_before_changes(monkeypatch, run_folder, copies):
    """Let each line of the program that changes files copy the run first, over its last copy.

    That is what a kill there leaves: rows that are not handed to the system are not in it.
    """
    rmtree = shutil.rmtree

    def first(change):
        def changed(*arguments, **options):
            frame = sys._getframe(1)
            while Path(frame.f_code.co_filename).stem in ("files", "contextlib"):  # on behalf of
                frame = frame.f_back
            source = Path(frame.f_code.co_filename)
            known = any(run_folder.glob("checkpoints/step-*[0-9]"))
            if known and source.is_relative_to(PACKAGE) and source.stem != "run_lock":
                copy = copies / f"{source.stem}-{frame.f_lineno}"
                rmtree(copy, ignore_errors=True)
                ignored = shutil.ignore_patterns("run.lock*")
                shutil.copytree(run_folder, copy, ignore=ignored)
            return change(*arguments, **options)

        return changed

    for module, name in (
        (os, "fsync"), (os, "rename"), (os, "replace"), (shutil, "rmtree"), (Path, "unlink"),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, first(getattr(module, name)))


def test_a_run_killed_before_any_change_of_its_files_goes_on_to_the_same_bytes(
    folder, serial, monkeypatch
):
    """Between two changes a kill leaves the same files: one of each kind is enough.

    The second part goes on from a kill within a checkpoint, and cuts back what came after.
    """
    often, copies = scene(checkpoint_steps=20), folder / "copies"
    whole = run(folder, "whole", scene=often)
    for name, stop, resume in (("one", 0.4, False), ("two", 0.8, True)):
        with monkeypatch.context() as patched:
            copy_before_changes(patched, folder / name, copies)
            run(folder, name, scene=often, max_steps=int(stop * whole["num_steps"]), resume=resume)
        if not resume:
            within = max(copies.glob("checkpoint-*"), key=lambda path: path.stat().st_mtime)
            shutil.copytree(within, folder / "two")
    killed = sorted(path.name for path in copies.iterdir())
    changing = {"checkpoint", "contacts", "fields", "history", "run_folder", "run_place"}
    assert {name.partition("-")[0] for name in killed} == changing
    for name in killed:
        shutil.rmtree(folder / "parts", ignore_errors=True)
        shutil.copytree(copies / name, folder / "parts")
        run(folder, "parts", scene=often, resume=True)
        assert files(folder / "parts") == files(folder / "whole"), name


@pytest.mark.slow
@pytest.mark.parametrize("num_ranks", [1, 2, 3])
def test_sixty_kills_leave_the_same_bytes(folder, serial, num_ranks):
    """Twenty for each number of ranks; of several ranks, some are one rank alone."""
    process = start(folder, "whole", num_ranks)
    process.communicate()
    chance, killed = random.Random(2), []
    for trial in range(30):
        shutil.rmtree(folder / "parts", ignore_errors=True)
        killed += kill_and_resume(folder, "parts", 6, chance, num_ranks)
        assert files(folder / "parts") == files(folder / "whole"), trial
        if len(killed) >= 20:
            break
    print(f"{num_ranks} ranks: {len(killed)} kills, {sum(killed)} of one rank alone")
    assert len(killed) >= 20 and (sum(killed) >= 5 or num_ranks == 1)


def test_a_signal_ends_all_ranks_after_a_checkpoint(folder, serial):
    if "Open MPI" in MPI.Get_library_version():
        pytest.skip("the launcher of Open MPI kills its ranks on SIGTERM")
    # Slow enough for the signal to get there.
    process = start(folder, "out", 2, strain=0.1, speed=0.5)
    wait_for_checkpoint(process, folder / "out")
    process.send_signal(signal.SIGTERM)
    _, error = process.communicate(timeout=PATIENCE)
    check_stopped_run(folder / "out", process.returncode, error, signal.SIGTERM)


@pytest.mark.parametrize("number", [signal.SIGUSR1, signal.SIGHUP])
def test_a_signal_ends_a_run_after_a_checkpoint(folder, serial, monkeypatch, capfd, number):
    """In this process: `mufe run` hears it after its first state."""
    (folder / "scene.toml").write_text(scene_to_toml(scene(checkpoint_steps=20)))
    write_state = Recorder.write_state

    def interrupt(recorder):
        write_state(recorder)
        monkeypatch.setattr(Recorder, "write_state", write_state)
        signal.raise_signal(number)

    monkeypatch.setattr(Recorder, "write_state", interrupt)
    monkeypatch.setattr(signals, "LATENCY", 1e-3)
    arguments = ["run", "scene.toml", "--grains", "grains", "-o", "out", "--quiet"]
    monkeypatch.chdir(folder)
    before = signal.signal(number, lambda *_: None)  # nohup would have it ignored
    try:
        with pytest.raises(SystemExit) as end:
            main(arguments)
    finally:
        signal.signal(number, before)
    check_stopped_run(folder / "out", end.value.code, capfd.readouterr().err, number)


def check_stopped_run(run_folder, status, error, number):
    """A run that ended on a signal: its status, its line, its last checkpoint and its summary."""
    assert status == 128 + number
    step = last_step(run_folder)
    lines = [line for line in error.splitlines() if line.startswith("mufe: ")]
    assert len(lines) == 1 and f"({number.name}) at step {step}," in lines[0], error
    summary = json.loads((run_folder / "run.json").read_text())
    assert summary["num_steps"] == step and number.name in summary["stop_reason"]


def test_a_signal_is_heard_while_all_begins_anew(folder, monkeypatch):
    """It comes between the checkpoint that new shares of the work begin from and their start."""
    begin_again = run_module.TestRun.begin_again

    def balance(test):
        test.save()
        return not test.summary["resumed_at_steps"]

    def begin(test, checkpoint):
        if COMM.rank == 0:
            signal.raise_signal(signal.SIGINT)
        begin_again(test, checkpoint)

    monkeypatch.setattr(run_module.TestRun, "balance", balance)
    monkeypatch.setattr(run_module.TestRun, "begin_again", begin)
    monkeypatch.setattr(signals, "LATENCY", 1e-3)
    with pytest.raises(Interrupted, match="stopped by Ctrl-C"):
        run(folder, "anew")
    monkeypatch.undo()
    assert run(folder, "anew", resume=True)["finished"]


def test_a_run_killed_between_its_last_checkpoint_and_its_summary_only_has_to_end(folder):
    whole = run(folder, "out")
    before = None if COMM.rank else files(folder / "out")
    COMM.Barrier()
    if COMM.rank == 0:
        path = folder / "out" / "run.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"finished": False}))
    COMM.Barrier()
    ended = run(folder, "out", resume=True)
    assert ended["finished"] and ended["num_steps"] == whole["num_steps"]
    assert COMM.rank or files(folder / "out") == before


@pytest.mark.mpi
def test_a_run_that_stops_stores_its_last_state_once(folder):
    """Steps count from the start of the test: resumed, it stops at once, and nothing is new."""
    run(folder, "out", max_steps=21)
    before = files(folder / "out")
    assert read_history(folder / "out" / "history.csv")["step"][-1] == 21
    times = [state["time"] for state in read_states(folder / "out")]
    assert times[-1] == read_history(folder / "out" / "history.csv")["time"][-1]
    run(folder, "out", max_steps=21, resume=True)
    assert COMM.rank or files(folder / "out") == before


def test_damage_is_found_and_the_one_before_used(folder, capfd):
    run(folder, "out", max_steps=20)
    run(folder, "out", max_steps=30, resume=True)
    good, torn = (folder / "out" / "checkpoints" / f"step-{n:09d}" for n in (20, 30))
    assert checkpoints.find_checkpoint(COMM, folder / "out").path == torn
    COMM.Barrier()
    if COMM.rank == 0:  # one digit of a number that parses as well
        text = (torn / "manifest.json").read_text()
        (torn / "manifest.json").write_text(text.replace('"num_steps": ', '"num_steps": 1'))
    found = checkpoints.find_checkpoint(COMM, folder / "out")
    assert found.path == good and "is damaged (manifest.json has changed)" in found.notices[0]
    COMM.Barrier()
    if COMM.rank == 0:
        (torn / "manifest.json").write_text(text)
        os.truncate(torn / "rank-0000.h5", 5000)
    found = checkpoints.find_checkpoint(COMM, folder / "out")
    assert found.path == good and "rank-0000.h5 is torn" in found.notices[0]
    again = run_scene(
        scene(), folder / "grains", folder / "out", COMM, max_steps=25, resume=True, quiet=False
    )
    assert again["resumed_at_steps"] == [20]
    if COMM.rank == 0:
        assert not torn.exists()
        assert capfd.readouterr().err.count("is damaged") == 1
        for path in (folder / "out" / "checkpoints").iterdir():
            data = bytearray((path / "rank-0000.h5").read_bytes())
            data[len(data) // 2] ^= 1
            (path / "rank-0000.h5").write_bytes(data)
    COMM.Barrier()
    with pytest.raises(InputError, match=r"rank-0000.h5 has changed.*no other: --overwrite beg"):
        run(folder, "out", resume=True)


#: What happened to a file of results -> how the refusal of --resume says it.
LOSSES = {
    "fields/mesh.h5": (lambda p: p.unlink(), r"fields/mesh.h5 is missing, fields/0000.vtkhdf "),
    "fields/0000.vtkhdf": (lambda p: p.write_bytes(b""), r"fields/0000.vtkhdf has changed; expec"),
    "contacts/grains_0000.csv": (lambda p: p.unlink(), r"contacts/grains_0000.csv is missing; exp"),
    "history.csv": (
        lambda p: p.write_text(re.sub(r"((?:.*\n){3})", r"\g<1>7", p.read_text(), count=1)),
        r"history.csv has changed from row 3 on; expected"),
    "history.csv ": (
        lambda p: os.truncate(p, p.stat().st_size - 1500),
        r"history.csv has lost rows from row \d+ on; expected"),
}  # fmt: skip


def test_results_that_are_gone_are_named_and_left_out_only_if_told(folder, serial, capfd):
    """From the strain on at which they were written; the rest is as it would be."""
    run(folder, "whole", max_steps=220)
    for name, (harm, expected) in LOSSES.items():
        shutil.rmtree(folder / "out", ignore_errors=True)
        shutil.copytree(folder / "whole", folder / "out")
        harm(folder / "out" / name.strip())
        before = files(folder / "out")
        with pytest.raises(InputError, match=rf"from strain \S+ on: {expected}"):
            run(folder, "out", resume=True, max_steps=221)
        assert files(folder / "out") == before
        given = scene(), folder / "grains", folder / "out", COMM
        run_scene(*given, resume=True, accept_loss=True, max_steps=225)
        assert "going on without them" in capfd.readouterr().err
        assert read_history(folder / "out" / "history.csv")["step"][-1] == 225
        for state in read_states(folder / "out"):  # those that are listed are whole
            assert read_state(folder / "out", state["index"]).n_cells > 0
        run(folder, "out", resume=True, max_steps=230)  # and are counted so


def test_a_checkpoint_of_something_else_is_refused(folder, monkeypatch):
    with pytest.raises(
        InputError, match=r"no checkpoint in .*, expected .* from: --overwrite begins"
    ):
        run(folder, "out", resume=True)
    run(folder, "out", max_steps=5)
    other = replace(scene(), contact=Contact(friction=0.3, wall_friction=0.2))
    with pytest.raises(InputError, match=r"contact.friction = 0.3, was 0.4, expected"):
        run(folder, "out", resume=True, scene=other)
    other = replace(scene(), contact=replace(scene().contact, pairs={"hard-late": Pair(0.2)}))
    with pytest.raises(InputError, match=r"contact.pairs.hard-late.friction = 0.2, was not set, e"):
        run(folder, "out", resume=True, scene=other)
    monkeypatch.setattr(checkpoints, "VERSION", checkpoints.VERSION + 1)
    with pytest.raises(InputError, match=r"checkpoint .* is mufe checkpoint \d+, expected"):
        run(folder, "out", resume=True)
    monkeypatch.undo()
    COMM.Barrier()
    if COMM.rank == 0:
        save_grains(folder / "grains", packed_grains((2, 2, 2), h=0.8 * RADIUS))
    COMM.Barrier()
    with pytest.raises(InputError, match=r"grains of checkpoint .* are others than those given"):
        run(folder, "out", resume=True)


def test_a_finished_test_is_prolonged_to_the_same_bytes(folder):
    """The longer test from the start, in the same rows and states: only the end was moved."""

    def ending(strain, rows, states):
        given = scene(checkpoint_strain=0.003)
        return replace(
            given,
            material=J2(*ROCK, TABLE),
            materials={},
            mass_scaling=MassScaling(0.01),
            oedometer=replace(given.oedometer, strain=strain, ramp=0.0),
            output=replace(given.output, history=rows, fields=states),
        )

    short, long = ending(0.004, 21, 2), ending(0.008, 41, 3)
    whole = run(folder, "whole", scene=long)
    assert run(folder, "parts", scene=short)["finished"]
    with pytest.raises(InputError, match=r"is finished, .* or oedometer.strain above 0.004 to"):
        run(folder, "parts", scene=short, resume=True)
    with pytest.raises(InputError, match=r"oedometer.speed = 30.0, was 20.0, .* may only change"):
        other = replace(long, oedometer=replace(long.oedometer, speed=30.0))
        run(folder, "parts", scene=other, resume=True)
    with pytest.raises(InputError, match=r"run in .* is finished, expected"):
        run(folder, "parts", scene=ending(0.002, 11, 2), resume=True)
    parts = run(folder, "parts", scene=long, resume=True)
    assert parts["finished"] and parts["num_steps"] == whole["num_steps"]
    assert parts["mass_scaling"] == whole["mass_scaling"]
    assert parts["quasi_static"] == whole["quasi_static"]
    if COMM.rank == 0:
        assert files(folder / "parts") == files(folder / "whole")
    for one, other in zip(*(arrays(folder / name) for name in ("whole", "parts")), strict=True):
        assert one == other


def test_a_full_disk_leaves_the_last_checkpoint(folder, monkeypatch):
    def full(path, size, room=checkpoints.try_room):
        if "step-000000040" in str(path):
            raise OSError(28, "No space left on device")
        room(path, size)

    monkeypatch.setattr(checkpoints, "try_room", full)
    often = scene(checkpoint_steps=20)
    message = r"step-000000040 cannot be written \(No space.*goes on from .*step-000000020"
    with pytest.raises(InputError, match=message):
        run(folder, "out", scene=often)
    monkeypatch.undo()
    COMM.Barrier()
    kept = sorted(p.name for p in (folder / "out" / "checkpoints").iterdir())
    assert kept == ["step-000000000", "step-000000020"]
    assert run(folder, "out", max_steps=21, resume=True)["resumed_at_steps"] == [20]


@pytest.mark.parametrize("what", ["history.csv", "step-000000020"])
def test_a_disk_that_fills_before_a_checkpoint_is_due_leaves_the_start(folder, monkeypatch, what):
    """The run stops in one line, and goes on from the start as if there had been room."""

    def full(path, size, room=checkpoints.try_room):
        if what in f"{path}":
            raise OSError(28, "No space left on device")
        room(path, size)

    def full_history(writer, row, append=HistoryWriter._append):
        if what == "history.csv" and row["step"] > 0:
            raise OSError(28, "No space left on device")
        append(writer, row)

    monkeypatch.setattr(checkpoints, "try_room", full)
    monkeypatch.setattr(HistoryWriter, "_append", full_history)
    steps = 20 if "step" in what else 0
    often = replace(scene(), output=Output(history=1000, checkpoint_steps=steps))
    with pytest.raises(InputError, match=rf"{what}.*No space.*goes on from .*step-000000000"):
        run(folder, "out", scene=often, max_steps=30)
    monkeypatch.undo()
    assert "No space" in json.loads((folder / "out" / "run.json").read_text())["stop_reason"]
    run(folder, "out", scene=often, max_steps=30, resume=True)
    run(folder, "whole", scene=often, max_steps=30)
    if COMM.rank == 0:
        assert files(folder / "out") == files(folder / "whole")


@pytest.mark.mpi
@pytest.mark.skipif(COMM.size == 1, reason="needs several ranks")
def test_another_number_of_ranks_goes_on(stopped):
    """Several, one and several again: forces differ by rounding alone from those of several.

    Grains, contacts and sums find their new ranks. The bound is that of sums in another order,
    1e-16, which hundreds of steps amplify.
    """
    given = OFTEN, stopped / "grains", stopped / "other"
    options = {"resume": True, "quiet": True}
    on_first(COMM, lambda: run_scene(*given, MPI.COMM_SELF, max_steps=150, **options))
    run_scene(*given, COMM, **options)
    on_first(COMM, lambda: check_alike(stopped / "whole", stopped / "other", after=150))


def check_alike(same, other, after):
    one, two = (read_history(path / "history.csv") for path in (same, other))
    assert one["step"][-1] > after and np.array_equal(one["step"], two["step"])
    scale = np.abs(one["force_z_max"]).max()
    for name in (name for name in one if name.startswith("force")):
        assert np.abs(one[name] - two[name]).max() < 1e-9 * scale
    # The mean stress of each grain, from states with the mesh in its own order.
    for index in range(3):
        means = []
        for path in (same, other):
            state = read_state(path, index)
            weight = state.compute_cell_sizes()["Volume"][:, None] * state["stress"]
            grain = state["grain"]
            means.append([weight[grain == g].sum(axis=0) for g in np.unique(grain)])
        assert np.allclose(*means, rtol=0, atol=1e-9 * np.abs(means[0]).max())


def test_rows_are_found_by_all_of_their_names(monkeypatch):
    """In blocks that do not divide the wanted ones; a name that differs in one column is none."""
    monkeypatch.setattr("mufe_fenicsx.contact.snapshot.BLOCK", 7)
    rng = np.random.default_rng(4)
    known = np.stack(np.meshgrid([2, 5], [1 << 60, 3, -4], [0, 1]), axis=-1).reshape(-1, 3)
    known = rng.permutation(known)
    wanted = rng.integers(0, len(known), 40)
    assert (find_rows(tuple(known.T), tuple(known[wanted].T), "point") == wanted).all()
    other = known[wanted].copy()
    other[[3, 39], [0, 1]] += 1
    with pytest.raises(InputError, match="a point of contact in the checkpoint, one of 2,"):
        find_rows(tuple(known.T), tuple(other.T), "point")
    none = tuple(np.empty((3, 0), dtype=np.int64))
    assert find_rows(none, none, "point").size == 0
    with pytest.raises(InputError, match="one of 40,"):
        find_rows(none, tuple(known[wanted].T), "point")
