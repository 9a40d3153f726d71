"""Results appear whole or not at all: written beside their place, then renamed."""

import os
import shutil
import signal
import tempfile
import threading
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import InputError, Interrupted

#: Requests to end that leave nothing temporary.
SIGNALS = (signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)


@contextmanager
def new_folder(path, *, overwrite=False, marker=None):
    """A temporary folder that takes the place of ``path`` when the block ends well.

    Args:
        path: Folder to make.
        overwrite: Replace a folder that is not empty.
        marker: File by which a folder is known as one that may be replaced.

    Raises:
        InputError: the folder is there and not empty, or cannot be written.
    """
    path = Path(path).absolute()
    check_place(path)
    if not path.is_symlink() and path.is_dir() and any(path.iterdir()):
        known = marker is None or (path / marker).exists()
        if not overwrite:
            more = ", or --overwrite" if known else ""
            raise InputError(f"output folder {path} is not empty, expected a new one{more}")
        if not known:
            raise InputError(
                f"output folder {path} is not empty and holds no {marker}, "
                "expected a folder that may be replaced"
            )
    elif path.is_symlink() or (path.exists() and not path.is_dir()):
        what = "symbolic link" if path.is_symlink() else "file"
        raise InputError(f"output folder {path} is a {what}, expected a folder")
    with _temporary(path.parent) as temporary:
        yield temporary
        with written(path):
            if path.exists():
                shutil.rmtree(path)
            os.replace(temporary, path)


@contextmanager
def new_files(*paths, overwrite=False):
    """A temporary folder whose files take the places ``paths`` when the block ends well.

    The files are to be written into the folder under their own names.

    Raises:
        InputError: one of the files is there already, or cannot be written.
    """
    paths = [Path(path).absolute() for path in paths]
    check_place(paths[0])
    for path in paths:
        if path.is_dir() or (path.exists() and not overwrite):
            more = "" if path.is_dir() or overwrite else ", or --overwrite"
            raise InputError(f"output {path} exists, expected a new file{more}")
    with _temporary(paths[0].parent) as temporary:
        yield temporary
        with written(paths[0]):
            for path in paths:
                os.replace(temporary / path.name, path)


def check_place(path):
    """Raise InputError unless something can be written at a path, before any work is done."""
    parent = Path(path).absolute().parent
    with written(path):
        parent = next(folder for folder in (parent, *parent.parents) if folder.exists())
    if not parent.is_dir():
        raise InputError(f"output {path} cannot be written: {parent} is a file, expected a folder")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(f"output {path} cannot be written: no permission in {parent}")


@contextmanager
def written(path):
    """Errors of the file system, a full disk among them, as InputError."""
    try:
        yield
    except OSError as error:
        what = error.strerror or " ".join(str(error).split())
        raise InputError(f"output {path} cannot be written: {what}") from error


@contextmanager
def _told_to_end():
    """Requests to end raise `Interrupted` in the block, where nobody else waits for them."""

    def end(number, _):
        raise Interrupted(f"stopped by {signal.Signals(number).name}, nothing is left", number)

    ours = threading.current_thread() is threading.main_thread()
    numbers = [s for s in SIGNALS if ours and signal.getsignal(s) == signal.SIG_DFL]
    for number in numbers:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def _temporary(parent):
    temporary, made = None, [folder for folder in (parent, *parent.parents) if not folder.exists()]
    try:
        with written(parent):
            parent.mkdir(parents=True, exist_ok=True)
            temporary = Path(tempfile.mkdtemp(dir=parent, prefix=".mufe-"))
        # mkdtemp lets nobody else read; what is renamed gets the usual rights.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o777 & ~mask)
        with written(parent), _told_to_end():
            yield temporary
    finally:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)
        with suppress(OSError):  # those that hold something stay
            for folder in made:
                folder.rmdir()
