"""Processes of a machine make a thing in turn: the others wait, and find it made.

Turns are locks on bytes of one file in each folder. The system gives them back where a process
ends, however it ends.
"""

import contextlib
import fcntl
import hashlib
import os
import time
from functools import cache
from pathlib import Path

#: Longest wait for another process, which may have been stopped [s].
PATIENCE = 120.0


def take_turn(path):
    """Wait until no other process makes this file; without a wait where its folder has no locks."""
    file = _locks(str(Path(path).parent))
    until = time.monotonic() + PATIENCE
    while file is not None and time.monotonic() < until:
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _byte(path))
            return
        except (BlockingIOError, PermissionError):  # another process has it
            time.sleep(0.01)
        except OSError:  # a file system without locks
            return


def end_turn(path):
    """Let others have the turn."""
    file = _locks(str(Path(path).parent))
    if file is not None:
        with contextlib.suppress(OSError):
            fcntl.lockf(file, fcntl.LOCK_UN, 1, _byte(path))


@cache
def _locks(folder):
    """The file of a folder whose bytes are locked, or None.

    It stays open: a process that closes it gives back all its turns.
    """
    try:
        os.makedirs(folder, exist_ok=True)
        return open(Path(folder) / "turns", "ab")
    except OSError:
        return None


def _byte(path):
    """The byte that stands for a file."""
    return int.from_bytes(hashlib.blake2b(Path(path).name.encode(), digest_size=7).digest())
