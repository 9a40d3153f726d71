"""What public functions and classes are given: their arguments, checked and converted."""

import dataclasses
import functools
import inspect
import math
import operator
import os
import types
import typing
from collections import abc
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import InputError, finite_array, shortened, shown

if TYPE_CHECKING:
    import numpy as np


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
