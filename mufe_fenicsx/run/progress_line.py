"""The line on the terminal that tells how far a run has come."""

import os
import sys
import time

from ..machine.mpi_launcher import TERMINAL

#: Loaded where this process is the kernel of a notebook.
NOTEBOOK = "ipykernel"
#: Seconds between two updates of the progress line.
REFRESH_SECONDS = 0.5


class ProgressLine:
    """A line with strain, step rate and time left; nothing where nobody looks.

    It is drawn in a terminal. A notebook has no cursor to move: there the line is written anew.
    """

    def __init__(self, comm, loading, quiet):
        self.loading, self.text = loading, ""
        terminal = sys.stderr.isatty() or os.environ.get(TERMINAL) == "1"
        self.notebook = NOTEBOOK in sys.modules
        self.active = comm.rank == 0 and not quiet and (terminal or self.notebook)

    def __enter__(self):
        self.last, self.last_steps = time.perf_counter(), 0
        if self.active and not self.notebook:
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
            return
        self.bar.update(
            self.task,
            description=self.loading.stage,
            completed=self.loading.part_done,
            text=self.text,
        )

    def _write(self, end=""):
        done = f"{self.loading.stage} {self.loading.part_done:4.0%}  {self.text}"
        print(f"\r{done:60}", end=end, flush=True)

    def __exit__(self, *_):
        if self.active and self.notebook:
            self.text = f"strain {self.loading.strain:.4f}"
            self._write("\n")
        elif self.active:
            self.bar.stop()
