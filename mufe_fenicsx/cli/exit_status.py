"""How the program ends: one line for what the user can mend, and all ranks together.

- 0: done
- 1: a verification failed, or a computation did
- 2: unusable input, or a file system that is full or not writable
- 130, 143, 138, 129: stopped by an interrupt (Ctrl-C), by a request to end (SIGTERM, SIGUSR1), by a
  terminal that closed (SIGHUP)
"""

import math
import os
import sys
import time
import traceback
import warnings

from ..errors import InputError, Interrupted, SolverError

FAILED = 1
UNUSABLE_INPUT = 2
INTERRUPTED = 130

#: How long a rank that failed waits for the others to end too [s]. They do so at
#: once where an error is raised together; a rank that does not come is waiting
#: for this one in another collective call, and would for ever.
PATIENCE = 10.0
#: Characters of the one line.
LONGEST = 2000
#: What a launcher on a busy machine takes to pass on a line [s].
FORWARDING = 1.0


def run_to_exit(action):
    """Call ``action`` on every rank and exit with its status. Collective, does not return.

    Rank 0 prints the one line of an `InputError`, `SolverError` or OSError. Where
    only some ranks fail, all end with their status. An exception that is none of
    these is a defect: it prints its traceback and ends all ranks at once.

    Args:
        action: Function without arguments that returns an exit status.
    """
    from mpi4py import MPI

    for stream in (sys.stdout, sys.stderr):  # what a terminal has no letter for is escaped
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    if not sys.warnoptions:  # those of libraries are for who writes programs
        warnings.simplefilter("ignore")

    # Of its own, so that ranks that end meet nobody who still computes.
    comm = MPI.COMM_WORLD.Dup()
    failure = None
    status = 0
    try:
        status = action()
    except KeyboardInterrupt:
        failure = (INTERRUPTED, "interrupted")
    except Interrupted as error:
        failure = (128 + error.signal, str(error))
    except BrokenPipeError:  # whoever read our output has left, as in `mufe ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        failure = (FAILED, "")
    except (InputError, SolverError, OSError) as error:
        failure = (_status(error), _one_line(error))
    except Exception:
        traceback.print_exc()
        sys.stderr.flush()
        if comm.size > 1:
            _abort(MPI.COMM_WORLD, FAILED)
        sys.exit(FAILED)

    if not _others_end_too(comm, PATIENCE if failure else math.inf):
        _print_line(failure[1])
        _abort(MPI.COMM_WORLD, failure[0])

    failures = [one for one in comm.allgather(failure) if one is not None]
    if failures:
        status, line = failures[0]
        if comm.rank == 0:
            _print_line(line)
    sys.exit(status)


def _abort(comm, status):
    """End all ranks, once the launcher had time to pass on what was printed: it drops the rest."""
    time.sleep(FORWARDING)
    comm.Abort(status)


def _others_end_too(comm, patience):
    """Whether every rank comes to its end within ``patience`` seconds."""
    arrival = comm.Ibarrier()
    deadline = time.monotonic() + patience
    while not arrival.Test():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def _status(error):
    return FAILED if isinstance(error, SolverError) else UNUSABLE_INPUT


def _one_line(error):
    if isinstance(error, OSError) and error.strerror:
        text = error.strerror if error.filename is None else f"{error.filename}: {error.strerror}"
    else:
        text = str(error)
    line = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return line if len(line) <= LONGEST else line[:LONGEST] + "…"


def _print_line(line):
    if line:
        print(f"mufe: {line}", file=sys.stderr, flush=True)
