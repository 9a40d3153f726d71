"""Commands as processes of their own, on one rank or several, and how a refusal looks."""

import os
import re
import signal
import subprocess
from pathlib import Path

import pytest

from mufe_fenicsx.machine.mpi_launcher import find_mpirun

#: Longest time for a command that has nothing to do [s]; one that hangs is ended then.
PATIENCE = 600
#: The first line of a run.
ANNOUNCED = re.compile("mufe: .*; grains .*, results in .*")
#: Variables by which a process of its own finds the package.
FROM_HERE = {"PYTHONPATH": str(Path(__file__).parents[2])}


def run(command, cwd, num_ranks=None):
    """Run a command, under mpirun where ``num_ranks`` is given."""
    if num_ranks is not None:
        mpirun = find_mpirun()
        if mpirun is None:
            pytest.skip("no mpirun beside Python or on PATH")
        command = [mpirun, "-n", str(num_ranks), *command]
    process = subprocess.Popen(
        command,
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        out, err = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        pytest.fail(f"{' '.join(command)} hangs")
    # Open MPI's launcher adds texts of its own between two rules.
    err = re.sub(r"^-{20,}\n.*?^-{20,}\n", "", err, flags=re.DOTALL | re.MULTILINE)
    return subprocess.CompletedProcess(command, process.returncode, out, err)


def complaints(err):
    """Lines of standard error but the one by which a run says what it is about to do."""
    return [line for line in err.splitlines() if not ANNOUNCED.fullmatch(line)]


def assert_refused(result, said, folder, files):
    """Status 2 after one line that says it, and ``folder`` holds ``files`` and nothing else."""
    lines = complaints(result.stderr)
    assert result.returncode == 2, result.stderr
    assert len(lines) == 1 and lines[0].startswith("mufe: "), result.stderr
    assert said in lines[0]
    assert result.stdout == ""
    assert sorted(path.name for path in folder.iterdir()) == sorted(files)
