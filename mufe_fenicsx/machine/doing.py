"""What the program is at, in a line on standard error every ten seconds: for pipes and files.

A thread of its own prints the lines, so that a stage without a loop is not silent: while kernels
compile, a mesh is set up or figures are drawn.
"""

import contextlib
import sys
import threading
import time

#: So often a line is printed [s].
SECONDS_BETWEEN_LINES = 10.0
#: Functions, by module and name, that make machine code which a cache keeps.
COMPILERS = {
    ("numba.core.compiler", "compile_extra"),
    ("dolfinx.jit", "ffcx_jit"),
    ("mufe_fenicsx.kernels.build.native", "_compiled"),
}


class Doing:
    """A block during which lines say what is done; of blocks within each other, the inner one's.

    Args:
        what: In words, which may be set anew at any time; "" where something else tells it.
        wanted: Whether lines are printed: not by ranks other than 0, and not where quiet is asked.
    """

    _stack = []
    _teller, _ended = None, threading.Event()

    def __init__(self, what, wanted=True):
        self.what, self.wanted = what, wanted

    def __enter__(self):
        self.started = time.monotonic()
        self._stack.append(self)
        if len(self._stack) == 1:
            self._ended.clear()
            arguments = (self._ended, threading.get_ident())
            Doing._teller = threading.Thread(target=_tell, args=arguments, daemon=True)
            self._teller.start()
        return self

    def __exit__(self, *_):
        self._stack.remove(self)
        if not self._stack:
            self._ended.set()
            self._teller.join()

    @classmethod
    def innermost(cls):
        """The block that counts now, or None."""
        return cls._stack[-1] if cls._stack else None

    def line(self, compiles):
        """The line to print now, or None.

        Args:
            compiles: Whether a compiler is at work.
        """
        if not (self.what and self.wanted):
            return None
        line = f"mufe: {self.what}, after {time.monotonic() - self.started:.0f} s"
        return line + "; compiling, which is kept for the next time" * compiles


def _tell(ended, thread):
    """Print lines until ``ended`` is set, on what another thread is doing."""
    with contextlib.suppress(OSError, ValueError):  # a reader that left
        while not ended.wait(SECONDS_BETWEEN_LINES):
            doing = Doing.innermost()
            line = doing and doing.line(_compiles(thread))
            if line:
                print(line, file=sys.stderr, flush=True)


def _compiles(thread):
    """Whether a thread is within one of :data:`COMPILERS`."""
    frame = sys._current_frames().get(thread)
    while frame is not None:
        if (frame.f_globals.get("__name__"), frame.f_code.co_name) in COMPILERS:
            return True
        frame = frame.f_back
    return False
