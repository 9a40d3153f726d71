"""A run that becomes unstable goes back to a checkpoint and on with a shorter step."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.cli.exit_status import FAILED, _status
from mufe_fenicsx.errors import SolverError
from mufe_fenicsx.explicit import simulation
from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.output.checkpoint import CheckpointWriter
from mufe_fenicsx.output.fields import read_states
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.run.retries import Retries
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import Contact, Oedometer, Output, Scene, Solver
from tests.bodies import RADIUS, packed_grains

COMM = MPI.COMM_WORLD


def scene(factor=0.9, **solver):
    """Elastic spheres; ``factor`` may be beyond the limit of stability, as no file may have it."""
    solver = Solver(**solver)
    object.__setattr__(solver, "time_step_factor", factor)
    return Scene(
        material=Elastic(100e9, 0.15, 2650.0),
        contact=Contact(friction=0.3),
        oedometer=Oedometer(strain=0.006, speed=4.0, seating_stress=1e4),
        output=Output(fields=3, history=41, checkpoint_steps=40),
        solver=solver,
    )


@pytest.fixture
def folder(tmp_path_factory):
    """A folder that all ranks share, with the grains: spheres side by side."""
    path = COMM.bcast(tmp_path_factory.mktemp("retry") if COMM.rank == 0 else None)
    if COMM.rank == 0:
        save_grains(path / "grains", packed_grains((2, 2, 1), h=0.7 * RADIUS))
    COMM.Barrier()
    return path


def run(folder, name, given, **options):
    return run_scene(given, folder / "grains", folder / name, COMM, **{"quiet": True, **options})


@pytest.mark.mpi
def test_after_a_retry_the_run_is_the_one_with_the_short_step_from_there(
    folder, monkeypatch, capfd
):
    """One rank loses its motion at step 100, once: all go back to step 80, to the same bytes."""
    step = Simulation.step

    def broken(self, everywhere=True):
        if self.state.num_steps == 100 and self.time_step_factor > 0.5 and COMM.rank == 0:
            self.state.v[0] = np.nan
        step(self, everywhere)

    def halved(self, everywhere=True):
        if self.state.num_steps == 80 and self.time_step_factor > 0.5:
            self.time_step_factor *= 0.5
            self.update_time_step()
        step(self, everywhere)

    monkeypatch.setattr(Simulation, "step", broken)
    result = run(folder, "retried", scene(), quiet=False)
    printed = capfd.readouterr().err
    monkeypatch.setattr(Simulation, "step", halved)
    run(folder, "short", scene())
    assert result["finished"] and len(result["retries"]) == 1, result["num_steps"]
    retry = result["retries"][0]
    assert retry["from_step"] == 80 and retry["failed_at_step"] >= 100
    assert retry["cause"] and retry["time_step_factor"] == 0.45
    if COMM.rank == 0:
        line = (folder / "retried" / "retries.log").read_text()
        assert "retry 1 of 3 from step 80 with 0.5 times" in line and line in printed
        one, other = ((folder / name / "history.csv").read_bytes() for name in ("retried", "short"))
        assert one == other
        assert read_states(folder / "retried") == read_states(folder / "short")
    COMM.Barrier()
    # What goes on later keeps the short step.
    longer = replace(scene(), oedometer=replace(scene().oedometer, strain=0.007))
    monkeypatch.setattr(Simulation, "step", step)
    more = run(folder, "retried", longer, resume=True)
    assert more["time_step"] < 0.6 * read_history(folder / "retried" / "history.csv")["dt"][0]
    assert more["retries"] == result["retries"]


def test_a_step_beyond_the_limit_of_stability_is_found_and_halved(folder, monkeypatch):
    """At 1.3 of the limit it blows up from round-off; the end is that of the stable run.

    The path until the retry is not, so that rearrangements may differ, and so do the waves that
    fast loading of four spheres leaves, some percent from row to row: means of rows are compared.
    """
    monkeypatch.setattr(simulation, "LARGEST", 1.3)
    result = run(folder, "wild", scene(1.3))
    tame = run(folder, "tame", scene(0.65))
    assert result["finished"] and result["retries"]
    assert result["retries"][-1]["time_step_factor"] <= 0.65
    forces = [read_history(folder / n / "history.csv")["stress"][-5:] for n in ("wild", "tame")]
    assert np.mean(forces[0]) == pytest.approx(np.mean(forces[1]), rel=0.05)
    history = read_history(folder / "wild" / "history.csv")
    assert np.all(np.diff(history["step"]) > 0) and not tame["retries"]


def test_results_after_a_retry_from_the_start_are_those_that_a_resume_counts(folder, monkeypatch):
    monkeypatch.setattr(simulation, "LARGEST", 1.3)
    given = replace(scene(1.3), output=Output(fields=3, history=41))
    whole = run(folder, "whole", given)
    assert whole["finished"] and whole["retries"][0]["from_step"] == 0
    run(folder, "parts", given, max_steps=whole["num_steps"] - 5)
    assert run(folder, "parts", given, resume=True)["num_steps"] == whole["num_steps"]


def test_a_retry_that_fails_earlier_goes_back_to_the_checkpoint_before(folder):
    """However many were written since it began."""
    checkpoints = CheckpointWriter(COMM, folder)
    retries = Retries(COMM, folder, Solver(retries=3), quiet=True)

    def write(*steps):
        for step in steps:
            table = {"grain": np.empty(0, dtype=int)}
            checkpoints.write(step, {"nodes": table}, {}, {})

    def fail(time):
        state = SimpleNamespace(t=time, num_steps=round(10 * time))
        found = retries.answer("it grows", SimpleNamespace(state=state), checkpoints).checkpoint
        checkpoints.remove_after(found)
        return found and found.header["step"]

    write(10, 20, 30)
    assert fail(3.5) == 30
    write(31, 32, 33)
    assert fail(3.4) == 20
    write(21, 22, 23)
    assert fail(2.4) is None
    write(1, 2, 3)
    COMM.Barrier()
    names = sorted(path.name for path in (folder / "checkpoints").iterdir())
    assert names == ["step-000000002", "step-000000003"]


def test_when_retries_are_used_up_it_stops_and_says_so(folder):
    """No step closes the balance to 1e-9."""
    with pytest.raises(SolverError, match=r"(nowhere|missing).* \(after 2 retries down to 0.25 ti"):
        run(folder, "out", scene(retries=2, energy_limit=1e-9))
    summary = json.loads((folder / "out" / "run.json").read_text())
    assert len(summary["retries"]) == 2 and not summary["finished"]
    assert "after 2 retries" in summary["stop_reason"]
    assert len((folder / "out" / "retries.log").read_text().splitlines()) == 2
    assert len(read_states(folder / "out")) >= 1  # the state it failed in
    assert _status(SolverError("")) == FAILED
