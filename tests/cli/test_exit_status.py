"""How a program on several ranks ends that fails on one, or on all."""

import sys
from pathlib import Path

import pytest

from mufe_fenicsx.cli.main import main
from tests.cli.commands import assert_refused, run

ROOT = Path(__file__).resolve().parents[2]


def ending(body):
    """A program whose rank-dependent end goes through `run_to_exit`."""
    return [
        sys.executable,
        "-c",
        "import mufe_fenicsx, mufe_fenicsx.cli.exit_status as exit_status\n"
        "from mufe_fenicsx.errors import InputError, SolverError\n"
        "from mpi4py import MPI\n"
        "comm = MPI.COMM_WORLD\n"
        "exit_status.PATIENCE = 1.0\n"
        f"def action():\n    {body}\n    return 0\n"
        "exit_status.run_to_exit(action)\n",
    ]


def test_line_of_a_rank_that_fails_alone_is_printed_once(tmp_path):
    body = "if comm.rank == 1: raise InputError('quantity = 1, expected\\n 2')"
    result = run(ending(body), tmp_path, num_ranks=2)
    assert_refused(result, "mufe: quantity = 1, expected 2", tmp_path, [])


def test_rank_that_fails_while_others_wait_ends_them(tmp_path):
    body = "\n    ".join(
        ["if comm.rank == 1: raise InputError('quantity = 1, expected 2')", "comm.Barrier()"]
    )
    result = run(ending(body), tmp_path, num_ranks=2)
    assert result.returncode == 2
    assert result.stderr.count("mufe: quantity = 1, expected 2") == 1
    assert "Traceback" not in result.stderr


def test_defect_on_one_rank_shows_its_traceback_and_ends_all(tmp_path):
    body = "\n    ".join(["if comm.rank == 1: raise KeyError('lost')", "comm.Barrier()"])
    result = run(ending(body), tmp_path, num_ranks=2)
    assert result.returncode == 1
    assert "Traceback" in result.stderr and "KeyError: 'lost'" in result.stderr


def test_computation_that_fails_has_status_1(tmp_path):
    result = run(ending("raise SolverError('energy grows')"), tmp_path, num_ranks=2)
    assert (result.returncode, result.stderr) == (1, "mufe: energy grows\n")


def test_full_file_system_is_one_line(tmp_path):
    result = run(ending("raise OSError(28, 'No space left on device', 'history.csv')"), tmp_path)
    assert_refused(result, "mufe: history.csv: No space left on device", tmp_path, [])


def test_an_interrupt_is_told(monkeypatch, capsys):
    """Also where the library of the command line has made a status of it."""

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("mufe_fenicsx.cli.main._run_told", interrupted)
    with pytest.raises(SystemExit) as end:
        main(["run", str(ROOT / "demos" / "first.toml")])
    assert end.value.code == 130 and capsys.readouterr().err == "mufe: interrupted\n"
