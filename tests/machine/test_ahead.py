"""What a run needs is compiled by a second process beside it, which may come to any end."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest
from mpi4py import MPI

from mufe_fenicsx import load_scene, run_scene
from mufe_fenicsx.kernels.build import ahead, native, turns
from mufe_fenicsx.kernels.build.cache_files import SealedCacheFile
from mufe_fenicsx.machine.mpi_launcher import environment_without_launcher

ROOT = Path(__file__).resolve().parents[2]
#: Takes the turn for the file that it is given, and says so.
HOLD = (
    "import sys, time; from mufe_fenicsx.kernels.build import turns; "
    "turns.take_turn(sys.argv[1]); print('mine', flush=True); time.sleep(600)"
)


@pytest.fixture
def other(tmp_path):
    """A process whose turn it is to make a file, and that file."""
    path = str(tmp_path / "made")
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, path], stdout=subprocess.PIPE, text=True,
        env=environment_without_launcher() | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert process.stdout.readline() == "mine\n"
    yield process, path
    process.kill()
    process.wait()


def test_words_of_types():
    array, pair = numba.types.Array, numba.types.UniTuple
    assert ahead.types_of("d l*3 i2 b1s f") == (
        numba.float64, pair(numba.int64, 3), array(numba.int32, 2, "C"),
        array(numba.boolean, 1, "A"), numba.float32,
    )  # fmt: skip


def test_listed_loops_are_those_that_the_first_run_calls(tmp_path):
    """With these types of arguments; of others the second process would compile in vain."""
    scene = load_scene(ROOT / "demos" / "first.toml")
    run_scene(scene, scene.sample.grains, tmp_path / "run", MPI.COMM_SELF, max_steps=2, quiet=True)
    others = {
        name: words
        for name, words in ahead.LOOPS.items()
        if ahead.types_of(words) not in ahead._loop(name).signatures
    }
    assert not others


def test_a_turn_is_waited_for_and_comes_where_its_process_is_killed(other, monkeypatch):
    process, path = other
    monkeypatch.setattr(turns, "PATIENCE", 0.3)
    started = time.monotonic()
    turns.take_turn(path)
    assert time.monotonic() - started >= 0.3  # no longer: it may have been stopped
    turns.take_turn(path + " and another one")
    assert time.monotonic() - started < 30.0
    monkeypatch.setattr(turns, "PATIENCE", 600.0)
    os.kill(process.pid, signal.SIGKILL)
    turns.take_turn(path)
    turns.end_turn(path)


def test_without_locks_nobody_waits():
    turns.take_turn("/proc/nowhere/made")
    turns.end_turn("/proc/nowhere/made")


def test_what_another_process_saved_meanwhile_is_taken(tmp_path, monkeypatch):
    """The second look, once it is this one's turn, finds the loop, and the turn passes on."""
    cache = SealedCacheFile(str(tmp_path), "loop", 1)
    given_back = []

    def take_turn(path):
        SealedCacheFile(str(tmp_path), "loop", 1).save("key", "code")

    monkeypatch.setattr("mufe_fenicsx.kernels.build.cache_files.take_turn", take_turn)
    monkeypatch.setattr("mufe_fenicsx.kernels.build.cache_files.end_turn", given_back.append)
    assert cache.is_empty()
    assert cache.load("key") == "code" and not cache.is_empty()
    assert given_back == [str(tmp_path / "loop.nbi")] * 2  # by the other one and by this one


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """Empty caches, and one loop in the list."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "numba"))
    monkeypatch.setattr(SealedCacheFile, "is_empty", lambda self: True)
    ahead.compile_ahead.cache_clear()
    yield tmp_path
    ahead.compile_ahead.cache_clear()


def test_a_second_process_that_is_killed_does_no_harm(empty):
    process = ahead.compile_ahead()
    assert process is not None and ahead.compile_ahead() is process
    process.kill()
    process.wait()
    native.load.cache_clear()
    assert native.load("kick_drift")._name.startswith(str(empty))
    native.load.cache_clear()


def _scratch_of(process):
    """Folder for what compilers leave half-made, of which the environment of the process tells."""
    told = Path(f"/proc/{process.pid}/environ").read_text().split("\0")
    return [Path(line.partition("=")[2]) for line in told if line.startswith("TMPDIR=")]


def test_the_second_process_makes_sources_and_loops(empty, monkeypatch):
    """Of both the first that it can have: it goes on with the others until it is ended."""
    process = ahead.compile_ahead()
    until = time.monotonic() + 300.0
    wanted = {"kick_drift-": ".so", "element_step.add_nodal_stiffness-": ".nbc"}
    while wanted and time.monotonic() < until and process.poll() is None:
        names = [path.name for path in empty.rglob("*")]
        for name in list(wanted):
            if any(n.startswith(name) and n.endswith(wanted[name]) for n in names):
                del wanted[name]
        time.sleep(0.05)
    (scratch,) = _scratch_of(process)
    ahead._end(process, scratch)
    assert not wanted and not scratch.exists()
    with pytest.raises(ProcessLookupError):  # not even a zombie is left
        os.kill(process.pid, 0)


def test_where_all_is_kept_or_no_process_can_begin_the_run_compiles_alone(empty, monkeypatch):
    monkeypatch.setattr(ahead.sys, "executable", "/proc/nowhere/python")
    assert ahead.compile_ahead() is None
    ahead.compile_ahead.cache_clear()
    monkeypatch.setattr(SealedCacheFile, "is_empty", lambda self: False)
    monkeypatch.setattr(ahead, "are_kept", lambda: True)
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda *a, **k: pytest.fail("not needed"))
    assert ahead.compile_ahead() is None


def test_a_source_that_cannot_be_compiled_is_one_clear_line(empty, monkeypatch, capfd):
    """In the second process it passes in silence."""
    monkeypatch.setenv("CC", "no-such-compiler")
    native.load.cache_clear()
    ahead._load("kick_drift")
    with pytest.raises(native.InputError, match="C compiler = none in PATH"):
        native.load("kick_drift")
    assert capfd.readouterr() == ("", "")
