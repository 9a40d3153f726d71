"""The ways in which a run ends early, and how messages show values."""

import dataclasses
import difflib
import functools
import inspect
import math
import operator
import os
import signal
import threading
import types
import typing
from collections import abc
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

#: Characters of a value in a message.
SHOWN = 60
#: Largest number that a caller means: products of larger ones are not finite.
LARGEST = 1e100
#: Names count as misspelled from this ratio of :mod:`difflib` on.
SIMILAR = 0.6


class InputError(ValueError):
    """Something the user gave cannot be used.

    The message is one line: the quantity, its value, what was expected.
    """


class SolverError(RuntimeError):
    """A computation went wrong while running: what happened and what to change."""


class UnstableError(SolverError):
    """The same where a shorter time step may be the answer."""


class Interrupted(RuntimeError):
    """Somebody asked the program to end: by which signal, and what was kept.

    Args:
        message: One line.
        signal: Number of the signal.
    """

    def __init__(self, message: str, signal: int):
        super().__init__(message)
        self.signal = int(signal)


def finite_array(name: str, value: object, shape: tuple[int, ...]) -> "np.ndarray":
    """The value as an array of finite numbers.

    Args:
        name: Of the quantity, for the message.
        value: Anything.
        shape: That it has to have.

    Raises:
        InputError: It is none, or of another shape.
    """
    import numpy as np  # commands that only print need no arrays

    try:
        array = np.asarray(np.nan if isinstance(value, str) else value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = np.array(np.nan)
    sound = np.abs(array) <= LARGEST  # nan is not
    if array.shape != shape or not sound.all():
        lost = np.count_nonzero(~sound)
        found = f"array of shape {array.shape}, {lost} of its numbers not finite"
        expected = f"finite numbers of shape {shape}" if shape else "a finite number"
        raise InputError(
            f"{name} = {shown(value) if array.size < 5 else found}, expected {expected}"
        )
    return array


def finite_number(
    name: str,
    value: object,
    *,
    gt: float | None = None,
    ge: float | None = None,
    le: float | None = None,
    unit: str = "",
) -> float:
    """The value as a finite number within bounds.

    Args:
        name: Of the quantity, for the message.
        value: Anything.
        gt, ge, le: What it has to exceed, reach, and may reach.
        unit: Of the bounds in the message.

    Raises:
        InputError: It is none, or not within them.
    """
    number = float(finite_array(name, value, ()))
    bounds = [(">", gt), (">=", ge), ("<=", le)]
    holds = {">": operator.gt, ">=": operator.ge, "<=": operator.le}
    if not all(limit is None or holds[sign](number, limit) for sign, limit in bounds):
        words = " and ".join(f"{sign} {limit:g}" for sign, limit in bounds if limit is not None)
        raise InputError(f"{name} = {shown(value)}, expected {f'{words} {unit}'.rstrip()}")
    return number


def checked[**P, R](function: Callable[P, R]) -> Callable[P, R]:
    """Let a public function take what its annotations say; numbers become finite floats.

    An InputError names argument, value and expectation.
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def call(*args: P.args, **options: P.kwargs) -> R:
        bound = signature.bind(*args, **options)
        hints = _hints(function)
        for name, value in bound.arguments.items():
            parameter = signature.parameters[name]
            single = parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
            if single and name in hints and value is not parameter.default:
                bound.arguments[name] = _taken(name, value, hints[name])
        return function(*bound.args, **bound.kwargs)

    return call


def check_fields(settings: Any, owner: str = "") -> None:
    """The same for the fields of a dataclass, which may be frozen; to be called where it is made.

    Args:
        settings: The dataclass.
        owner: What messages add to the name of a field.
    """
    cls: Any = type(settings)
    hints = _hints(cls)
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        if value is not field.default:
            value = _taken(f"{field.name}{owner}", value, hints[field.name])
            object.__setattr__(settings, field.name, value)


@functools.cache
def _hints(owner: Any) -> dict:
    return typing.get_type_hints(owner)


#: What messages expect of an argument, by its annotation.
WORDS = {
    str: "a text",
    bool: "True or False",
    abc.Callable: "a function",
    abc.Mapping: "a table by names",
    dict: "a table by names",
    Path: "a path",
}


def _taken(name, value, hint):
    """A value as an annotation means it."""
    union = isinstance(hint, types.UnionType) or typing.get_origin(hint) is typing.Union
    hints = typing.get_args(hint) if union else (hint,)
    kinds = [typing.get_origin(one) or one for one in hints]
    arrays = any(kind in (Any, complex) or not isinstance(kind, type) or
                 kind.__name__ == "ndarray" for kind in kinds)  # fmt: skip
    if arrays or (value is None and type(None) in kinds):
        return value
    kinds = [kind for kind in kinds if kind is not type(None)]
    for one, kind in zip([h for h in hints if h is not type(None)], kinds, strict=True):
        if kind in LISTS and _is_list(value):
            return _items_taken(name, value, typing.get_args(one), kind)
        if kind not in (int, float) and _is_a(value, kind):
            return value
    if float in kinds or int in kinds:
        return _number(name, value, float in kinds)
    words = [WORDS.get(kind, "a list" if kind in LISTS else _with_article(kind)) for kind in kinds]
    raise InputError(f"{name} = {shown(value)}, expected {' or '.join(dict.fromkeys(words))}")


def _with_article(kind):
    return f"a{'n' * kind.__name__.startswith(tuple('AEIOU'))} {kind.__name__}"


#: Annotations of several values in a row.
LISTS = (abc.Sequence, abc.Collection, list, tuple)


def _is_list(value):
    return isinstance(value, list | tuple | set | range) or type(value).__name__ == "ndarray"


def _is_a(value, kind):
    if kind is Path:
        return isinstance(value, str | os.PathLike)
    if kind is bool:
        return isinstance(value, bool) or type(value).__name__ == "bool"  # NumPy's too
    if kind is abc.Callable:
        return callable(value)
    return isinstance(value, kind) and not (kind in LISTS and isinstance(value, str))


def _items_taken(name, value, hints, kind):
    """The items of a list of numbers or texts as they are meant; other lists as they are."""
    several = Ellipsis in hints or kind is not tuple
    item = hints[0] if hints else Any
    plain = (float, int, str)
    if item not in plain and not (set(typing.get_args(item)) & set(plain)):
        return value
    if not several and len(value) != len(hints):
        raise InputError(f"{name} = {shown(list(value))}, expected {len(hints)} values")
    wanted = [item] * len(value) if several else hints
    found = [_taken(f"{name}[{k}]", *of) for k, of in enumerate(zip(value, wanted, strict=True))]
    return found if kind is list else tuple(found)


def _number(name, value, fraction):
    """A finite float, or a whole number."""
    number = float(finite_array(name, math.nan if _is_a(value, bool) else value, ()))
    if fraction:
        return number
    if number != int(number):
        raise InputError(f"{name} = {shown(value)}, expected a whole number")
    return int(value)


def body_of(name: str, body: object) -> tuple["np.ndarray", "np.ndarray"]:
    """Nodes [m], shape (num_nodes, 3), and tetrahedra, (num_cells, 4), of a body that is given.

    Args:
        name: Of the body, for the message.
        body: Anything.

    Raises:
        InputError: It is no such pair, or a tetrahedron names a node that there is not.
    """
    import numpy as np

    wanted = "expected a pair of nodes, shape (n, 3), and tetrahedra, shape (m, 4)"
    pair: Any = body
    try:
        given, tetrahedra = pair
        points, cells = np.asarray(given), np.asarray(tetrahedra)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {shortened(shown(body))}, {wanted}") from None
    found = f"{points.shape} and {cells.shape}"
    if points.ndim != 2 or cells.ndim != 2 or points.shape[1] != 3 or cells.shape[1] != 4:
        raise InputError(f"shapes of {name} = {found}, {wanted}")
    if not len(cells) or cells.dtype.kind not in "iu":
        raise InputError(
            f"tetrahedra of {name} = {len(cells)} of {cells.dtype}, expected whole numbers of nodes"
        )
    if cells.min() < 0 or cells.max() >= len(points):
        raise InputError(
            f"node of a tetrahedron of {name} = {cells.max() if cells.min() >= 0 else cells.min()}"
            f", expected 0 to {len(points) - 1}"
        )
    return finite_array(f"nodes of {name}", points, points.shape), cells.astype(np.int64)


def raise_together(comm: Any, message: str | None) -> None:
    """Raise the same InputError on every rank if any rank has a message. Collective.

    Args:
        comm: MPI communicator.
        message: What went wrong on this rank, or None.

    Raises:
        InputError: The message of the first rank that has one.
    """
    for other in comm.allgather(message):
        if other is not None:
            raise InputError(other)


def raise_on_broken_pipes() -> None:
    """Give SIGPIPE back to Python, so that a reader that left is a BrokenPipeError.

    To be called after gmsh or PETSc has started: the one lets the signal end the program without
    a word, the other aborts all ranks.
    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGPIPE, signal.getsignal(signal.SIGPIPE))


def shown(value: object) -> str:
    """A value as the user wrote it, but short: texts in double quotes, the rest as in TOML."""
    return _shown(value, 3)


def _shown(value, depth):
    if isinstance(value, str):
        return f'"{shortened(value)}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > 4 * SHOWN:
        return f"a number of {int((value.bit_length() - 1) * math.log10(2)) + 1} digits"
    if isinstance(value, list | tuple):
        if not depth:
            return "[…]"
        first = [_shown(item, depth - 1) for item in value[:4]]
        return "[" + ", ".join([*first, *(["…"] if len(value) > 4 else [])]) + "]"
    if isinstance(value, dict):
        return "a table"
    return shortened(str(value))


def nearest_name(word: object, known: Iterable[str]) -> str:
    """What a message expects in place of a name that is not known.

    Args:
        word: As it was written.
        known: Names that there are, in the order in which they are listed.

    Returns:
        The known name that is spelled much like it; where none is, all of them.
    """
    known = list(known)
    close = difflib.get_close_matches(str(word), known, n=1, cutoff=SIMILAR)
    if close or len(known) == 1:
        return (close or known)[0]
    return f"one of {', '.join(known)}" if known else "none"


def shortened(text: object) -> str:
    """The beginning of a text on one line, without characters that no terminal shows."""
    text = str(text)
    cut = text if len(text) <= SHOWN else text[:SHOWN] + "…"
    return "".join(c if c.isprintable() else "?" for c in cut)
