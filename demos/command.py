"""The command `mufe` from a script: what is stopped ends as it would alone, after a checkpoint."""

import subprocess
import sys


def call(*words):
    """Run `mufe` with these words; ends this program where it fails, or is stopped.

    A terminal sends Ctrl-C to both. This one waits until the command has kept what it has.
    """
    process = subprocess.Popen([sys.executable, "-m", "mufe_fenicsx", *map(str, words)])
    while True:
        try:
            code = process.wait()
        except KeyboardInterrupt:
            continue
        if code:  # it has said why, in a line
            sys.exit(code)
        return
