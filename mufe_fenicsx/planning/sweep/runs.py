"""The runs of a sweep: programs of their own, some at a time; what is finished is not run again.

The state of a run is read from its folder: finished, begun (there is a checkpoint, from which it
goes on), or neither, when it begins anew. A run that another process still writes is waited for.
"""

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from ...errors import ASKED_BY, InputError, Interrupted
from ...machine.mpi_launcher import environment_without_launcher, find_mpirun
from ...output.run_folder import read_run_json
from ...output.run_lock import free_to_write
from .plan import Sweep, pack_settings

#: What a run is begun with.
PROGRAM = (sys.executable, "-m", "mufe_fenicsx")
#: Time between two looks at the runs [s].
PAUSE = 0.1
#: Runs get this one to end after a checkpoint: Open MPI's mpirun passes no other on.
TO_END = signal.SIGUSR1
#: What follows where a sweep is interrupted.
GO_ON = "; --resume goes on with the sweep"


def folder_of(folder, name) -> Path:
    """Folder of a run."""
    return Path(folder) / "runs" / name


def is_finished(folder) -> bool:
    """Whether the run in a folder has reached its end."""
    try:
        return bool(read_run_json(folder).get("finished"))
    except InputError:
        return False


def make_packings(sweep: Sweep, folder, progress=None) -> list:
    """Pack the samples of the runs where they have some, each once; folders of grains of the runs.

    Args:
        sweep: The runs.
        folder: Of the sweep; packings come into ``packings``.
        progress: As of :func:`~mufe_fenicsx.synthetic.rigid_packing.pipeline.pack`.

    Returns:
        List of paths, None of runs whose grains are those of the scene.

    Raises:
        Interrupted: A signal came.
    """
    places, found = {}, []
    for number in range(len(sweep.rows)):
        packing = sweep.packing(number)
        if not packing:
            found.append(sweep.grains)
            continue
        place = places.setdefault(packing, Path(folder) / "packings" / f"{len(places) + 1:03d}")
        if not place.exists():  # it appears when it is complete
            from ...synthetic.rigid_packing.pipeline import pack

            source, spheres, settings = pack_settings(packing)
            try:
                pack(source, settings, place, spheres=spheres, progress=progress)
            except (KeyboardInterrupt, Interrupted) as error:
                raise Interrupted(getattr(error, "signal", signal.SIGINT), GO_ON) from error
        found.append(place / "grains")
    return found


def arguments_of(sweep: Sweep, number, folder, grains) -> list[str]:
    """Arguments of `mufe` for a run that begins, with whole paths."""
    own = folder_of(folder, sweep.names[number]).resolve()
    changes = [f"--set={key}={text}" for key, text in sweep.changes(number).items()]
    of_grains = [] if grains is None else ["--grains", str(Path(grains).resolve())]
    return ["run", str(sweep.scene.resolve()), "-o", str(own), *of_grains, *changes, "--quiet"]


class Runner:
    """Runs what is not finished, so many at a time.

    Args:
        sweep: The runs.
        folder: Of the sweep.
        grains: Folder of the grains of each run, or None.
        num_ranks: Of each run.
        say: Called with a line when a run begins or ends.
        go_on: What is said to follow where a signal comes.
    """

    def __init__(self, sweep: Sweep, folder, grains, num_ranks=1, say=print, go_on=GO_ON):
        self.sweep, self.folder, self.grains = sweep, Path(folder), grains
        self.num_ranks, self.say, self.go_on = num_ranks, say, go_on
        self.failed = {}  #: number of a run -> why it failed
        self._todo, self._running = [], {}
        self._waits_for = self._signal = None

    def run_all(self, jobs):
        """Run what is left, ``jobs`` at a time.

        Raises:
            Interrupted: A signal came; the runs have written checkpoints.
        """
        self._todo = [k for k, name in enumerate(self.sweep.names)
                      if not is_finished(folder_of(self.folder, name))]  # fmt: skip
        done = len(self.sweep.names) - len(self._todo)
        self.say(f"{len(self.sweep.names)} runs, {done} of them finished")
        before = self._listen()
        try:
            while (self._todo or self._running) and not self._signal:
                while self._todo and len(self._running) < jobs:
                    if not self._begin(self._todo[0]):
                        break  # another process writes it
                    self._todo.pop(0)
                self._look()
                time.sleep(PAUSE)
            self._stop()
        finally:
            for process in self._running.values():
                process.kill()
            for number, handler in before.items():
                signal.signal(number, handler)

    def _listen(self):
        """Note signals from now on; the handlers before."""
        if threading.current_thread() is not threading.main_thread():
            return {}

        def note(number, _):
            self._signal = number

        return {number: signal.signal(number, note) for number in ASKED_BY}

    def _stop(self):
        """Where a signal came, let the runs write checkpoints and leave."""
        if not self._signal:
            return
        ended = Interrupted(self._signal, self.go_on)
        for number, process in self._running.items():
            with _log_of(self.folder, self.sweep.names[number]).open("a") as file:
                file.write(f"the sweep was {ended}; it asks this run to end\n")
            process.send_signal(TO_END)
        for process in self._running.values():
            process.wait()
        self._running.clear()
        raise ended

    def _begin(self, number):
        """Begin a run unless another process writes into its folder; whether it has begun."""
        name = self.sweep.names[number]
        own = folder_of(self.folder, name)
        if is_finished(own):  # by that process
            return True
        if free_to_write(own):
            if self._waits_for != number:
                self.say(f"run {name} is written by another process: waiting for it")
            self._waits_for = number
            return False
        begun = any(own.glob("checkpoints/step-*/manifest.json"))
        again = ["--resume"] if begun else ["--overwrite"] if own.exists() else []
        arguments = arguments_of(self.sweep, number, self.folder, self.grains[number])
        command = [*PROGRAM, *arguments, *again]
        if self.num_ranks > 1:
            command = [find_mpirun(), "-n", str(self.num_ranks), *command]
        word = "goes on" if begun else "begins"
        self.say(f"run {name} {word}: {self.sweep.words(number)}")
        log = _log_of(self.folder, name)
        log.parent.mkdir(exist_ok=True)
        log.unlink(missing_ok=True)
        with log.open("a", encoding="utf-8") as file:  # the sweep may add lines of its own
            self._running[number] = subprocess.Popen(  # noqa: S603  words of our own, no shell
                command, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT,
                env=environment_without_launcher(), start_new_session=True,
            )  # fmt: skip
        return True

    def _look(self):
        """See which runs have ended."""
        for number, process in list(self._running.items()):
            if process.poll() is None:
                continue
            del self._running[number]
            name = self.sweep.names[number]
            if is_finished(folder_of(self.folder, name)):
                self.say(f"run {name} is finished")
                continue
            if free_to_write(folder_of(self.folder, name)):  # another process was quicker
                self._todo.insert(0, number)
                continue
            self.failed[number] = _last_line(_log_of(self.folder, name))
            self.say(f"run {name} failed, status {process.returncode}: {self.failed[number]}")


def _log_of(folder, name):
    """What a run prints."""
    return Path(folder) / "logs" / f"{name}.log"


def _last_line(path):
    """Last line that a run printed."""
    lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "it printed nothing")
