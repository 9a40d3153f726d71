"""What tells how far a run has come: in a notebook, and in a pipe."""

import sys
from types import SimpleNamespace

import pytest

from mufe_fenicsx.run import progress_line


@pytest.mark.parametrize("quiet", [False, True])
def test_a_notebook_sees_one_line_that_is_written_anew(monkeypatch, capsys, quiet):
    monkeypatch.setitem(sys.modules, progress_line.NOTEBOOK, SimpleNamespace())
    monkeypatch.setattr(progress_line, "REFRESH_SECONDS", 0.0)
    loading = SimpleNamespace(stage="loading", part_done=0.25, strain=0.0125)
    simulation = SimpleNamespace(state=SimpleNamespace(num_steps=100))
    with progress_line.ProgressLine(SimpleNamespace(rank=0), loading, quiet) as line:
        line.update(simulation)
        loading.part_done, loading.strain = 1.0, 0.05
    first, *shown = capsys.readouterr().out.split("\r")
    assert first == "" and len(shown) == (0 if quiet else 2)
    if shown:
        assert shown[0].startswith("loading  25%  strain 0.0125  ") and "steps/s" in shown[0]
        assert shown[1].rstrip() == "loading 100%  strain 0.0500" and shown[1].endswith("\n")


def test_a_pipe_is_told_the_step_while_the_sample_is_seated_and_then_the_time_left(monkeypatch):
    monkeypatch.delitem(sys.modules, progress_line.NOTEBOOK, raising=False)  # of other tests
    clock = [0.0]
    monkeypatch.setattr(progress_line.time, "perf_counter", lambda: clock[0])
    loading = SimpleNamespace(stage="seating", part_done=0.0, strain=0.0)
    simulation = SimpleNamespace(state=SimpleNamespace(num_steps=0))
    with progress_line.ProgressLine(SimpleNamespace(rank=0), loading, quiet=False) as line:

        def told(seconds, steps, part):
            clock[0], simulation.state.num_steps = seconds, steps
            loading.part_done, loading.strain = part, 0.05 * part
            line.update(simulation)
            return line.doing.what

        assert told(10.0, 3100, 0.0) == "seating: step 3100, 310 steps/s"
        loading.stage = "loading"
        # Seating took 10 s, which say nothing of what follows.
        assert told(20.0, 6200, 0.01) == "loading: strain 0.0005, 310 steps/s"
        left = "25 % done, about 90 s left at the pace so far"
        assert told(40.0, 7200, 0.25) == f"loading: strain 0.0125, 50 steps/s, {left}"
        left = "50 % done, about 5 min left at the pace so far"
        assert told(310.0, 7200, 0.5) == f"loading: strain 0.0250, 0 steps/s, {left}"
