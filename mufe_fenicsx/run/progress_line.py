"""How far a run has come: a bar on the terminal, a line in a notebook, lines in a pipe or file."""

import os
import sys
import time

from ..loading.oedometer import SEATING
from ..machine.doing import Doing
from ..machine.mpi_launcher import TERMINAL

#: Loaded where this process is the kernel of a notebook.
NOTEBOOK = "ipykernel"
#: Seconds between two updates of the progress line.
REFRESH_SECONDS = 0.5


#: Part of the test from which on its pace tells how long the rest takes.
ENOUGH = 0.02


class ProgressLine:
    """Stage, strain, step rate and time left, as far as anything tells them.

    A terminal has a bar. A notebook has no cursor to move: there the line is written anew. A pipe
    or a file has a line every ten seconds.
    """

    def __init__(self, comm, loading, quiet):
        self.loading, self.text = loading, ""
        terminal = sys.stderr.isatty() or os.environ.get(TERMINAL) == "1"
        self.active = comm.rank == 0 and not quiet
        self.notebook = NOTEBOOK in sys.modules
        self.terminal = terminal and not self.notebook
        told = self.terminal or self.notebook
        self.doing = Doing("" if told else loading.stage, self.active)

    def __enter__(self):
        self.started = self.last = time.perf_counter()
        self.last_steps, self.part_before = 0, self.loading.part_done
        self.doing.__enter__()
        if self.active and self.terminal:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

            self.bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.fields[text]}"),
                TimeRemainingColumn(),
                console=Console(stderr=True, force_terminal=True),
            )
            self.bar.start()
            self.task = self.bar.add_task(self.loading.stage, total=1.0, text="")
        return self

    def update(self, simulation):
        """Show where the run is now, some times a second."""
        if not self.active:
            return
        now = time.perf_counter()
        if now - self.last < REFRESH_SECONDS:
            return
        steps = simulation.state.num_steps
        rate = (steps - self.last_steps) / (now - self.last)
        self.last, self.last_steps = now, steps
        self.text = f"strain {self.loading.strain:.4f}  {rate:.0f} steps/s"
        if self.notebook:
            self._write()
        elif self.terminal:
            self.bar.update(
                self.task,
                description=self.loading.stage,
                completed=self.loading.part_done,
                text=self.text,
            )
        else:
            self.doing.what = self._line(steps, rate)

    def _line(self, steps, rate):
        """Stage, strain or step, and time left where there is a pace to tell it from."""
        stage, done = self.loading.stage, self.loading.part_done
        # While the sample is seated there is no strain, and no end that could be foreseen.
        where = f"step {steps}" if stage == SEATING else f"strain {self.loading.strain:.4f}"
        line = f"{stage}: {where}, {rate:.0f} steps/s"
        gained = done - self.part_before
        if gained <= 0.0:  # the pace counts from where the test moves on
            self.started = time.perf_counter()
        if gained < ENOUGH:
            return line
        left = (1.0 - done) / gained * (time.perf_counter() - self.started)
        return f"{line}, {100 * done:.0f} % done, {_duration(left)} left at the pace so far"

    def _write(self, end=""):
        done = f"{self.loading.stage} {self.loading.part_done:4.0%}  {self.text}"
        print(f"\r{done:60}", end=end, flush=True)

    def __exit__(self, *_):
        self.doing.__exit__()
        if self.active and self.notebook:
            self.text = f"strain {self.loading.strain:.4f}"
            self._write("\n")
        elif self.active and self.terminal:
            self.bar.stop()


def _duration(seconds):
    """About so long, in words."""
    return f"about {seconds / 60:.0f} min" if seconds > 90 else f"about {seconds:.0f} s"
