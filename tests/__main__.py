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
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

NUM_RANKS = 3
TESTS = Path(__file__).resolve().parent

#: A test that takes longer shows where each thread stands [s]; a whole run that does is ended.
TEST_SECONDS = 240
RUN_SECONDS = 1500

ORDER = ("skipped", "passed", "failed")  # the worst last


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
        ended_well = [_run(one, environment)]
        print(f"\n== marked mpi, on {NUM_RANKS} ranks: output of rank 0", flush=True)
        mpirun = _mpirun()
        if mpirun is None:
            print("no mpirun beside Python or on PATH: tests on several ranks cannot run")
        ended_well.append(
            mpirun is not None and _run([mpirun, "-n", str(NUM_RANKS), *three], environment)
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
            f"--junitxml={folder / f'rank{rank}.xml'}",
            f"--override-ini=faulthandler_timeout={TEST_SECONDS}",
            # Ranks share no cache and no numbered temporary folders.
            "-p",
            "no:cacheprovider",
            f"--basetemp={folder / f'temp{rank}'}",
            "-m",
            marks,
            *arguments,
        ]
    )
    if wait_for_others:  # a rank that ends with another status than 0 ends the others too
        wait_for_others()
    return 0 if status == pytest.ExitCode.NO_TESTS_COLLECTED else int(status)


def _mpirun():
    """The launcher of the environment's own MPI, or the one on PATH."""
    beside = Path(sys.executable).parent / "mpirun"
    return str(beside) if beside.exists() else shutil.which("mpirun")


def _run(command, environment):
    """Whether the command ended with status 0 in time; one that did not is killed."""
    process = subprocess.Popen(
        command, cwd=TESTS.parent, env=environment, start_new_session=True, stdin=subprocess.DEVNULL
    )
    try:
        return process.wait(timeout=RUN_SECONDS) == 0
    except subprocess.TimeoutExpired:
        print(f"no end after {RUN_SECONDS} s: a rank hangs", flush=True)
        return False
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _outcomes(folder):
    """{test: "passed", "failed" or "skipped"}, the worst of all ranks."""
    outcomes = {}
    for path in folder.glob("rank*.xml"):
        for case in ElementTree.parse(path).iter("testcase"):
            name = (case.get("classname"), case.get("name"))
            kinds = {child.tag for child in case}
            kind = "failed" if kinds & {"failure", "error"} else "passed"
            kind = "skipped" if kind == "passed" and "skipped" in kinds else kind
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
