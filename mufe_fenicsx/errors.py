"""The ways in which a run ends early."""

import signal
import threading


class InputError(ValueError):
    """Something the user gave cannot be used.

    The message is one line: the quantity, its value, what was expected.
    """


class SolverError(RuntimeError):
    """A computation went wrong while running: what happened and what to change."""


class UnstableError(SolverError):
    """The same where a shorter time step may be the answer."""


class Interrupted(RuntimeError):
    """Somebody asked the program to end: by which signal, and what was kept.

    Args:
        message: One line.
        signal: Number of the signal.
    """

    def __init__(self, message, signal):
        super().__init__(message)
        self.signal = int(signal)


def raise_on_broken_pipes():
    """Give SIGPIPE back to Python, so that a reader that left is a BrokenPipeError.

    To be called after gmsh or PETSc has started: the one lets the signal end the program without
    a word, the other aborts all ranks.
    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGPIPE, signal.getsignal(signal.SIGPIPE))
