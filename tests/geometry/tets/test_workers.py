"""Jobs in worker processes that die, hang or raise."""

import os
import subprocess
import sys
import time

import pytest

from mufe_fenicsx.geometry.tets import workers
from mufe_fenicsx.geometry.tets.workers import WorkerError, run_jobs

#: Long enough for a job that does nothing on a busy machine [s].
LIMIT = 1.0


def half_or_worse(number):
    """A job of which one kills its process and one never comes back."""
    if number == 3:
        os._exit(1)
    if number == 5:
        time.sleep(1000)
    if number == 9:
        raise ValueError("nine")
    return number / 2


def test_a_worker_that_dies_or_hangs_costs_only_its_own_job():
    seen = []
    results = run_jobs(half_or_worse, range(1, 7), 2, seen.append, limit=LIMIT)
    assert [results[i] for i in (0, 1, 3, 5)] == [0.5, 1.0, 2.0, 3.0]
    assert all(isinstance(results[i], WorkerError) for i in (2, 4))
    assert "died" in str(results[2]) and "stopped after 1 s" in str(results[4])
    assert sorted(seen) == [1, 2, 3, 4, 5, 6]


def test_a_job_that_hung_is_run_again_otherwise(monkeypatch):
    """By a second worker; of the eight that there may be no others are started for one job."""
    started = []
    make = workers._Worker

    def counted(function):
        started.append(make(function))
        return started[-1]

    monkeypatch.setattr(workers, "_Worker", counted)
    assert workers.run_jobs(half_or_worse, [5], 8, limit=LIMIT, again=lambda job: job + 1) == [3.0]
    assert len(started) == 2


def test_what_a_job_raises_is_raised():
    with pytest.raises(ValueError, match="nine"):
        run_jobs(half_or_worse, [1, 9], 1)


def test_a_script_needs_no_guard_around_work_in_workers(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import math\n"
        "from mufe_fenicsx.geometry.tets.workers import run_jobs\n"
        "print(run_jobs(math.sqrt, [4.0, 9.0], 2))\n",
        encoding="utf-8",
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert done.stdout == "[2.0, 3.0]\n"


def test_a_module_that_is_loaded_ahead_is_loaded_once_for_all_workers(tmp_path):
    """By this process and by the one that workers are copies of."""
    (tmp_path / "counted.py").write_text(
        "from pathlib import Path\n"
        "with Path(__file__).with_name('loads').open('a') as file: file.write('x')\n"
        "def half(number): return number / 2\n",
        encoding="utf-8",
    )
    program = (
        "import counted\n"
        "from mufe_fenicsx.geometry.tets.workers import load_ahead, run_jobs\n"
        "load_ahead('counted')\n"
        "print(run_jobs(counted.half, [2.0, 4.0, 6.0], 3))\n"
    )
    places = os.pathsep.join([str(tmp_path), *sys.path])
    done = subprocess.run(
        [sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": places},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout == "[1.0, 2.0, 3.0]\n"
    assert (tmp_path / "loads").read_text() == "xx"


def test_workers_that_cannot_even_start_are_no_reason_to_try_every_job(tmp_path, monkeypatch):
    module = tmp_path / "absent_in_workers.py"
    module.write_text(
        "import multiprocessing\n"
        "assert multiprocessing.current_process().name == 'MainProcess'\n"
        "def job(number): return number\n",
        encoding="utf-8",
    )
    monkeypatch.syspath_prepend(tmp_path)
    from absent_in_workers import job

    with pytest.raises(RuntimeError, match=r"3 worker processes died .* import absent_in_workers"):
        run_jobs(job, range(100), 2, limit=LIMIT)
