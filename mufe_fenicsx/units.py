"""What users state: numbers with units, converted to SI once where they enter, and settings.

A class of settings is a frozen dataclass whose fields are made by :func:`setting`: default, unit,
meaning and bounds, stated once. Scene files, their JSON schema and explanations, options of
commands and checks of values follow from that.
"""

import functools
import math
import operator
import re
import typing
from collections.abc import Callable
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from decimal import Decimal

from .arguments import check_fields
from .errors import InputError, shown

#: SI unit -> what a number with it is, and an example of how to write it.
QUANTITIES = {
    "m": ("a length", "5 um"),
    "m/s": ("a speed", "10 mm/s"),
    "m/s^2": ("an acceleration", "9.81 m/s^2"),
    "s": ("a time", "5 min"),
    "Pa": ("a stress", "10 MPa"),
    "kg/m^3": ("a density", "2.65 g/cm^3"),
    "s^-1": ("a rate", "100 s^-1"),
    "N": ("a force", "10 N"),
    "J/m^2": ("an energy over an area", "10 J/m^2"),
    "m^3": ("a volume", "1e-3 mm^3"),
    "N*m": ("a torque", "1 N*mm"),
    "rad": ("an angle", "30 deg"),
    "rad/s": ("a rate of turning", "6 deg/s"),
    "m/N": ("a compliance", "0.05 um/N"),
    "": ("a number", "0.1"),
}

#: SI unit -> least and largest absolute value, of numbers that are not zero: wide, since they shall
#: stop slips of the keyboard and values that no computation survives, not unusual tests.
PLAUSIBLE = {
    "m": (1e-10, 1e4),
    "m/s": (1e-12, 1e5),
    "m/s^2": (1e-9, 1e9),
    "s": (1e-18, 1e10),
    "Pa": (1e-6, 1e15),
    "kg/m^3": (1e-3, 1e12),
    "s^-1": (1e-9, 1e18),
    "N": (1e-15, 1e12),
    "J/m^2": (1e-9, 1e12),
    "m^3": (1e-30, 1e9),
    "N*m": (1e-20, 1e12),
    "rad": (1e-12, 1e6),
    "rad/s": (1e-12, 1e9),
    "m/N": (1e-18, 1e3),
    "": (1e-15, 1e12),
}

#: Characters of a unit, and of all with its number. Its names may have small powers and no numbers:
#: pint would compute a tower of them.
LONGEST_UNIT, LONGEST = 40, 100
_UNIT = re.compile(
    r"(?:%|[^\W\d]+(?:(?:\^|\*\*)?[+-]?\d)?(?:\s*[*/·\s]\s*[^\W\d]+(?:(?:\^|\*\*)?[+-]?\d)?)*)"
)
_NAME_OF_UNIT = re.compile(r"[^\W\d]+")
_NUMBER_AND_UNIT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\d\s].*?)?\s*")


def to_si(value, unit, name):
    """A number in SI units from a number (already SI) or a text such as "5 um".

    Args:
        value: Number or text.
        unit: Unit of the result, a key of `QUANTITIES`; "" for a number without one.
        name: What the value is called in messages.

    Raises:
        InputError: not a number, not finite, beyond :data:`PLAUSIBLE`, an unknown unit or
            one of another dimension.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise InputError(f"{name} = {shown(value)}, expected {expected(unit)}")
    try:
        number = float(_parse(value, unit, name) if isinstance(value, str) else value)
    except OverflowError:  # an integer beyond the range of floats
        number = math.inf
    check_number(number, unit, name, value, expected(unit))
    return number


def expected(unit):
    """What a message asks for where a number with this unit is needed."""
    what, example = QUANTITIES[unit]
    return f'{what} such as "{example}"' if unit else what


def _parse(text, unit, name):
    match = _NUMBER_AND_UNIT.fullmatch(text) if len(text) <= LONGEST else None
    wrong = InputError(f"{name} = {shown(text)}, expected {expected(unit)}")
    if match is None:
        raise wrong
    try:
        number, written_unit = Decimal(match[1]), match[2]
    except ArithmeticError:  # an exponent beyond what decimals have
        raise wrong from None
    if written_unit is None:
        if unit:  # a text says its unit; a bare number is SI
            raise InputError(f"{name} = {shown(text)}, expected {expected(unit)}, with its unit")
        return number
    if len(written_unit) > LONGEST_UNIT or not _UNIT.fullmatch(written_unit):
        raise wrong
    try:
        return _registry().Quantity(number, _unit_of(written_unit)).to(unit).magnitude
    except Exception:  # pint raises errors of many unrelated kinds on text that is no unit
        raise wrong from None


def _unit_of(text):
    """A unit of pint. Names have a plural, symbols none (SI brochure, 5.2): "kPas" is no "kPa"."""
    registry = _registry()
    for word in _NAME_OF_UNIT.findall(text):
        one = word.removesuffix("s")
        found = [registry.parse_unit_name(name)[:1] for name in (word, one) if name]
        if one != word and len(found) == 2 and found[0] == found[1]:
            if registry.get_symbol(one) == one != registry.get_name(one):
                raise ValueError(f"{one} has no plural")
    return registry.parse_units(text)


def base_number(text):
    """The number that a text is, in SI base units where it has a unit; None where it is none."""
    match = _NUMBER_AND_UNIT.fullmatch(text) if len(text) <= LONGEST else None
    if match is None or (
        match[2] and not (_UNIT.fullmatch(match[2]) and len(match[2]) <= LONGEST_UNIT)
    ):
        return None
    if not match[2]:
        return float(match[1])
    try:
        quantity = _registry().Quantity(Decimal(match[1]), _unit_of(match[2]))
        number = float(quantity.to_base_units().magnitude)
    except Exception:  # as of _parse
        return None
    return number if math.isfinite(number) else None


#: Factors of prefixes, the largest first.
PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
#: Units that texts write with one.
PREFIXED = ("Pa", "m", "s")


def with_unit(value, unit):
    """A number in SI units as a text to read: 1e11 Pa is "100 GPa".

    Args:
        value: In SI units.
        unit: A key of `QUANTITIES`, or "-" of a ratio.
    """
    factor, prefix = 1, ""
    if unit in PREFIXED:
        factor, prefix = next((p for p in PREFIXES if abs(value) >= 0.99995 * p[0]), (1, ""))
    symbol = "" if unit == "-" else prefix + SYMBOLS.get(unit, unit)
    return f"{value / factor + 0.0:.4g} {symbol}".rstrip()  # + 0.0: no minus sign before 0


def lengths_text(lengths):
    """Lengths [m] as an option takes them: "5 mm,10 mm"."""
    return ",".join(with_unit(length, "m") for length in lengths)


@functools.cache
def _registry():
    import pint  # half a second: only where a text with a unit is read

    # Decimals keep "5 um" exactly 5e-06.
    return pint.UnitRegistry(non_int_type=Decimal)


def check_number(number, unit, name, value, expected):
    """Raise InputError unless a number of a unit is finite and plausible.

    Args:
        number: In SI units.
        unit: A key of :data:`PLAUSIBLE`.
        name: What messages call it.
        value: As it was written.
        expected: What is expected, in words.
    """
    least, largest = PLAUSIBLE[unit]
    if not math.isfinite(number):
        raise InputError(f"{name} = {shown(value)}, expected {expected}, finite")
    if number and not least <= abs(number) <= largest:
        raise InputError(
            f"{name} = {shown(value)}, expected {expected}, of {least:g} to {largest:g} {unit}"
            .rstrip()
        )  # fmt: skip


# --- settings ---------------------------------------------------------------------------------

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
    usual: tuple = ()  #: least and largest that nobody wonders at; beyond them a line is said
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
        if self.entries is not None:
            return (dict,)
        return tuple(kind for kind in typing.get_args(self.hint) or (self.hint,)
                     if kind is not type(None))  # fmt: skip

    @property
    def table(self):
        """Dataclass of a table within, or None."""
        return next((kind for kind in self.kinds if is_dataclass(kind)), None)

    @property
    def entries(self):
        """Dataclass of the entries of a table with names of one's own, or None."""
        named = typing.get_origin(self.hint) is dict
        return typing.get_args(self.hint)[1] if named else None

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
    check_fields(settings)
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
