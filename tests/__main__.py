"""`python -m tests`: all tests on one rank, then those marked mpi on three ranks.

Further arguments go to pytest. The last line adds up both runs; a test that fails
on any rank has failed. Exit status 1 if one did, if a rank hung, or if none ran.
"""

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
TESTS = Path(__file__).resolve().parent

#: A test that takes longer shows where each thread stands [s]; a run in which none ends for so long
#: hangs, and is ended: a busy machine is slow, but goes on.
TEST_SECONDS = 240
STILL_SECONDS = 1200

#: Outcomes on several ranks, and of the phases of a test on one, the worst last: a test that is
#: skipped still passes its end.
ORDER = ("skipped", "passed", "failed")
OF_PHASES = ("passed", "skipped", "failed")


def main(arguments):
    """Run both and return the exit status."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    python = [sys.executable, "-m"]
    with tempfile.TemporaryDirectory() as scratch:
        folders = [Path(scratch, "one"), Path(scratch, "three")]
        for folder in folders:
            folder.mkdir()
        one = [*python, "tests", "--as-rank", str(folders[0]), "not slow", *arguments]
        three = [*python, "mpi4py", "-m", "tests", "--as-rank", str(folders[1])]
        three += ["mpi and not slow", *arguments]
        print("== on one rank", flush=True)
        ended_well = [_run(one, environment, folders[0])]
        print(f"\n== marked mpi, on {NUM_RANKS} ranks: output of rank 0", flush=True)
        mpirun = _mpirun()
        if mpirun is None:
            print("no mpirun beside Python or on PATH: tests on several ranks cannot run")
        ended_well.append(
            mpirun is not None
            and _run([mpirun, "-n", str(NUM_RANKS), *three], environment, folders[1])
        )
        outcomes = [_outcomes(folder) for folder in folders]
        if not ended_well[1] or "failed" in outcomes[1].values():
            _show_other_ranks(folders[1])

    counts = {kind: sum(list(o.values()).count(kind) for o in outcomes) for kind in ORDER}
    for ok, outcome in zip(ended_well, outcomes, strict=True):
        if not ok and "failed" not in outcome.values():
            counts["failed"] += 1  # a rank that crashed or hung names no test
    passed, failed, skipped = (counts[kind] for kind in ("passed", "failed", "skipped"))
    print(f"\n{passed} passed, {failed} failed, {skipped} skipped", flush=True)
    return 1 if failed or not passed else 0


def as_rank(folder, marks, arguments):
    """Run pytest on this rank; only rank 0 prints, the others into a file of ``folder``."""
    rank, wait_for_others = 0, None
    if "mpi4py" in sys.modules:  # started by `python -m mpi4py`
        from mpi4py import MPI

        rank, wait_for_others = MPI.COMM_WORLD.rank, MPI.COMM_WORLD.Barrier
    if rank != 0:
        log = os.open(folder / f"rank{rank}.txt", os.O_WRONLY | os.O_CREAT)
        os.dup2(log, sys.stdout.fileno())
        os.dup2(log, sys.stderr.fileno())
    status = pytest.main(
        [
            str(TESTS),
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
        plugins=[Outcomes(folder / f"rank{rank}.outcomes")],
    )
    if wait_for_others:  # a rank that ends with another status than 0 ends the others too
        wait_for_others()
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


def _mpirun():
    """The launcher of the environment's own MPI, or the one on PATH."""
    beside = Path(sys.executable).parent / "mpirun"
    return str(beside) if beside.exists() else shutil.which("mpirun")


def _run(command, environment, folder):
    """Whether the command ended with status 0; one in which no test ends any more is killed."""
    process = subprocess.Popen(
        command, cwd=TESTS.parent, env=environment, start_new_session=True, stdin=subprocess.DEVNULL
    )
    try:
        written, since = 0, time.monotonic()
        while process.poll() is None:
            time.sleep(0.5)
            now = sum(path.stat().st_size for path in folder.glob("*.outcomes"))
            if now != written:
                written, since = now, time.monotonic()
            elif time.monotonic() - since > STILL_SECONDS:
                print(f"no test has ended for {STILL_SECONDS} s: a rank hangs", flush=True)
                return False
        return process.returncode == 0
    finally:
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


def _show_other_ranks(folder):
    for path in sorted(folder.glob("rank*.txt")):
        print(f"\n== output of {path.stem}", flush=True)
        print(path.read_text(errors="replace"), flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--as-rank"]:
        sys.exit(as_rank(Path(sys.argv[2]), sys.argv[3], sys.argv[4:]))
    sys.exit(main(sys.argv[1:]))
