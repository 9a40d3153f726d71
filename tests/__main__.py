"""`python -m tests`: all tests on one rank, then those marked mpi on three ranks.

Two processes share the tests on one rank: they start at both ends of the list and go on until
they meet, so that both end together whatever the tests take. Further arguments go to pytest.
The last line adds up both runs; a test that fails on any rank has failed. Exit status 1 if one
did, if a rank hung, or if none ran.
"""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

NUM_RANKS = 3
NUM_WORKERS = 2
TESTS = Path(__file__).resolve().parent

#: A test that takes longer shows where each thread stands [s]; a run in which none ends for so long
#: hangs, and is ended: a busy machine is slow, but goes on.
TEST_SECONDS = 240
STILL_SECONDS = 1200

#: Outcomes on several ranks, and of the phases of a test on one, the worst last: a test that is
#: skipped still passes its end.
ORDER = ("skipped", "passed", "failed")
OF_PHASES = ("passed", "skipped", "failed")


#: What marks a test for several ranks: no other file is read there, which takes each rank seconds.
MARK = "mark.mpi"

#: A rank of MPICH that waits sleeps: beside other programs, messages among three ranks on two
#: cores take a third of the processor's time and half of the time. Another MPI ignores this.
SLEEPING = {"MPIR_CVAR_ENABLE_HEAVY_YIELD": "1"}


def main(arguments):
    """Run both and return the exit status."""
    python = [sys.executable, "-m"]
    with tempfile.TemporaryDirectory() as scratch:
        folders = [Path(scratch, "one"), Path(scratch, "three")]
        for folder in folders:
            folder.mkdir()
        environment = {**os.environ, "OMP_NUM_THREADS": "1", **SLEEPING}
        ones = [
            [*python, "tests", "--as-worker", str(number), str(folders[0]), "not slow", *arguments]
            for number in range(NUM_WORKERS)
        ]
        own = [environment | _own_forms(Path(scratch, f"w{n}")) for n in range(NUM_WORKERS)]
        three = [*python, "mpi4py", "-m", "tests", "--as-rank", str(folders[1])]
        three += ["mpi and not slow", *arguments]
        print(f"== on one rank, in {NUM_WORKERS} processes: output of the first", flush=True)
        ended_well = [_run(ones, own, folders[0])]
        print(f"\n== marked mpi, on {NUM_RANKS} ranks: output of rank 0", flush=True)
        mpirun = _mpirun()
        if mpirun is None:
            print("no mpirun beside Python or on PATH: tests on several ranks cannot run")
        ended_well.append(
            mpirun is not None
            and _run([[mpirun, "-n", str(NUM_RANKS), *three]], own[:1], folders[1])
        )
        outcomes = [_outcomes(folder) for folder in folders]
        for ok, outcome, folder in zip(ended_well, outcomes, folders, strict=True):
            if not ok or "failed" in outcome.values():
                _show_others(folder)

    counts = {kind: sum(list(o.values()).count(kind) for o in outcomes) for kind in ORDER}
    for ok, outcome in zip(ended_well, outcomes, strict=True):
        if not ok and "failed" not in outcome.values():
            counts["failed"] += 1  # a rank that crashed or hung names no test
    passed, failed, skipped = (counts[kind] for kind in ("passed", "failed", "skipped"))
    print(f"\n{passed} passed, {failed} failed, {skipped} skipped", flush=True)
    return 1 if failed or not passed else 0


def as_rank(folder, marks, arguments):
    """Run pytest on this rank of several, started by `python -m mpi4py`."""
    from mpi4py import MPI

    files = [path for path in sorted(TESTS.rglob("test_*.py")) if MARK in path.read_text("utf-8")]
    status = _run_pytest(MPI.COMM_WORLD.rank, folder, files, marks, arguments, [])
    MPI.COMM_WORLD.Barrier()  # a rank that ends with another status than 0 ends the others too
    return status


def as_worker(number, folder, marks, arguments):
    """Run the tests that no other worker has begun, every other worker from the end."""
    sharing = Sharing(folder, number % 2 == 1)
    return _run_pytest(number, folder, [TESTS], marks, arguments, [sharing])


def _run_pytest(rank, folder, tests, marks, arguments, plugins):
    """Run pytest; only rank 0 prints, the others into a file of ``folder``."""
    if rank != 0:
        log = os.open(folder / f"rank{rank}.txt", os.O_WRONLY | os.O_CREAT)
        os.dup2(log, sys.stdout.fileno())
        os.dup2(log, sys.stderr.fileno())
    status = pytest.main(
        [
            *map(str, tests),
            f"--rootdir={TESTS.parent}",
            f"--override-ini=faulthandler_timeout={TEST_SECONDS}",
            # Ranks share no cache and no numbered temporary folders.
            "-p",
            "no:cacheprovider",
            f"--basetemp={folder / f'temp{rank}'}",
            "-m",
            marks,
            *arguments,
        ],
        plugins=[Outcomes(folder / f"rank{rank}.outcomes"), *plugins],
    )
    return 0 if status == pytest.ExitCode.NO_TESTS_COLLECTED else int(status)


class Outcomes:
    """A plugin of pytest that writes each outcome down at once: what was found is never lost."""

    def __init__(self, path):
        self._path = path
        path.touch()

    def pytest_runtest_logreport(self, report):
        """One line for each phase of a test."""
        with open(self._path, "a", encoding="utf-8") as file:
            file.write(f"{report.outcome}\t{report.nodeid}\n")

    def pytest_collectreport(self, report):
        """A file that cannot be collected has failed."""
        if report.failed:
            self.pytest_runtest_logreport(report)


class Sharing:
    """A plugin of pytest that leaves out what another process has begun.

    From both ends, two meet within one file at most: fixtures of the others are made once.
    """

    def __init__(self, folder, backwards):
        self._begun = folder / "begun"
        self._begun.mkdir(exist_ok=True)
        self._backwards = backwards

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        """The order of this process."""
        if self._backwards:
            items.reverse()

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item):
        """True, as of a test that has been run, where another process has begun it."""
        name = hashlib.sha256(item.nodeid.encode()).hexdigest()
        try:
            (self._begun / name).touch(exist_ok=False)
        except FileExistsError:
            return True
        return None


def _own_forms(folder):
    """Variables by which DOLFINx keeps what it compiles in a folder of this run.

    It waits 10 s for a form that another process compiles, or was killed at, and then fails.
    """
    options = folder / "dolfinx" / "dolfinx_jit_options.json"
    options.parent.mkdir(parents=True)
    options.write_text(json.dumps({"cache_dir": str(folder / "forms")}), encoding="utf-8")
    return {"XDG_CONFIG_HOME": str(folder)}


def _mpirun():
    """The launcher of the environment's own MPI, or the one on PATH."""
    beside = Path(sys.executable).parent / "mpirun"
    return str(beside) if beside.exists() else shutil.which("mpirun")


def _run(commands, environments, folder):
    """Whether all ended with status 0; where no test ends any more, all are killed."""
    processes = [
        subprocess.Popen(
            command,
            cwd=TESTS.parent,
            env=environment,
            start_new_session=True,
            stdin=subprocess.DEVNULL,
        )
        for command, environment in zip(commands, environments, strict=True)
    ]
    try:
        written, since = 0, time.monotonic()
        while any(process.poll() is None for process in processes):
            time.sleep(0.5)
            now = sum(path.stat().st_size for path in folder.glob("*.outcomes"))
            if now != written:
                written, since = now, time.monotonic()
            elif time.monotonic() - since > STILL_SECONDS:
                print(f"no test has ended for {STILL_SECONDS} s: a rank hangs", flush=True)
                return False
        for number, process in enumerate(processes):
            if process.returncode < 0:  # pytest says itself what failed
                how = signal.Signals(-process.returncode).name
                print(f"process {number} was ended by {how}", flush=True)
        return not any(process.returncode for process in processes)
    finally:
        for process in processes:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def _outcomes(folder):
    """{test: "passed", "failed" or "skipped"}, the worst of all ranks."""
    outcomes = {}
    for path in folder.glob("*.outcomes"):
        here = {}
        for line in path.read_text(encoding="utf-8").splitlines():
            kind, name = line.split("\t", 1)
            here[name] = max(kind, here.get(name, kind), key=OF_PHASES.index)
        for name, kind in here.items():
            outcomes[name] = max(kind, outcomes.get(name, kind), key=ORDER.index)
    return outcomes


def _show_others(folder):
    for path in sorted(folder.glob("*.outcomes")):
        names = [line.split("\t", 1)[1] for line in path.read_text("utf-8").splitlines()]
        print(f"{path.stem} ended after {names[-1] if names else 'no test'}", flush=True)
    for path in sorted(folder.glob("rank*.txt")):
        print(f"\n== output of {path.stem}", flush=True)
        print(path.read_text(errors="replace"), flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--as-worker"]:
        sys.exit(as_worker(int(sys.argv[2]), Path(sys.argv[3]), sys.argv[4], sys.argv[5:]))
    if sys.argv[1:2] == ["--as-rank"]:
        sys.exit(as_rank(Path(sys.argv[2]), sys.argv[3], sys.argv[4:]))
    sys.exit(main(sys.argv[1:]))
