"""What ranks hear of the outside while they step: signals, and the time of the clock."""

import signal
import threading
import time

import numpy as np
from mpi4py import MPI

from ..errors import ASKED_BY

#: Several ranks ask each other about this often [s]; one rank asks at every step.
LATENCY = 0.2


class Signals:
    """Asks all ranks between two steps for signals and for the time. Collective.

    To be used as a context: the signals do not end the program at once within it. A second
    one does.

    Args:
        comm: MPI communicator.
        interval: Time between two checkpoints [s]; 0: none by time.
    """

    def __init__(self, comm, interval):
        self.comm, self.interval = comm, interval
        self._signal, self._before = 0, {}
        self._asked = self._saved = time.monotonic()
        self._steps = self._left = 1
        self._values = np.zeros(3)

    def __enter__(self):
        if threading.current_thread() is threading.main_thread():
            # One that was told to be ignored, as SIGHUP by nohup, stays so.
            wanted = [s for s in ASKED_BY if s != signal.SIGHUP or not _ignored(s)]
            self._before = {s: signal.signal(s, self._note) for s in wanted}
        return self

    def __exit__(self, *_):
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number, _):
        if self._signal:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        self._signal = number

    def __call__(self):
        """Number of a signal that arrived or 0, and whether a checkpoint is due by time.

        The same on all ranks, that must call it equally often.
        """
        self._left -= 1
        if self._left > 0:
            return 0, False
        now = time.monotonic()
        due = bool(self.interval) and now - self._saved >= self.interval
        if self.comm.size == 1:
            self._left = 1
            return self._signal, due
        # The clock of rank 0 counts.
        pace = (now - self._asked) / self._steps
        self._values[:] = self._signal, due and self.comm.rank == 0, pace
        self.comm.Allreduce(MPI.IN_PLACE, self._values, op=MPI.MAX)
        self._steps = self._left = max(1, min(1000, int(LATENCY / max(self._values[2], 1e-9))))
        self._asked = time.monotonic()
        return int(self._values[0]), bool(self._values[1])

    def saved(self):
        """The time to the next checkpoint begins."""
        self._saved = self._asked = time.monotonic()


def _ignored(number):
    return signal.getsignal(number) == signal.SIG_IGN
