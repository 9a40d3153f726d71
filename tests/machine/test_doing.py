"""Lines that say what the program is at, where nobody draws a bar."""

import importlib
import threading
import time

import numba
import pytest

from mufe_fenicsx.machine import doing
from mufe_fenicsx.machine.doing import Doing


@pytest.fixture
def soon(monkeypatch):
    """Lines come every twentieth of a second."""
    monkeypatch.setattr(doing, "SECONDS_BETWEEN_LINES", 0.05)


def wait_for_lines(capsys, number=1):
    """Lines on standard error, so many at least."""
    lines, end = [], time.monotonic() + 20
    while len(lines) < number and time.monotonic() < end:
        time.sleep(0.02)
        lines += capsys.readouterr().err.splitlines()
    return lines


def test_the_inner_block_counts_and_nothing_is_said_after_the_end(soon, capsys):
    before = threading.active_count()
    with Doing("setting up") as outer:
        assert wait_for_lines(capsys)[-1] == "mufe: setting up, after 0 s"
        with Doing("loading"):
            time.sleep(0.1)
            capsys.readouterr()
            assert wait_for_lines(capsys)[-1] == "mufe: loading, after 0 s"
        outer.what = "writing"
        time.sleep(0.1)
        capsys.readouterr()
        assert wait_for_lines(capsys)[-1].startswith("mufe: writing, after ")
    assert threading.active_count() == before
    capsys.readouterr()
    time.sleep(0.15)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("what, wanted", [("", True), ("setting up", False)])
def test_what_is_not_wanted_is_not_said(soon, capsys, what, wanted):
    with Doing(what, wanted):
        time.sleep(0.2)
    assert capsys.readouterr().err == ""


def test_a_compiler_at_work_is_named(soon, capsys):
    end = time.monotonic() + 60
    with Doing("setting up"):
        lines = []
        while not any("; compiling" in line for line in lines) and time.monotonic() < end:
            numba.njit(lambda a: 2.0 * a)(1.0)  # anew each time
            lines += capsys.readouterr().err.splitlines()
    assert any(line.startswith("mufe: setting up, after ") for line in lines)
    assert any(line.endswith("; compiling, which is kept for the next time") for line in lines)


def test_each_compiler_is_where_it_is_looked_for():
    for module, name in doing.COMPILERS:
        assert callable(getattr(importlib.import_module(module), name))
