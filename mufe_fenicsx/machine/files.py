"""Where files are opened for writing: links are not followed, readers see a file whole or not.

A name in a folder of results may be a link that somebody put there, which leads elsewhere. New
files are made under names that nobody can foresee, and renamed; those that grow in place have to
be plain files that stand in that folder alone.
"""

import errno
import os
import secrets
import stat
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError

#: End of the name of a file that is not whole yet.
PART = ".part"


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


def _check_plain(path):
    try:
        mode = os.lstat(path).st_mode
    except FileNotFoundError:
        return
    if stat.S_ISLNK(mode):
        raise OSError(errno.ELOOP, "it is a symbolic link, expected a plain file", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is no plain file", str(path))
