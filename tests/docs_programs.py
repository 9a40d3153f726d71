"""Programs that a reader of the documentation calls, as the tests provide them.

`mufe` asks the process of the tests to do its work, which has all libraries loaded: a block with
loops takes no start-up a command. As a rank of `mpirun` it is a process of its own. Slurm's
programs run what they are given at once, on one rank; `apt` only simulates.
"""

import contextlib
import functools
import json
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

#: Longest time of one command line of a shell [s].
PATIENCE = 600

MUFE = f'''#!{sys.executable} -SE
import json, os, socket, sys

arguments = sys.argv[1:]
few = os.environ.get("MUFE_FEW_STEPS")
if few and arguments[:1] == ["run"] and "--max-steps" not in arguments:
    arguments += ["--max-steps", few]
    with open(arguments[1]) as scene:  # to come to rest takes too many
        if "seating_at_rest = true" in scene.read():
            arguments += ["--set", "oedometer.seating_at_rest=false"]
address = os.environ.get("MUFE_DESK")
if not address or {{"PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK"}} & set(os.environ):
    os.execv("{sys.executable}", ["{sys.executable}", "-m", "mufe_fenicsx", *arguments])
with socket.socket(socket.AF_UNIX) as desk:
    desk.connect(address)
    desk.sendall(json.dumps([os.getcwd(), arguments]).encode() + b"\\n")
    sys.exit(int(desk.recv(16) or 1))
'''


@functools.cache
def lacking(program):
    """Whether a program is not there, or `apt` has no lists of packages."""
    if program == "apt":
        try:
            known = subprocess.run(["apt-cache", "show", "libxft2"], capture_output=True)
        except OSError:
            return True
        return known.returncode != 0
    return shutil.which(program) is None


def write_programs(folder):
    """Programs of this Python and this source tree, and stand-ins for those of a system.

    Args:
        folder: Folder to make.
    """
    folder.mkdir()
    screen = f"{shutil.which('xvfb-run')} -a" if shutil.which("xvfb-run") else ""
    programs = {
        "mufe": MUFE,
        "python": f'exec "{sys.executable}" "$@"',
        "apt": 'exec apt-get --simulate "$@"',
        "sbatch": 'export SLURM_JOB_ID=1; exec bash "$@"',
        "srun": 'while [ "${1#-}" != "$1" ]; do shift; done; exec "$@"',
        "scontrol": "exit 0",
    }
    if real := shutil.which("pvbatch"):
        # `xvfb-run` waits for its screen no longer than three seconds.
        programs["pvbatch"] = f'for i in 1 2 3; do {screen} {real} "$@" && exit 0; done; exit 1'
    if real := shutil.which("yade"):
        programs["yade"] = f'exec {real} -n -x "$@"'
    for name, text in programs.items():
        program = folder / name
        program.write_text(text if text.startswith("#!") else f"#!/bin/sh\n{text}\n")
        program.chmod(0o755)
    return folder


def run_command(command, environment, serve):
    """Run a command whose `mufe` this process serves; its exit status and what it complained of.

    Args:
        command: Words.
        environment: Of the command.
        serve: Called with the arguments of each `mufe`, in its working folder; gives its status.
            None: each is a process of its own.

    Raises:
        TimeoutError: it takes longer than ``PATIENCE``.
    """
    with (
        tempfile.TemporaryDirectory() as folder,
        socket.socket(socket.AF_UNIX) as desk,
        tempfile.TemporaryFile("w+") as errors,
    ):
        address = str(Path(folder, "desk"))
        desk.bind(address)
        desk.listen()
        desk.settimeout(0.05)
        process = subprocess.Popen(
            command, env=environment | {"MUFE_DESK": address if serve else ""},
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=errors,
        )  # fmt: skip
        end = time.monotonic() + PATIENCE
        try:
            while process.poll() is None:
                if time.monotonic() > end:
                    raise TimeoutError(f"{command[-1]}: no end after {PATIENCE} s")
                with contextlib.suppress(TimeoutError):
                    _serve_one(desk, serve)
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        errors.seek(0)
        return process.returncode, errors.read()


def _serve_one(desk, serve):
    """Take one request, if there is one within the socket's time."""
    caller, _ = desk.accept()
    with caller, caller.makefile() as lines:
        folder, arguments = json.loads(lines.readline())
        with contextlib.chdir(folder):
            status = serve(arguments)
        caller.sendall(str(status).encode())
