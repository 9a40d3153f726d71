"""Numbers with units, converted to SI once, where they enter."""

import functools
import math
import re
from decimal import Decimal

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
    "": (1e-15, 1e12),
}

#: Characters of a unit, and of all with its number. Its names may have small powers and no numbers:
#: pint would compute a tower of them.
LONGEST_UNIT, LONGEST = 40, 100
_UNIT = re.compile(
    r"%|[^\W\d]+(?:(?:\^|\*\*)?[+-]?\d)?(?:\s*[*/·\s]\s*[^\W\d]+(?:(?:\^|\*\*)?[+-]?\d)?)*"
)
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
    registry = _registry()
    try:
        return registry.Quantity(number, registry.parse_units(written_unit)).to(unit).magnitude
    except Exception:  # pint raises errors of many unrelated kinds on text that is no unit
        raise wrong from None


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
