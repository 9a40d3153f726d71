"""One run at a time writes into a folder, and knows when the folder is no longer its own."""

import json
import os
import shutil
import socket
import subprocess
import sys

import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.output import run_lock
from mufe_fenicsx.output.run_folder import LOCK
from mufe_fenicsx.output.run_lock import LostFolder, RunLock, read_lock
from mufe_fenicsx.run.recorder import Recorder
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import Contact, Oedometer, Output, Scene
from tests.bodies import RADIUS, packed_grains

COMM = MPI.COMM_WORLD


@pytest.fixture
def folder(tmp_path_factory):
    """A folder that all ranks share, with grains."""
    path = COMM.bcast(tmp_path_factory.mktemp("lock") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        save_grains(path / "grains", packed_grains((3, 1, 1), h=RADIUS))
    COMM.Barrier()
    return path


def run(folder, **options):
    scene = Scene(
        material=Elastic(1e11, 0.2, 2650.0),
        contact=Contact(friction=0.3),
        oedometer=Oedometer(strain=0.004, ramp=0.0, speed=20.0, seating_stress=1e4),
        output=Output(fields=2, history=11),
    )
    return run_scene(scene, folder / "grains", folder / "out", COMM, quiet=True, **options)


def test_a_folder_that_is_being_written_is_refused_and_stays_as_it_is(folder, monkeypatch):
    """A second run begins while the first one writes a state: with --overwrite, and to resume."""
    seen, write_state = [], Recorder.write_state

    def second(recorder):
        write_state(recorder)
        for options in ({"overwrite": True}, {"resume": True}, {}):
            with pytest.raises(InputError, match=r"is being written by another run \(process"):
                run(folder, **options)
            seen.append(read_lock(folder / "out")["process"])

    monkeypatch.setattr(Recorder, "write_state", second)
    assert run(folder)["finished"]
    assert len(seen) == 6 and len(set(seen)) == 1
    COMM.Barrier()
    assert not list((folder / "out").glob(f"{LOCK}*"))
    COMM.Barrier()
    monkeypatch.undo()
    assert run(folder, overwrite=True)["finished"]


@pytest.mark.parametrize("what", ["taken", "deleted"])
def test_a_run_that_lost_its_folder_ends_and_writes_nothing(folder, monkeypatch, what):
    """As one that was stopped while another took its folder over."""
    write_state, out = Recorder.write_state, folder / "out"
    other = {"token": "another", "host": "elsewhere", "process": 7, "time": "now"}

    def lose(recorder):
        write_state(recorder)
        if COMM.rank == 0:
            if what == "deleted":
                shutil.rmtree(out)
            else:
                (out / LOCK).write_text(json.dumps(other))
                (out / "history.csv").write_text("theirs")
        COMM.Barrier()

    monkeypatch.setattr(Recorder, "write_state", lose)
    expected = "is gone, deleted or moved" if what == "deleted" else "process 7 on elsewhere since"
    with pytest.raises(LostFolder, match=expected):
        run(folder)
    COMM.Barrier()
    if what == "deleted":
        assert not out.exists()
    else:
        assert (out / "history.csv").read_text() == "theirs"
        assert read_lock(out) == other


def lock_of(tmp_path, age=0.0, **changes):
    """A lock of a folder, as another run left it."""
    content = {"token": "a", "host": "h", "machine": "m", "process": 1, "started": 5, "time": "t"}
    path = tmp_path / LOCK
    path.write_text(json.dumps(content | changes))
    os.utime(path, (path.stat().st_mtime - age,) * 2)
    return RunLock(MPI.COMM_SELF, tmp_path)


def test_a_lock_of_this_machine_is_stale_when_its_process_is_gone(tmp_path):
    """Gone, or another one that has its number now; how old it is does not matter."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    started = run_lock._start_of(os.getpid())
    ended.wait()
    mine = {"machine": run_lock._machine(), "process": os.getpid()}
    with pytest.raises(InputError, match=f"process {os.getpid()} on h since t"):
        lock_of(tmp_path, age=1e6, **mine, started=started).take()
    for gone in (mine | {"started": 1}, mine | {"process": ended.pid}):
        lock = lock_of(tmp_path, **gone)
        lock.look()
        assert "is stale" in lock.take()
        assert read_lock(tmp_path)["host"] == socket.gethostname()
        lock.check()
        lock.free()
        assert os.listdir(tmp_path) == []


def test_a_lock_of_another_machine_is_stale_when_it_was_not_touched(tmp_path):
    told = r"process 1 on h since t, touched 9.0 minutes ago\).*delete .*run.lock"
    with pytest.raises(InputError, match=told):
        lock_of(tmp_path, age=run_lock.SILENCE - 60).take()
    assert "is stale" in lock_of(tmp_path, age=run_lock.SILENCE + 60).take()
    (tmp_path / LOCK).write_text("")  # damaged, just now
    with pytest.raises(InputError, match="is torn and does not say"):
        RunLock(MPI.COMM_SELF, tmp_path).take()


def test_a_torn_lock_says_what_to_do(tmp_path):
    """Which file to delete, when that is safe, and how long to wait otherwise."""
    (tmp_path / "run.lock").write_text("{")
    with pytest.raises(InputError) as caught:
        RunLock(MPI.COMM_SELF, tmp_path).look()
    assert "its run.lock is torn and does not say which" in str(caught.value)
    assert f"where it has, delete {tmp_path}/run.lock, or wait" in str(caught.value)
    assert "10 minutes after it was touched last" in str(caught.value)


def test_one_of_many_takes_a_stale_lock(tmp_path):
    """Threads in place of programs: each thinks that the lock is stale; one holds it then."""
    from concurrent.futures import ThreadPoolExecutor

    lock_of(tmp_path, age=1e6)
    locks = [RunLock(MPI.COMM_SELF, tmp_path) for _ in range(8)]

    def take(lock):
        try:
            lock._acquire()  # without MPI, which one thread uses
        except InputError:
            return None
        return lock

    with ThreadPoolExecutor(8) as pool:
        taken = [lock for lock in pool.map(take, locks) if lock is not None]
    assert sum(lock._lost() is None for lock in taken) == 1
    for lock in locks:
        lock.free()
    assert os.listdir(tmp_path) == []


def test_a_holder_touches_its_lock(tmp_path, monkeypatch):
    monkeypatch.setattr(run_lock, "BEAT", 0.01)
    lock = lock_of(tmp_path, age=1e6)
    lock.take()
    os.utime(tmp_path / LOCK, (0, 0))
    for _ in range(500):
        if (tmp_path / LOCK).stat().st_mtime > 1:
            break
        lock._beating.wait(0.01)
    assert (tmp_path / LOCK).stat().st_mtime > 1
    lock.free()
