"""How far a run is, from the files it writes as it goes on: history.csv and run.json.

The strain at which it ends is that of its scene.toml. Nothing else is read, and nothing written.
"""

import math
import time
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import InputError

#: How many seconds without a row make it worth saying [s], and how many times the usual interval.
SILENCE, INTERVALS = 60.0, 10.0
#: Files by which a folder is known as that of a run.
FIRST = ("run.json", "history.csv", "scene.toml")
#: Rows that say how fast strain grows, and rows seen that say how fast steps are.
RECENT, SEEN = 50, 60


@dataclass(frozen=True)
class Progress:
    """Where a run stands; what is not known is None."""

    title: str
    #: One of :data:`STATES`; waiting: there is no run yet; silent: no row for long, it computes
    #: or was killed.
    state: str
    why: str  #: why it is in that state, in words
    values: dict = field(default_factory=dict)  #: numbers of the last row, SI units
    steps_per_second: float | None = None
    cells_per_second: float | None = None  #: tetrahedra times steps
    seconds_left: float | None = None
    rests_on: str | None = None  #: what ``seconds_left`` takes for granted, in words
    seconds_since_row: float | None = None

    @property
    def ended(self):
        """Whether no more will come."""
        return self.state in ("finished", "stopped")

    def as_dict(self):
        """Everything, as JSON can hold it."""
        return {
            "title": self.title,
            "state": self.state,
            "why": self.why,
            **self.values,
            "steps_per_second": self.steps_per_second,
            "cells_per_second": self.cells_per_second,
            "seconds_left": self.seconds_left,
            "seconds_left_rests_on": self.rests_on,
            "seconds_since_row": self.seconds_since_row,
        }


class Watch:
    """Looks at a run folder again and again; :meth:`look` is what is there now.

    Args:
        folder: Folder that `mufe run` writes; it may still be empty of rows.
        clock: Seconds since the epoch, as those of files.
        wait: The folder may still be absent or empty, of a run that has yet to begin.

    Raises:
        InputError: There is no such folder, or nothing of a run in it.
    """

    def __init__(self, folder, clock=time.time, wait=False):
        self.folder, self.clock = Path(folder), clock
        self._before = []  # (seconds, step) of rows as they came
        if not self.folder.is_dir() and not (wait and not self.folder.exists()):
            raise InputError(
                f"run folder {folder} is absent, expected a folder that mufe run writes"
            )
        if not self._begun() and not (wait and self._empty()):
            raise InputError(
                f"run folder {folder} has none of run.json, history.csv and scene.toml, expected "
                "a folder that mufe run writes"
            )

    def _begun(self):
        return any((self.folder / name).exists() for name in FIRST)

    def _empty(self):
        from ..output.run_folder import LOCK

        there = self.folder.iterdir() if self.folder.is_dir() else ()
        return all(path.name.startswith(LOCK) for path in there)

    def look(self):
        """The run as its files say it now, a :class:`Progress`.

        A row that is being written is left out; a file that is being replaced, or a history
        that was cut back to a checkpoint, is met at the next look.
        """
        if not self._begun():
            return Progress(self.folder.resolve().name, "waiting", "the run has yet to begin")
        run, started = self._run()
        history, written = self._history()
        title = run.get("title") or self.folder.resolve().name
        reason = run.get("stop_reason")
        died = self._died() if reason in (None, "running") else None
        if history is None:
            if run.get("finished") is False and reason not in (None, "running"):
                return Progress(title, "stopped", reason)
            if died is not None:
                return Progress(title, "stopped", died)
            return Progress(title, "starting", "there is no row of the history yet")
        values = _last_row(history)
        self._remember(written, values)
        speed = self._steps_per_second(run, started)
        since = max(self.clock() - written, 0.0)
        state, why = ("stopped", died) if died is not None else self._state(run, since)
        cells = run.get("num_cells")
        left = rests_on = None
        if state in ("running", "silent"):
            left = self._seconds_left(history, values, speed, since)
        if left is not None:
            rests_on = "if strain and steps go on as in the last rows"
            if self._stages():
                rests_on = "if later stages take as many steps as this one"
        return Progress(
            title,
            state,
            why,
            values | {"target_strain": self._target()},
            steps_per_second=speed,
            cells_per_second=speed * cells if speed is not None and cells else None,
            seconds_left=left,
            rests_on=rests_on,
            seconds_since_row=since,
        )

    def _run(self):
        """run.json and when it was written; an empty one where there is none yet."""
        from ..output.run_folder import read_run_json

        path = self.folder / "run.json"
        try:
            return read_run_json(self.folder), path.stat().st_mtime
        except (InputError, OSError):
            return {}, None

    def _history(self):
        """Columns and when the last row came; None without a row."""
        from ..output.history import read_history

        path = self.folder / "history.csv"
        try:
            written = path.stat().st_mtime
            history = read_history(path)
        except (InputError, OSError):
            return None, None
        needed = ("step", "strain", "stage", "time")
        if not all(name in history and len(history[name]) for name in needed):
            return None, None
        return history, written

    def _remember(self, written, values):
        row = written, values["step"]
        if self._before and row[1] < self._before[-1][1]:
            self._before.clear()  # it went back to a checkpoint
        if not self._before or row[1] > self._before[-1][1]:
            self._before.append(row)
            del self._before[:-SEEN]

    def _steps_per_second(self, run, started):
        """Of the rows that came since the first look, else since run.json was written."""
        last, first = self._before[-1], self._before[0]
        if len(self._before) < 2:
            if started is None or run.get("stop_reason") != "running":
                return _mean_speed(run)
            first = started, run.get("num_steps", 0)
        steps, seconds = last[1] - first[1], last[0] - first[0]
        return steps / seconds if steps > 0 and seconds > 0 else None

    def _state(self, run, since):
        reason = run.get("stop_reason") or "no reason recorded"
        if run.get("finished"):
            return "finished", reason
        if run and reason != "running":
            return "stopped", reason
        usual = self._usual_interval()
        if since > max(SILENCE, INTERVALS * (usual or 0.0)):
            return "silent", "no row for long: it computes, or was killed"
        return "running", "it writes rows"

    def _died(self):
        """In words that the process which holds the folder is gone, and what to do; or None.

        Of a process on another machine nothing is known.
        """
        from ..output.run_lock import holder, is_stale, read_lock

        try:
            lock = read_lock(self.folder)
        except (InputError, OSError):
            return None
        if not lock or not is_stale(lock, silence=0.0):
            return None
        kept = any((self.folder / "checkpoints").glob("step-*[0-9]"))
        what = (
            "--resume goes on from its checkpoint"
            if kept
            else "it left no checkpoint, --overwrite begins anew"
        )
        return f"the run died ({holder(lock)}); {what}"

    def _usual_interval(self):
        rows = self._before
        if len(rows) < 2:
            return None
        return (rows[-1][0] - rows[0][0]) / (len(rows) - 1)

    def _seconds_left(self, history, values, speed, since):
        """Steps to the last strain, at the strain a step of the last rows, by the speed [s]."""
        if self._stages():
            steps = _steps_left(history, *self._stages())
            return None if steps is None or not speed else max(steps / speed - since, 0.0)
        target = self._target()
        rows = (history["stage"] == values["stage"]).nonzero()[0][-RECENT:]
        if values["stage"] == "seating" or target is None or not speed or len(rows) < 2:
            return None
        strain = history["strain"][rows[-1]] - history["strain"][rows[0]]
        steps = history["step"][rows[-1]] - history["step"][rows[0]]
        if not (strain > 0 and steps > 0):
            return None
        return max(float((target - values["strain"]) * steps / strain / speed - since), 0.0)

    def _scene(self):
        from ..machine.files import regular

        return tomllib.loads(regular(self.folder / "scene.toml").read_text(encoding="utf-8"))

    def _stages(self):
        """Number of stages by the scene, rows of each, and which ends the seating, from 1.

        None without stages.
        """
        try:
            scene = self._scene()
            num = len(scene["stage"])
            zeros = [k for k, stage in enumerate(scene["stage"], 1) if stage.get("zero") is True]
            rows = math.ceil((int(scene["output"]["history"]) - 1) / num)
            return num, rows, max(zeros, default=0)
        except (OSError, ValueError, KeyError, TypeError, AttributeError, ZeroDivisionError):
            return None

    def _target(self):
        """Strain at which the run ends, by its scene; None where that does not say."""
        try:
            scene = self._scene()
            return float(scene["oedometer"]["strain"])
        except (OSError, ValueError, KeyError, TypeError):
            return None


def _steps_left(history, num_stages, num_rows, seated):
    """Steps to the end of a test by stages, None where nothing tells.

    A stage has so many rows at most, even ones of its progress; stages that come are taken to
    have as many steps as the present one, by its rows so far. While walls still come on to the
    sample, until the stage ``seated`` ends, nothing tells when they meet it.
    """
    stage, step = history["stage"], history["step"]
    changes = (stage[1:] != stage[:-1]).nonzero()[0] + 1
    if stage[-1] == "seating" or len(changes) < seated:
        return None
    first = int(changes[-1]) if len(changes) else 0
    done = len(stage) - 1 - first
    if done < 2 or not step[-1] > step[first]:
        return None
    a_stage = float(step[-1] - step[first]) * max(num_rows / done, 1.0)
    return a_stage - (step[-1] - step[first]) + a_stage * (num_stages - 1 - len(changes))


def _mean_speed(run):
    """Steps a second of a run that has ended [1/s], None where it is not known."""
    seconds = (run.get("wall_s") or 0.0) - (run.get("setup_s") or 0.0)
    return run["num_steps"] / seconds if seconds > 0 and run.get("num_steps") else None


def _last_row(history):
    """Numbers of the last row, and what follows from it; None where a ratio has no meaning."""
    from ..analysis import energy_check, quasi_static

    values = {
        name: column[-1].item() if hasattr(column[-1], "item") else column[-1]
        for name, column in history.items()
    }
    shown = {
        name: values[name]
        for name in (
            *("step", "time", "dt", "stage", "strain", "height", "speed", "stress"),
            *("force_z_max", "force_z_min", "num_contacts", "num_active_contacts"),
            *("elements_per_radius", "elements_per_radius_tenth", "overlap"),
            *("num_opened", "num_fragments", "broken_grains", "cracks_fracture"),
        )
        if name in values
    }
    for name, ratio in (
        ("kinetic_ratio", quasi_static.kinetic_ratio),
        ("force_difference", quasi_static.force_difference),
        ("residual_ratio", energy_check.residual_ratio),
    ):
        try:
            found = float(ratio(history)[-1])
        except KeyError:
            continue
        shown[name] = found if math.isfinite(found) else None
    work = values.get("work")
    for name in ("elastic", "plastic", "friction"):
        if work and name in values:
            shown[f"{name}_share"] = values[name] / work
    return shown
