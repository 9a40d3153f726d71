"""The main job, small, on a real image or on synthetic sand: commands that a user would type."""

import os
import shlex
import subprocess
import sys
import time
from pathlib import Path

from ..errors import InputError
from ..machine.mpi_launcher import TERMINAL, find_mpirun

SCENE = "snow_oedometer.toml"
#: Synthetic sand of about thirty grains, in a folder whose name follows.
SAND = ["synthesize", "--shape", "60,60,60", "--set", "d50=150 um", "--seed", "1", "-o"]


def demo_scene() -> Path:
    """The scene file of the demonstration: of the installed package, or of the source tree.

    Raises:
        InputError: it is in neither.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "demos", package.parent / "demos"):
        if (folder / SCENE).is_file():
            return folder / SCENE
    raise InputError(f"demos/{SCENE} is not there, expected it in the installed package")


def demo_commands(scene, folder, overwrite=False):
    """The four commands, each a list of arguments of `mufe`.

    Args:
        scene: Scene file that names the image and all settings.
        folder: Where labels, grains and the run go.
        overwrite: Replace earlier output.
    """
    scene, labels = str(scene), str(folder / "labels.tif")
    grains, results = str(folder / "grains"), str(folder / "run")
    replace = ["--overwrite"] if overwrite else []
    return [
        ["segment", "--scene", scene, "-o", labels, *replace],
        ["mesh", labels, "--scene", scene, "-o", grains, *replace],
        ["run", scene, "--grains", grains, "-o", results, *replace],
        ["report", results],
    ]


def num_ranks() -> int:
    """Ranks for the run: two where there are two cores and a launcher, else one."""
    return 2 if len(os.sched_getaffinity(0)) > 1 and find_mpirun() else 1


def run_demo(folder, overwrite, printer, sand=False):
    """Run the commands, each a program of its own, and say where the report is.

    Args:
        folder: Folder to write; it is made.
        overwrite: Replace earlier output in it.
        printer: `terminal.Printer`; what the commands print goes where it prints.
        sand: Make a scan of sand first, and take that in place of the real one.

    Returns:
        {"status", "commands": [{"command", "wall_s", "status"}], "wall_s", "report"};
        a command that fails ends the list, and its status is that of the whole.

    Raises:
        InputError: the folder is not empty and ``overwrite`` is False.
    """
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"output {folder} is a file, expected a folder")
    if not overwrite and folder.is_dir() and any(folder.iterdir()):
        raise InputError(f"output {folder} is not empty, expected a new folder or --overwrite")
    scene, first = demo_scene(), []
    if sand:
        scene = folder / "scan" / "scene.toml"
        first = [[*SAND, str(scene.parent), *(["--overwrite"] if overwrite else [])]]
    folder.mkdir(parents=True, exist_ok=True)
    printer.say(f"scene: {scene} (copy it to start a test of your own)")

    done, status = [], 0
    for arguments in [*first, *demo_commands(scene, folder, overwrite)]:
        ranks = num_ranks() if arguments[0] == "run" else 1
        launch = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        command = shlex.join([*launch, "mufe", *arguments])
        printer.say("", f"$ {command}")
        wall_s, status = _timed(arguments, ranks, printer.stream)
        done.append({"command": command, "wall_s": wall_s, "status": status})
        printer.say(f"  {wall_s:.1f} s")
        if status != 0:
            break
    total = sum(one["wall_s"] for one in done)
    page = folder / "run" / "report.html"
    if status == 0:
        printer.say("", f"{total:.0f} s in all. The report: {page.resolve()}")
    return {
        "status": status,
        "commands": done,
        "wall_s": total,
        "report": str(page.resolve()) if status == 0 else None,
    }


def _timed(arguments, ranks, stream):
    """Wall time [s] and exit status of `mufe` with these arguments on so many ranks."""
    started = time.perf_counter()
    command = [sys.executable, "-m", "mufe_fenicsx", *arguments]
    environment = dict(os.environ)
    if ranks > 1:
        command = [find_mpirun(), "-n", str(ranks), *command]
        # The launcher stands between the program and the terminal.
        if sys.stderr.isatty():
            environment[TERMINAL] = "1"
    finished = subprocess.run(  # noqa: S603  words of our own, no shell
        command, stdout=stream, stdin=subprocess.DEVNULL, env=environment
    )
    return time.perf_counter() - started, finished.returncode
