"""Settings of a user: default, unit, meaning and bounds of each, stated once.

A class of settings is a frozen dataclass whose fields are made by :func:`setting`. Scene files,
their JSON schema and explanations, options of commands and checks of values follow from that.
"""

import functools
import math
import operator
import typing
from collections.abc import Callable
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace

from .errors import InputError, shown
from .units import QUANTITIES

#: Default of a setting that has to be given.
REQUIRED = MISSING
#: Bounds of a number, lower ones first: their name in JSON schema, sign and comparison.
BOUNDS = {
    "ge": ("minimum", ">=", operator.ge),
    "gt": ("exclusiveMinimum", ">", operator.gt),
    "le": ("maximum", "<=", operator.le),
    "lt": ("exclusiveMaximum", "<", operator.lt),
}
#: Units as texts show them, where that is not as they are converted.
SYMBOLS = {"s^-1": "1/s", "kg/m^3": "kg/m³"}


@dataclass(frozen=True)
class Key:
    """One setting: a key of a table of a scene file, or an option of a command."""

    default: object = MISSING  #: `REQUIRED` where it has to be given
    symbol: str | tuple = ""  #: unit, or those of the columns of a list; "-" of a ratio
    meaning: str = ""  #: what it is, without its unit; notes stand after a semicolon
    limits: dict = field(default_factory=dict)  #: of a number, by the names of `BOUNDS`
    expected: str = ""  #: what the limits ask for, in words; "": as `BOUNDS` say it
    plausible: tuple = ()  #: least and largest value in a scene file; (): those of the unit
    allowed: tuple | Callable = ()  #: texts, if not any, or a function that returns them
    words: tuple = ()  #: texts that a path may be as well
    shape: tuple = ()  #: sizes of an array, -1 any; with a unit it has fractions
    off: str = ""  #: name of the option that turns it off
    form: str = ""  #: how an option takes a list, such as "z,y,x"
    name: str = ""
    cls: type | None = None  #: dataclass that holds it
    hint: object = None  #: its type

    @property
    def text(self):
        """What it means, with its unit."""
        first, semicolon, notes = self.meaning.partition(";")
        named = isinstance(self.symbol, str) and self.symbol
        unit = f" [{SYMBOLS.get(self.symbol, self.symbol)}]" if named else ""
        return first + unit + semicolon + notes

    @property
    def unit(self):
        """SI unit that values are converted to, "" for none; a tuple of those of columns."""
        if isinstance(self.symbol, tuple):
            return tuple(unit if unit in QUANTITIES else "" for unit in self.symbol)
        return self.symbol if self.symbol in QUANTITIES else ""

    @property
    def units(self):
        """Units of the numbers of the innermost lists of an array."""
        return self.unit if isinstance(self.unit, tuple) else (self.unit,) * self.shape[-1]

    @property
    def choices(self):
        """Allowed texts, if not any."""
        return tuple(self.allowed()) if callable(self.allowed) else self.allowed

    @property
    def bounds(self):
        """Bounds of a number, with the names of JSON schema."""
        return {BOUNDS[name][0]: limit for name, limit in self.limits.items()}

    @property
    def kinds(self):
        """Its types, None left out."""
        return tuple(kind for kind in typing.get_args(self.hint) or (self.hint,)
                     if kind is not type(None))  # fmt: skip

    @property
    def table(self):
        """Dataclass of a table within, or None."""
        return next((kind for kind in self.kinds if is_dataclass(kind)), None)

    @property
    def required(self):
        """Whether the key has no default."""
        return self.default is MISSING

    def check(self, name, value):
        """Raise InputError unless a value is within the limits, or one of the allowed texts."""
        if self.choices:
            one_of(name, value, self.choices)
        if self.limits and not isinstance(value, str):
            holds = all(BOUNDS[word][2](value, limit) for word, limit in self.limits.items())
            require(holds, name, value, self.expected or self._range(name))

    def _range(self, name):
        """What the limits ask for: "0 < strain < 1", "> 0 m/s"."""
        unit = "" if self.symbol in ("", "-") else f" {self.symbol}"
        signs = [(BOUNDS[word][1], f"{limit:g}") for word, limit in self.limits.items()]
        if len(signs) == 1:
            return " ".join(signs[0]) + unit
        (lower, least), (upper, most) = signs
        return f"{least} {lower.replace('>', '<')} {name} {upper} {most}{unit}"


def setting(default, unit, meaning, **more):
    """A field of a class of settings.

    Args:
        default: Value where none is given, or `REQUIRED`.
        unit: SI unit, or words such as "voxels"; a tuple for the columns of a list.
        meaning: As `Key.meaning`.
        more: Bounds of a number (``ge``, ``gt``, ``le``, ``lt``), and other fields of `Key`.
    """
    limits = {name: more.pop(name) for name in BOUNDS if name in more}
    key = Key(default, unit, meaning, limits, **more)
    return field(default=default, metadata={"key": key})


@functools.cache
def keys_of(cls):
    """Keys of a class of settings by name: dict of :class:`Key`."""
    hints = typing.get_type_hints(cls)
    found = {}
    for item in fields(cls):
        key = item.metadata.get("key", Key(item.default))
        found[item.name] = replace(key, name=item.name, cls=cls, hint=hints[item.name])
    return found


def check_keys(settings):
    """Raise InputError unless each of some settings that is not None is what its key allows."""
    for item in fields(settings):
        value = getattr(settings, item.name)
        if "key" in item.metadata and value is not None:
            item.metadata["key"].check(item.name, value)


def require(holds, name, value, expectation):
    """Raise InputError unless ``holds`` and the value, if a number, is finite."""
    finite = not isinstance(value, float) or math.isfinite(value)
    if not (holds and finite):
        raise InputError(f"{name} = {value}, expected {expectation}")


def one_of(name, value, choices):
    """Raise InputError unless the value is one of the choices."""
    if value not in choices:
        listed = " or ".join(f'"{choice}"' for choice in choices)
        raise InputError(f"{name} = {shown(value)}, expected {listed}")
