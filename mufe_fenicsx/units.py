"""Numbers with units, converted to SI once, where they enter."""

import functools
import math
import re
from decimal import Decimal

from .errors import InputError

#: SI unit -> what a number with it is, and an example of how to write it.
QUANTITIES = {
    "m": ("a length", "5 um"),
    "m/s": ("a speed", "10 mm/s"),
    "s": ("a time", "5 min"),
    "Pa": ("a stress", "10 MPa"),
    "kg/m^3": ("a density", "2.65 g/cm^3"),
    "s^-1": ("a rate", "100 s^-1"),
    "": ("a number", "0.1"),
}

_NUMBER_AND_UNIT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\d\s].*?)?\s*")


def to_si(value, unit, name):
    """A number in SI units from a number (already SI) or a text such as "5 um".

    Args:
        value: Number or text.
        unit: Unit of the result, a key of `QUANTITIES`; "" for a number without one.
        name: What the value is called in messages.

    Raises:
        InputError: not a number, not finite, an unknown unit or one of another dimension.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise InputError(f"{name} = {shown(value)}, expected {expected(unit)}")
    if isinstance(value, str):
        value = _parse(value, unit, name)
    try:
        number = float(value)
    except OverflowError:  # an integer beyond the range of floats
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{name} = {shown(value)}, expected {expected(unit)}, finite")
    return number


def expected(unit):
    """What a message asks for where a number with this unit is needed."""
    what, example = QUANTITIES[unit]
    return f'{what} such as "{example}"' if unit else what


def shown(value):
    """A value as the user wrote it: texts in double quotes, the rest as in TOML."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(shown(item) for item in value) + "]"
    return str(value)


def _parse(text, unit, name):
    match = _NUMBER_AND_UNIT.fullmatch(text)
    wrong = InputError(f"{name} = {shown(text)}, expected {expected(unit)}")
    if match is None:
        raise wrong
    number, written_unit = Decimal(match[1]), match[2]
    if written_unit is None:
        if unit:  # a text says its unit; a bare number is SI
            raise InputError(f"{name} = {shown(text)}, expected {expected(unit)}, with its unit")
        return number
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
