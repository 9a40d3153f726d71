"""`python -m tests`: all tests on one rank, and those marked mpi on three ranks.

First one process fills the caches of what is compiled. Then there is work for two cores: one has a
process with the tests on one rank, the other has the three ranks, and a second such process when
these have ended. Both processes start at an end of the list and go on until they meet.

Further arguments go to pytest. What failed is shown when all has ended. The last line adds up: a
test that fails on any rank has failed. Exit status 1 if one did, if a rank hung, or if none ran.
"""

import contextlib
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import pytest

NUM_RANKS = 3
TESTS = Path(__file__).resolve().parent
ROOT = TESTS.parent

#: A test that takes longer shows where each thread stands [s]; a run in which none ends for so long
#: hangs, and is ended: a busy machine is slow, but goes on.
TEST_SECONDS = 240
STILL_SECONDS = 1200
#: How often it is said how far the tests are [s].
SAID_SECONDS = 15

#: Outcomes on several ranks, and of the phases of a test on one, the worst last: a test that is
#: skipped still passes its end.
ORDER = ("skipped", "passed", "failed")
OF_PHASES = ("passed", "skipped", "failed")

#: A rank of MPICH that waits sleeps: beside other programs, messages among three ranks on two
#: cores take a third of the processor's time and half of the time. Another MPI ignores this.
SLEEPING = {"MPIR_CVAR_ENABLE_HEAVY_YIELD": "1"}

#: Seconds for which a process waits for a form that another one compiles, on a busy machine; and
#: the age from which on a source without a library was left by a program that was killed.
FORM_SECONDS = 120


def main(arguments):
    """Run both and return the exit status."""
    if {"-h", "--help"} & set(arguments):
        print(__doc__)
        return 0
    with tempfile.TemporaryDirectory() as scratch:
        one, three = folders = [Path(scratch, "one"), Path(scratch, "three")]
        for folder in folders:
            folder.mkdir()
        environment = {**os.environ, "OMP_NUM_THREADS": "1", **SLEEPING}
        environment |= _shared_forms(Path(scratch))
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # each process would compile all tests
        _compile_once(Path(scratch), environment)
        python = [sys.executable, "-m"]
        workers = [
            [*python, "tests", "--as-worker", str(number), str(one), "not slow", *arguments]
            for number in range(2)
        ]
        ranks = [*python, "mpi4py", "-m", "tests", "--as-rank", str(three)]
        ranks += ["mpi and not slow", *arguments]
        mpirun = _mpirun()
        if mpirun is None:
            print("no mpirun beside Python or on PATH: tests on several ranks cannot run")
            lines = [[workers[0]], [workers[1]]]
        else:
            lines = [[workers[0]], [[mpirun, "-n", str(NUM_RANKS), *ranks], workers[1]]]
        ended_well = _run(lines, environment, folders)
        outcomes = [_outcomes(folder) for folder in folders]
        failed = sorted({name for each in outcomes for name in each if each[name] == "failed"})
        if failed or not ended_well:
            _show_outputs(folders)
            print("", *(f"failed: {name}" for name in failed), sep="\n")
    counts = Counter(kind for found in outcomes for kind in found.values())
    if not ended_well or mpirun is None:  # a process that crashed or hung names no test
        counts["failed"] = max(1, counts["failed"])
    if not counts:
        print("no test matches")
    passed, failed, skipped = (counts[kind] for kind in ("passed", "failed", "skipped"))
    print(f"\n{passed} passed, {failed} failed, {skipped} skipped", flush=True)
    return 1 if failed or not passed else 0


def as_rank(folder, marks, arguments):
    """Run pytest on this rank of several, started by `python -m mpi4py`."""
    from mpi4py import MPI

    status = _run_pytest(MPI.COMM_WORLD.rank, folder, marks, arguments, [])
    MPI.COMM_WORLD.Barrier()  # a rank that ends with another status than 0 ends the others too
    return status


def as_worker(number, folder, marks, arguments):
    """Run the tests that the other worker has not begun; the second begins at the end."""
    return _run_pytest(number, folder, marks, arguments, [Sharing(folder, number == 1)])


def _run_pytest(number, folder, marks, arguments, plugins):
    """Run pytest; what it prints goes into a file of ``folder``."""
    log = os.open(_log(folder, number), os.O_WRONLY | os.O_CREAT)
    os.dup2(log, sys.stdout.fileno())
    os.dup2(log, sys.stderr.fileno())
    status = pytest.main(
        [
            *map(str, _files(marks)),
            f"--rootdir={ROOT}",
            f"--override-ini=faulthandler_timeout={TEST_SECONDS}",
            # Ranks share no cache and no numbered temporary folders.
            "-p",
            "no:cacheprovider",
            f"--basetemp={folder / f'temp{number}'}",
            "-m",
            marks,
            *arguments,
        ],
        plugins=[Outcomes(folder / f"{number}.outcomes"), *plugins],
    )
    return 0 if status == pytest.ExitCode.NO_TESTS_COLLECTED else int(status)


def _files(marks):
    """Where such tests may be: of those marked mpi, only the files that name the mark are read."""
    if not marks.startswith("mpi"):
        return [TESTS]
    return [p for p in sorted(TESTS.rglob("test_*.py")) if "mark.mpi" in p.read_text("utf-8")]


def _log(folder, number):
    return folder / f"{number}.txt"


class Outcomes:
    """A plugin of pytest that writes each outcome down at once: what was found is never lost."""

    def __init__(self, path):
        self._path = path
        path.touch()

    def pytest_collection_finish(self, session):
        """The number of tests, for who waits."""
        self._path.with_suffix(".number").write_text(str(len(session.items)))

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


def _shared_forms(scratch):
    """Variables by which DOLFINx keeps what it compiles for tests in one folder, and waits longer.

    By itself it waits 10 s for a form that another process compiles, or was killed at, and fails.
    """
    from mufe_fenicsx.kernels.build.native import cache_folder

    forms = cache_folder() / "forms_of_tests"
    forms.mkdir(exist_ok=True)
    for source in forms.glob("*.c"):
        with contextlib.suppress(OSError):
            made = source.with_suffix(".c.cached").exists()
            if not made and time.time() - source.stat().st_mtime > FORM_SECONDS:
                source.unlink()
    options = scratch / "dolfinx" / "dolfinx_jit_options.json"
    options.parent.mkdir()
    wanted = {"cache_dir": str(forms), "timeout": FORM_SECONDS}
    options.write_text(json.dumps(wanted), encoding="utf-8")
    return {"XDG_CONFIG_HOME": str(scratch)}


def _compile_once(scratch, environment):
    """Fill empty caches by a short run: processes that start together find them filled."""
    from mufe_fenicsx.kernels.build.ahead import is_kept

    if is_kept():
        return
    print("== compiling", flush=True)
    command = [sys.executable, "-m", "mufe_fenicsx", "run", ROOT / "demos" / "first.toml"]
    command += ["-o", scratch / "first", "--max-steps", "20", "--quiet"]
    subprocess.run(
        command, cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
    )


def _mpirun():
    """The launcher of the environment's own MPI, or the one on PATH."""
    beside = Path(sys.executable).parent / "mpirun"
    return str(beside) if beside.exists() else shutil.which("mpirun")


def _run(lines, environment, folders):
    """Whether all commands ended with status 0; where no test ends any more, all are killed.

    Args:
        lines: Of commands, one of each line after the other.
        environment: Their variables.
        folders: Of their outcomes.
    """
    waiting = [list(line) for line in lines]
    running, ended_well = [None] * len(lines), True
    since = said = time.monotonic()
    size, told = 0, set()
    print(f"== tests on one rank, beside those marked mpi on {NUM_RANKS}", flush=True)
    try:
        while any(waiting) or any(running):
            for k, process in enumerate(running):
                if process is not None and process.poll() is not None:
                    ended_well &= process.returncode == 0
                    if process.returncode < 0:  # pytest says itself what failed
                        how = signal.Signals(-process.returncode).name
                        print(f"a process was ended by {how}: {process.args}", flush=True)
                    running[k] = None
                if running[k] is None and waiting[k]:
                    running[k] = _start(waiting[k].pop(0), environment)
            time.sleep(0.2)
            now, before, size = time.monotonic(), size, _size(folders)
            if size != before:
                since = now
            elif now - since > STILL_SECONDS:
                print(f"no test has ended for {STILL_SECONDS} s: a rank hangs", flush=True)
                return False
            if now - said > SAID_SECONDS:
                said = now
                _say(folders, told)
        return ended_well
    finally:
        for process in running:
            if process is not None and process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def _start(command, environment):
    return subprocess.Popen(
        command, cwd=ROOT, env=environment, start_new_session=True, stdin=subprocess.DEVNULL
    )


def _size(folders):
    """Bytes of all outcomes."""
    return sum(path.stat().st_size for folder in folders for path in folder.glob("*.outcomes"))


def _say(folders, told):
    """Say how many tests have ended so far, and once of each that it has failed."""
    found = [_outcomes(folder) for folder in folders]
    one, three = (f"{len(o)} of {_number(f)}" for o, f in zip(found, folders, strict=True))
    print(f"{one} tests on one rank, {three} on {NUM_RANKS}", flush=True)
    failed = {name for each in found for name, kind in each.items() if kind == "failed"}
    for name in sorted(failed - told):
        print(f"failed: {name}", flush=True)
    told |= failed


def _number(folder):
    """Of tests to run, as soon as a process has read them all."""
    return max((int(p.read_text() or 0) for p in folder.glob("*.number")), default="?")


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


def _show_outputs(folders):
    """What the processes printed in which tests failed; if none, all, one of which has crashed."""
    paths = [path for folder in folders for path in sorted(folder.glob("*.outcomes"))]
    lines = {path: path.read_text(encoding="utf-8").splitlines() for path in paths}
    with_failures = [path for path in paths if any(x.startswith("failed") for x in lines[path])]
    for path in with_failures or paths:
        last = lines[path][-1].split("\t", 1)[1] if lines[path] else "no test"
        name = f"{path.parent.name}, process {path.stem}"
        print(f"\n== {name}, last test {last}", flush=True)
        log = _log(path.parent, path.stem)
        print(log.read_text(errors="replace") if log.exists() else "nothing", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--as-worker"]:
        sys.exit(as_worker(int(sys.argv[2]), Path(sys.argv[3]), sys.argv[4], sys.argv[5:]))
    if sys.argv[1:2] == ["--as-rank"]:
        sys.exit(as_rank(Path(sys.argv[2]), sys.argv[3], sys.argv[4:]))
    sys.exit(main(sys.argv[1:]))
