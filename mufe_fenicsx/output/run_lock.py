"""One run at a time writes into a run folder: the file ``run.lock`` says which.

The file is made whole under another name and then linked to its own, which only one process can do,
on network file systems too. It names host, process and time. A process that ended without removing
it (killed, a machine that failed) leaves a stale lock, which the next run takes over:

- on the same machine, where that process is no longer there;
- from another one, where the file was not touched for :data:`SILENCE`; a run that holds a lock
  touches it every :data:`BEAT`.

A run that was stopped meanwhile and lost its folder learns that at its next row, and ends. Readers
need no lock.
"""

import contextlib
import json
import os
import secrets
import socket
import threading
import time
from datetime import UTC, datetime
from pathlib import Path

from ..errors import InputError, raise_together
from ..machine.files import reason, regular
from .run_folder import LOCK

#: A holder touches its file this often [s].
BEAT = 20.0
#: A lock from another machine that was not touched for so long is stale [s].
SILENCE = 600.0
#: Attempts to take a lock over, where others do so too.
TRIES = 20


class LostFolder(InputError):
    """The folder is no longer that of the run which wrote into it."""


class RunLock:
    """The right to write into a run folder. Collective; rank 0 does the work.

    Args:
        comm: MPI communicator.
        folder: The run folder.
    """

    def __init__(self, comm, folder):
        self.comm, self.folder = comm, Path(folder).absolute()
        self.path = self.folder / LOCK
        self._token, self._beating = None, threading.Event()

    def look(self):
        """See that no other run holds it; nothing is written. Collective.

        Raises:
            InputError: One does; on all ranks.
        """
        raise_together(self.comm, free_to_write(self.folder) if self.comm.rank == 0 else None)

    def take(self):
        """Take it where the folder exists. Returns a line about a stale one, or None. Collective.

        Raises:
            InputError: Another run holds it, or it cannot be written; on all ranks.
        """
        message, notice = None, None
        if self.comm.rank == 0 and self.folder.is_dir():
            try:
                notice = self._acquire()
            except InputError as error:
                message = str(error)
            except OSError as error:
                message = f"{self.path} cannot be written ({reason(error)})"
        raise_together(self.comm, message)
        return notice

    def check(self):
        """See that this run still holds it. Collective.

        Raises:
            LostFolder: The folder is gone, or belongs to another run; on all ranks.
        """
        message = self.comm.bcast(self._lost() if self.comm.rank == 0 else None)
        if message is not None:
            raise LostFolder(message)

    def free(self):
        """Give it back. Local; twice, or where it was not taken, does no harm."""
        self._beating.set()
        if self._token is not None and self._lost() is None:
            with contextlib.suppress(OSError):
                self.path.unlink()
        self._token = None

    def _acquire(self):
        notice = None
        for _ in range(TRIES):
            own = self._link()
            if own is not None:
                self._token = own
                self._beating.clear()
                threading.Thread(target=self._beat, args=(own,), daemon=True).start()
                return notice
            found = read_lock(self.folder)
            if found is None:  # freed in between
                continue
            silence = self._silence()
            if not is_stale(found, silence):
                raise InputError(busy(self.folder, found, silence))
            notice = f"lock of {self.folder} is stale ({holder(found)}), taken over"
            self._remove(found)
        raise InputError(f"{self.path} changes all the time, expected one run in that folder")

    def _link(self):
        """Make the lock unless there is one; its token, or None."""
        token = secrets.token_hex(8)
        own = self.path.with_name(f"{LOCK}.{token}")
        content = {"token": token, "host": socket.gethostname(), "machine": _machine(),
                   "process": os.getpid(), "started": _start_of(os.getpid()),
                   "time": datetime.now(UTC).isoformat(timespec="seconds")}  # fmt: skip
        with own.open("x", encoding="utf-8") as file:
            file.write(json.dumps(content) + "\n")
        try:
            os.link(own, self.path)
        except FileExistsError:
            return None
        except OSError:  # a file system without links: this is as good but on old network ones
            try:
                with self.path.open("x", encoding="utf-8") as file:
                    file.write(json.dumps(content) + "\n")
            except FileExistsError:
                return None
        finally:
            own.unlink()
        return token

    def _remove(self, stale):
        """Remove a stale lock, and no other one that somebody put into its place meanwhile."""
        aside = self.path.with_name(f"{LOCK}.{secrets.token_hex(8)}")
        with contextlib.suppress(FileNotFoundError):
            os.rename(self.path, aside)
            if read_lock(self.folder, aside.name) != stale:
                with contextlib.suppress(OSError):  # its holder sees where this fails
                    os.link(aside, self.path)
            aside.unlink()

    def _silence(self):
        """How long the lock was not touched [s], by the clock of the file system."""
        probe = self.path.with_name(f"{LOCK}.{secrets.token_hex(8)}")
        probe.touch(exist_ok=False)
        try:
            return probe.stat().st_mtime - self.path.stat().st_mtime
        except FileNotFoundError:
            return 0.0
        finally:
            probe.unlink()

    def _beat(self, token):
        while not self._beating.wait(BEAT):
            if token != self._token or self._lost() is not None:
                return
            with contextlib.suppress(OSError):
                os.utime(self.path, follow_symlinks=False)

    def _lost(self):
        """Why the folder is no longer this run's, or None."""
        try:
            found = read_lock(self.folder)
        except OSError:
            return None  # a network that is away for a moment is no other run
        if found is not None and found.get("token") == self._token:
            return None
        if not self.folder.is_dir():
            return (
                f"output folder {self.folder} is gone, deleted or moved while the run wrote into "
                "it: expected it to stay"
            )
        if found is None:
            return f"{self.path} is gone while the run wrote into its folder, expected it to stay"
        return busy(self.folder, found)


def read_lock(folder, name=LOCK):
    """What a lock says, a dict; empty where it is damaged, None where there is none."""
    try:
        found = json.loads(regular(Path(folder) / name).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def is_stale(lock, silence):
    """Whether the run that a lock names is no longer there.

    Args:
        lock: Of :func:`read_lock`.
        silence: How long it was not touched [s].
    """
    process, machine = lock.get("process"), lock.get("machine")
    if machine is not None and machine == _machine() and type(process) is int and process > 0:
        return not _lives(process, lock.get("started"))
    return silence > SILENCE


def holder(lock):
    """Host, process and time of a lock in words."""
    parts = (str(lock.get(name, "unknown"))[:60] for name in ("process", "host", "time"))
    return "process {} on {} since {}".format(*map(ascii_line, parts))


def ascii_line(text):
    """A text without line ends and controls."""
    return "".join(c if c.isprintable() else "?" for c in text)


def busy(folder, lock, silence=0.0):
    """The line that refuses a folder which another run writes; ``silence`` as of is_stale."""
    said = holder(lock) if lock else f"its {LOCK} is torn and does not say which"
    said += f", touched {silence / 60:.1f} minutes ago" if silence > BEAT else ""
    return (
        f"run folder {folder} is being written by another run ({said}), expected one that has "
        f"ended; where it has, delete {Path(folder) / LOCK}, or wait: from another machine, or "
        f"torn, it counts as left behind {SILENCE / 60:g} minutes after it was touched last"
    )


def free_to_write(folder):
    """What keeps a run from a folder, in words, or None. Nothing is written."""
    try:
        found = read_lock(folder)
        if found is None:
            return None
        silence = time.time() - (Path(folder) / LOCK).stat().st_mtime
    except FileNotFoundError:
        return None
    except OSError as error:
        return f"{Path(folder) / LOCK} cannot be read ({reason(error)})"
    return None if is_stale(found, silence) else busy(folder, found, silence)


def _machine():
    """What tells this machine since it started, and its numbers of processes, from others."""
    parts = [socket.gethostname()]
    with contextlib.suppress(OSError):
        parts.append(Path("/proc/sys/kernel/random/boot_id").read_text().strip())
        parts.append(os.readlink("/proc/self/ns/pid"))
    return " ".join(parts)


def _lives(process, started):
    """Whether a process of this machine runs, the same that started then."""
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass  # another user's
    now = _start_of(process)
    return now is None or now == started


def _start_of(process):
    """When a process started, in ticks of the machine; -1: it has ended; None: unknown."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    return -1 if fields[0] in "ZX" else int(fields[19])
