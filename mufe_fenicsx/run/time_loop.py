"""The loop over time steps of a test, with rows, states and checkpoints as they fall due."""

import math

from ..errors import Interrupted, SolverError
from .progress_line import ProgressLine
from .rebalance import INTERVAL
from .run_place import say


def run_time_loop(
    simulation, loading, recorder, output, signals, save, balance, max_steps, quiet, resumed
):
    """Step until the end of the test; returns why it stopped, or None to begin anew. Collective.

    Args:
        simulation, loading: What moves.
        recorder: :class:`~mufe_fenicsx.run.recorder.Recorder`.
        output: Of the scene: when checkpoints are due.
        signals: :class:`~mufe_fenicsx.run.signals.Signals`, entered.
        save: Writes one.
        balance: Shares the work of the ranks anew where that is worth it, and writes a checkpoint
            to begin anew from; returns whether it did.
        max_steps: Stop at this step, counted from the start of the test, or None.
        quiet: No line on the terminal.
        resumed: The present step is recorded already.

    Raises:
        SolverError: The computation failed.
        Interrupted: A signal came.
        InputError: A file cannot be written.
    """
    due, balance_due = _Due(output, loading), EachStrain(INTERVAL, loading)
    with ProgressLine(simulation.comm, loading, quiet) as progress:
        while True:
            if not resumed:  # that step is recorded already
                recorder.after_step()
                if simulation.state.num_steps == 0:
                    save()  # a disk that fills later leaves the start
            resumed = False
            progress.update(simulation)
            say(simulation.comm, loading.take_notice(), quiet)
            if loading.finished:
                break
            if max_steps is not None and simulation.state.num_steps >= max_steps:
                _save_end(save, recorder)
                return f"max_steps = {max_steps} reached"
            number, by_time = signals()
            if number:
                raise _interrupted(
                    number, save, recorder, simulation.state.num_steps, loading.strain
                )
            if balance_due() and balance():
                return None
            if by_time or due(simulation.state.num_steps):
                save()
                signals.saved()
            loading.before_step()
            simulation.step(everywhere=False)
    _save_end(save, recorder)  # a longer test can go on from here
    return loading.end


def _save_end(save, recorder):
    """Write a checkpoint, then the last row and state, which a run that goes on is without."""
    save()
    recorder.write_last()


def _interrupted(number, save, recorder, step, strain):
    """The error that ends a run on a signal, after a checkpoint if the state is sound."""
    what = "after a checkpoint: --resume goes on from it"
    try:
        _save_end(save, recorder)
    except SolverError as failure:
        what = f"where it had failed ({failure}): --resume goes on from the last checkpoint, if any"
    return Interrupted(number, f" at step {step}, strain {strain:.4f}, {what}")


class EachStrain:
    """Whether the strain has passed another multiple of an interval since the last call."""

    def __init__(self, interval, loading):
        self.interval, self.loading = interval, loading
        self._passed = self._count()

    def _count(self):
        return math.floor(self.loading.strain / self.interval) if self.interval else 0

    def __call__(self):
        """Whether the strain has passed a multiple of the interval since the last call."""
        before, self._passed = self._passed, self._count()
        return self._passed > before


class _Due:
    """Whether a checkpoint is due by steps or by strain."""

    def __init__(self, output, loading):
        self.steps = output.checkpoint_steps
        self.by_strain = EachStrain(output.checkpoint_strain, loading)

    def __call__(self, step):
        by_strain = self.by_strain()
        return by_strain or bool(self.steps and step and step % self.steps == 0)
