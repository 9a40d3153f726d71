"""Measurements in programs of their own, under the environment's own mpirun."""

import json
import subprocess
import sys
import time

from ...errors import InputError
from ...machine.mpi_launcher import environment_without_launcher, find_mpirun


def row(computed, target, passed):
    """A figure and what it is to reach."""
    return {"computed": computed, "target": target, "passed": bool(passed)}


def case_of(name, parameters, results):
    """A benchmark with its figures, which has passed where none of them has not."""
    passed = all(figure.get("passed", True) for figure in results.values())
    return {"case": name, "parameters": parameters, "results": results, "passed": passed}


def seconds_each(times, action):
    """Mean time of an action that is done so many times [s]."""
    start = time.perf_counter()
    for _ in range(times):
        action()
    return (time.perf_counter() - start) / times


def launch(name, parameters, num_ranks):
    """The measurement ``name`` of bench.MEASUREMENTS on so many ranks; what it returned.

    Raises:
        InputError: It failed.
    """
    environment = environment_without_launcher()
    command = [
        find_mpirun(),
        "-n",
        str(num_ranks),
        sys.executable,
        "-m",
        "mufe_fenicsx.verification.bench.benchmarks",
        name,
        json.dumps(parameters),
    ]
    done = subprocess.run(  # noqa: S603  words of our own, no shell
        command, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise InputError(
            f"benchmark {name} on {num_ranks} ranks failed: {done.stderr.strip()[-500:]}"
        )
    return json.loads(done.stdout.splitlines()[-1])
