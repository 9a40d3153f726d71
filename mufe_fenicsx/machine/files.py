"""Where files are written: links are not followed, readers see what is whole or nothing.

A name in a folder of results may be a link that somebody put there, which leads elsewhere. New
files are made under names that nobody can foresee, and renamed; those that grow in place have to
be plain files that stand in that folder alone.
"""

import errno
import os
import secrets
import shutil
import signal
import stat
import sys
import tempfile
import threading
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import InputError, Interrupted, raise_together

#: End of the name of a file that is not whole yet.
PART = ".part"
#: Room for what an HDF5 file holds beside its arrays [bytes].
HEADERS = 64 * 1024
#: Requests to end that leave nothing temporary.
SIGNALS = (signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)


def reason(error):
    """Short text of an OSError or of an HDF5 error, without the path."""
    return (getattr(error, "strerror", None) or str(error)).splitlines()[0]


def regular(path):
    """A path, as it is, of a file, a link to one or nothing: for reading.

    Raises:
        OSError: It is something else: a pipe would be waited for.
    """
    path = Path(path)
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "is no plain file", str(path))
    return path


def own_folder(path):
    """Make a folder inside one of results, unless it is there; returns its path.

    Raises:
        OSError: It cannot be made, or is a link or no folder.
    """
    path = Path(path)
    if path.is_symlink():
        raise OSError(errno.ELOOP, "it is a symbolic link, expected a folder", str(path))
    path.mkdir(exist_ok=True)
    return path


def new_part(path):
    """Make an empty file beside the place of another one, under a name of its own; its path.

    Raises:
        OSError: It cannot be made, or at the place is something that is no plain file.
    """
    path = Path(path)
    _check_plain(path)
    part = path.with_name(f"{path.name}.{secrets.token_hex(6)}{PART}")
    os.close(open_plain(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL))
    return part


def parts_of(pattern):
    """The pattern of what :func:`new_part` makes for the files of a pattern."""
    return f"{pattern}.*{PART.lstrip('.')}"


@contextmanager
def replacing(path):
    """A new file that takes the place ``path`` when the block ends well.

    Raises:
        OSError: As of :func:`new_part`.
    """
    part = new_part(path)
    try:
        yield part
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def open_plain(path, flags):
    """Descriptor of a file that stays under its name.

    Args:
        path: The file.
        flags: Of ``os.open``.

    Raises:
        OSError: It cannot be opened, or is a link, a second name of a file, or no file.
    """
    _check_plain(path)
    # A pipe that takes its place meanwhile is not waited for.
    flags |= os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    descriptor = os.open(path, flags, 0o666)
    try:
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "it is no plain file", str(path))
        if found.st_nlink > 1:
            raise OSError(errno.EMLINK, "it has another name elsewhere, a hard link", str(path))
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def write_atomically(path, text):
    """Write a small text file so that readers see the old or the new one, never a part.

    Raises:
        InputError: It cannot be written.
    """
    try:
        with replacing(path) as part:
            with part.open("w", encoding="utf-8", errors="backslashreplace") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
    except OSError as error:
        raise InputError(f"{path} cannot be written ({reason(error)})") from error


def append_line(comm, path, line, show=False):
    """Add a line to a log, and show it on the terminal where asked. Collective.

    Raises:
        InputError: It cannot be written; on all ranks.
    """
    message = None
    if comm.rank == 0:
        if show:
            print(f"mufe: {line}", file=sys.stderr, flush=True)
        try:
            flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT
            with open(
                path, "a", encoding="utf-8", opener=lambda p, _: open_plain(p, flags)
            ) as file:
                file.write(line + "\n")
        except OSError as error:
            message = f"{path} cannot be written ({reason(error)})"
    raise_together(comm, message)


def attempt(path, action):
    """(what went wrong or None, result or None) of something that writes to a file."""
    try:
        return None, action()
    except (OSError, RuntimeError) as error:  # HDF5 raises either
        return f"{path} cannot be written ({reason(error)})", None


def try_room(path, size):
    """Raise OSError unless ``size`` bytes and the headers of HDF5 fit on the disk.

    HDF5 may end the whole program where it cannot write its headers.
    """
    with path.open("wb") as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, size + HEADERS)


def _check_plain(path):
    try:
        mode = os.lstat(path).st_mode
    except FileNotFoundError:
        return
    if stat.S_ISLNK(mode):
        raise OSError(errno.ELOOP, "it is a symbolic link, expected a plain file", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is no plain file", str(path))


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
        raise InputError(f"output {path} cannot be written: {reason(error)}") from error


@contextmanager
def _told_to_end():
    """Requests to end raise `Interrupted` in the block, where nobody else waits for them."""

    def end(number, _):
        raise Interrupted(number, ", nothing is left")

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
