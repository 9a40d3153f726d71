"""The command `mufe` in a process of its own that has all modules already: its status and lines."""

import contextlib
import os
import re
import resource
import signal
import tempfile
import time
import warnings
from multiprocessing import forkserver
from pathlib import Path

from mufe_fenicsx.cli.main import main

#: Longest that a command may compute [s], and that it may take beside other programs.
COMPUTING, WAITING = 20, 300


def warm(*words):
    """Call a command in this process: those that come later find what it needs."""
    with contextlib.suppress(SystemExit), warnings.catch_warnings():
        main([str(word) for word in words])


def mufe(*words, user=None):
    """Call a command.

    Args:
        words: Of the command.
        user: Number of the user who calls it; None: this one.

    Returns:
        Its exit status, negative for the number of a signal that ended it, and the lines that it
        wrote to standard error.
    """
    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            if user is not None:
                os.setgroups([]), os.setgid(user), os.setuid(user)
            _be_the_command([str(word) for word in words], said.fileno())
        status = _wait(child)
        said.seek(0)
        lines = said.read().decode("utf-8", "replace").splitlines()
    return os.waitstatus_to_exitcode(status), lines


def _be_the_command(words, said):
    status = 3  # of no command
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(said, 2)
        import sys

        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)
        os.setpgid(0, 0)
        # The process that workers are copies of is a child of the parent, and lives.
        forkserver.ensure_running = forkserver._forkserver.ensure_running = lambda: None
        for number in (signal.SIGALRM, signal.SIGPROF):
            signal.signal(number, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_CPU, (COMPUTING, COMPUTING + 1))
        try:
            main(words)
        except SystemExit as ended:
            status = ended.code
        sys.stdout.flush(), sys.stderr.flush()
    finally:
        os._exit(status)


def _wait(child):
    deadline = time.monotonic() + WAITING
    while time.monotonic() < deadline:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return status
        time.sleep(0.002)
    os.killpg(child, signal.SIGKILL)
    return os.waitpid(child, 0)[1]


def check_answer(status, lines, what, output=None):
    """A command ended well, or said why not in one line, and then wrote nothing.

    Args:
        status, lines: Of :func:`mufe`.
        what: What was given to it, for the message.
        output: Folder or file that it was to write.
    """
    told = f"{what}: status {status}\n" + "\n".join(lines[-30:])
    assert status in (0, 1, 2), told
    # How far it has come, which a busy machine is told of.
    lines = [line for line in lines if not re.match(r"meshing: |mufe: .*, after \d+ s$", line)]
    errors = [line for line in lines if line.startswith("mufe: ")]
    assert len(lines) == len(errors) == (status != 0), told
    if status == 2 and output is not None:
        left = list(Path(output).rglob("*")) if Path(output).is_dir() else []
        assert not left and not Path(output).is_file(), (told, left)
