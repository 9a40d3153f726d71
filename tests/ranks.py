"""What ranks of a test do alone, and what they have to do together."""

import ast
import functools
import pkgutil
import re
import time
from pathlib import Path
from typing import NamedTuple

import mufe_fenicsx

PACKAGE = Path(mufe_fenicsx.__file__).parent
#: By these all ranks raise what one of them found.
DOORS = ("raise_together", "on_first_rank")
#: A rank that waits longer than this for another one waits forever [s].
PATIENCE = 120.0


def on_first(comm, action):
    """What ``action()`` gives on rank 0, on all ranks; where it fails there, all fail. Collective.

    Else the other ranks would wait for rank 0 in the next collective call.
    """
    found, failure = None, None
    if comm.rank == 0:
        try:
            found = action()
        except Exception as error:
            failure = f"{type(error).__name__} on rank 0: {error}"
    found, failure = comm.bcast((found, failure))
    assert failure is None, failure
    return found


class Site(NamedTuple):
    """A call in the package by which all ranks raise what one of them found."""

    file: str
    first: int  #: line
    last: int

    def is_in(self, traceback):
        """Whether an error came through it."""
        while traceback is not None:
            at = traceback.tb_frame.f_code.co_filename, traceback.tb_lineno
            if at[0] == self.file and self.first <= at[1] <= self.last:
                return True
            traceback = traceback.tb_next
        return False


@functools.cache
def sites():
    """All such calls by the name of file and function, and a number where it has several."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        calls = {}
        for function, call in _calls(ast.parse(path.read_text(encoding="utf-8"))):
            calls.setdefault(function, []).append(call)
        for function, several in calls.items():
            for number, call in enumerate(several, start=1):
                name = f"{path.relative_to(PACKAGE)} {function}"
                name += f" {number}" if len(several) > 1 else ""
                found[name] = Site(str(path), call.lineno, call.end_lineno)
    return found


def _calls(node, inside=""):
    """The function and the call of each in a tree, as they come in the file."""
    if isinstance(node, ast.Call) and getattr(node.func, "id", "") in DOORS:
        yield inside, node
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        inside = f"{inside}.{node.name}" if inside else node.name
    for child in ast.iter_child_nodes(node):
        yield from _calls(child, inside)


def refused(comm, action, kind, message):
    """See that ``action()`` raises the same error on all ranks. Collective.

    A rank that does not come to its end within :data:`PATIENCE` hangs, and all are ended.

    Args:
        comm: MPI communicator.
        action: Function.
        kind: Class of the error.
        message: Pattern that it has to match.

    Returns:
        The traceback of the error on this rank.
    """
    meeting, found = comm.Dup(), None
    try:
        action()
    except Exception as error:
        found = error
    _meet(meeting)
    said = comm.allgather(f"{type(found).__name__}: {found}")
    assert len(set(said)) == 1, said
    assert isinstance(found, kind) and re.search(message, str(found)), said
    return found.__traceback__


def _meet(comm):
    """Wait for all ranks; where one does not come, end them all."""
    arrival, deadline = comm.Ibarrier(), time.monotonic() + PATIENCE
    while not arrival.Test():
        if time.monotonic() > deadline:
            comm.Abort(1)
        time.sleep(1e-3)
    comm.Free()


def failing(patch, target, failure, rank, comm, before=0):
    """Let a function of the package fail on one rank alone. Local.

    Args:
        patch: pytest's MonkeyPatch, which undoes it.
        target: Its name with all modules.
        failure: What it raises, or else returns.
        rank: The rank.
        comm: MPI communicator.
        before: So many calls go well before.
    """
    if comm.rank != rank:
        return
    whole, well = pkgutil.resolve_name(target), iter(range(before))

    def fails(*arguments, **options):
        if next(well, None) is not None:
            return whole(*arguments, **options)
        if isinstance(failure, Exception):
            raise failure
        return failure

    patch.setattr(target, fails)
