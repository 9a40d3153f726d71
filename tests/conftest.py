"""Fixtures that every test may use."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mufe_fenicsx.machine import doing

# Of what is not zero `pytest.approx` knows its relative tolerance alone: its usual absolute one,
# 1e-12, is more than many a force on a grain or area of a contact, in newtons and square metres.
type(pytest.approx(1.0)).DEFAULT_ABSOLUTE_TOLERANCE = property(
    lambda self: 0.0 if self.expected else 1e-12
)

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(autouse=True, scope="session")
def no_lines_by_the_clock():
    """Lines that a command prints every ten seconds come in tests of them alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(doing, "SECONDS_BETWEEN_LINES", 3600.0)
        yield


@pytest.fixture
def shared_data():
    """Path of a file of real data by its name; the test is skipped where it is absent."""

    def find(name):
        path = SHARED_DATA / name
        if not path.exists():
            pytest.skip(f"{name} is not there: real data is not part of the repository")
        return path

    return find


@pytest.fixture
def no_workers(monkeypatch):
    """Grains are meshed in this process: a worker takes 3 s to load what it needs."""
    from mufe_fenicsx.geometry.tets import mesher

    def run_here(function, jobs, processes=0, progress=None, **_):
        results = []
        for job in jobs:
            results.append(function(job))
            if progress:
                progress(len(results))
        return results

    monkeypatch.setattr(mesher, "run_jobs", run_here)


@pytest.fixture
def by_spam(tmp_path):
    """What a program that calls spam makes of labels; the test is skipped without that package.

    The program reads labels from its first argument and writes arrays (.npz) to its second.
    """
    if importlib.util.find_spec("spam") is None:
        pytest.skip("needs the package spam")

    def call(program, labels):
        np.save(tmp_path / "labels.npy", labels)
        # Its compiled loops do not compile with every numba.
        subprocess.run(
            [sys.executable, "-c", program, tmp_path / "labels.npy", tmp_path / "spam.npz"],
            env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, check=True,
        )  # fmt: skip
        return np.load(tmp_path / "spam.npz")

    return call
