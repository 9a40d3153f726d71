"""The ways in which a run ends early, and how messages show values."""

import difflib
import math
import signal
import threading
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

#: Characters of a value in a message.
SHOWN = 60
#: What asks a program to end, by its signal: a run does so after a checkpoint. Open MPI's mpirun
#: kills its ranks when it gets SIGTERM, but passes SIGUSR1 on.
ASKED_BY: dict[int, str] = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "a request to end (SIGTERM)",
    signal.SIGUSR1: "a request to end (SIGUSR1)",
    signal.SIGHUP: "a terminal that closed (SIGHUP)",
}
#: Largest number that a caller means: products of larger ones are not finite.
LARGEST = 1e100
#: Names count as misspelled from this ratio of :mod:`difflib` on.
SIMILAR = 0.6


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
        number: Of the signal.
        kept: What follows "stopped by …" in the message, one line.
    """

    def __init__(self, number: int, kept: str):
        super().__init__(f"stopped by {ASKED_BY[number]}{kept}")
        self.signal, self._kept = int(number), kept

    def __reduce__(self):
        return Interrupted, (self.signal, self._kept)  # from a process of `mufe verify`


def finite_array(name: str, value: object, shape: tuple[int, ...]) -> "np.ndarray":
    """The value as an array of finite numbers.

    Args:
        name: Of the quantity, for the message.
        value: Anything.
        shape: That it has to have.

    Raises:
        InputError: It is none, or of another shape.
    """
    import numpy as np  # commands that only print need no arrays

    try:
        array = np.asarray(np.nan if isinstance(value, str) else value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.array(np.nan)
    sound = np.abs(array) <= LARGEST  # nan is not
    if array.shape != shape or not sound.all():
        lost = np.count_nonzero(~sound)
        found = f"array of shape {array.shape}, {lost} of its numbers not finite"
        expected = f"finite numbers of shape {shape}" if shape else "a finite number"
        raise InputError(
            f"{name} = {shown(value) if array.size < 5 else found}, expected {expected}"
        )
    return array


def raise_together(comm: Any, message: str | None) -> None:
    """Raise the same InputError on every rank if any rank has a message. Collective.

    Args:
        comm: MPI communicator.
        message: What went wrong on this rank, or None.

    Raises:
        InputError: The message of the first rank that has one.
    """
    for other in comm.allgather(message):
        if other is not None:
            raise InputError(other)


def raise_on_broken_pipes() -> None:
    """Give SIGPIPE back to Python, so that a reader that left is a BrokenPipeError.

    To be called after gmsh or PETSc has started: the one lets the signal end the program without
    a word, the other aborts all ranks.
    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGPIPE, signal.getsignal(signal.SIGPIPE))


def shown(value: object) -> str:
    """A value as the user wrote it, but short: texts in double quotes, the rest as in TOML."""
    return _shown(value, 3)


def _shown(value, depth):
    if isinstance(value, str):
        return f'"{shortened(value)}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > 4 * SHOWN:
        return f"a number of {int((value.bit_length() - 1) * math.log10(2)) + 1} digits"
    if isinstance(value, list | tuple):
        if not depth:
            return "[…]"
        first = [_shown(item, depth - 1) for item in value[:4]]
        return "[" + ", ".join([*first, *(["…"] if len(value) > 4 else [])]) + "]"
    if isinstance(value, dict):
        return "a table"
    return shortened(str(value))


def nearest_name(word: object, known: Iterable[str]) -> str:
    """What a message expects in place of a name that is not known.

    Args:
        word: As it was written.
        known: Names that there are, in the order in which they are listed.

    Returns:
        The known name that is spelled much like it; where none is, all of them.
    """
    known = list(known)
    close = difflib.get_close_matches(str(word), known, n=1, cutoff=SIMILAR)
    if close or len(known) == 1:
        return (close or known)[0]
    return f"one of {', '.join(known)}" if known else "none"


def shortened(text: object) -> str:
    """The beginning of a text on one line, without characters that no terminal shows."""
    text = str(text)
    cut = text if len(text) <= SHOWN else text[:SHOWN] + "…"
    return "".join(c if c.isprintable() else "?" for c in cut)
