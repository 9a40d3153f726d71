"""Voxels on disk, as readers of formats hand them over."""

import stat
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import InputError


@dataclass
class Stored:
    """Voxels on disk, in the order of axes of the file."""

    voxels: Any  #: has shape and dtype, and gives a part by a slice along each axis
    #: Along each axis of the file, if that states it [m]; a text where it states no length.
    voxel_size: tuple | str | None = None
    white_is_zero: bool = False  #: small numbers are bright, as the file states
    whole: bool = False  #: a part cannot be read without all of it
    notices: tuple = ()  #: lines on what was done to make three axes of it

    @property
    def shape(self):
        """Voxels along each axis."""
        return tuple(int(n) for n in self.voxels.shape)

    @property
    def letters(self):
        """What the file calls its axes: "zyx", "tyx"; "" where it does not say, "?": unknown."""
        return getattr(self.voxels, "letters", "").lower()

    def order(self, given, path):
        """The order of axes to read by: the given one, else the stated one, else "zyx".

        Where the file states another, a line is added to the notices.
        """
        stated = self.letters if sorted(self.letters) == ["x", "y", "z"] else None
        taken = given or stated or "zyx"
        if stated and (taken, stated) != ("zyx", "zyx"):
            line = f'{path} states axes in the order "{stated}": taken as "{taken}"'
            self.notices += (line,)
        others = [OTHER_AXES[letter] for letter in self.letters if letter in OTHER_AXES]
        if others and len(self.shape) == 3:
            first = taken[[letter in OTHER_AXES for letter in self.letters].index(True)]
            self.notices += (f"{path} states an axis of {others[0]}: taken as {first}",)
        return taken


#: Axes that are no direction in space, by the letters of tifffile and ilastik.
OTHER_AXES = {"t": "times", "c": "channels"}


class ThreeAxes:
    """Voxels with axes of length one left out until three are left, the last ones first."""

    def __init__(self, voxels):
        self.voxels, self.dtype = voxels, voxels.dtype
        shape = [int(n) for n in voxels.shape]
        self.kept = list(range(len(shape)))
        for axis in reversed(range(len(shape))):
            if len(self.kept) > 3 and shape[axis] == 1:
                self.kept.remove(axis)
        self.shape = tuple(shape[axis] for axis in self.kept)
        letters = getattr(voxels, "letters", "")
        self.letters = "".join(letters[axis] for axis in self.kept if letters)

    def __getitem__(self, where):
        full = [slice(0, 1)] * len(self.voxels.shape)
        for axis, part in zip(self.kept, where, strict=True):
            full[axis] = part
        part = self.voxels[tuple(full)]
        return part.reshape([part.shape[axis] for axis in self.kept])


def three_axes(voxels):
    """Voxels with three axes, where that needs no more than to leave out axes of length one."""
    return voxels if len(voxels.shape) <= 3 else ThreeAxes(voxels)


@contextmanager
def errors_of_readers(path):
    """What libraries raise on files that are damaged, of dozens of kinds, as InputError."""
    try:
        yield
    except InputError:
        raise
    except MemoryError as error:
        raise InputError(f"image {path} cannot be read: the memory is full") from error
    except Exception as error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"image {path} cannot be read: {text[:300]}") from error


def check_regular(path, whole, kind="image"):
    """Raise InputError unless a path is a plain file: to open a pipe would wait for ever.

    Args:
        path: The file.
        whole: The image, or whatever it belongs to, named in the message.
        kind: What that is called there.
    """
    path = Path(path)
    named = whole if path == Path(whole) else f"{whole}: {path.name}"
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:  # ValueError: NUL in the name
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{kind} {named} cannot be read: {reason}") from None
    if not stat.S_ISREG(mode):
        raise InputError(f"{kind} {named} is no plain file, expected one")


def only_one(found, path, kind="arrays"):
    """The one volume of a file that holds several things.

    Raises:
        InputError: there is none, or more than one.
    """
    if len(found) != 1:
        names = ", ".join(str(name) for name in list(found)[:10])
        more = ", …" if len(found) > 10 else ""
        raise InputError(
            f"{path} holds {len(found)} {kind} with three axes ({names}{more}), "
            "expected one, or its name as key"
        )
    return next(iter(found.values()))
