"""Bounds of the numbers and texts of a scene, where those of units are too wide.

What a value has to be beyond that, each class of settings says itself.
"""

from ..errors import InputError, shown

#: Largest absolute value of whole numbers.
LARGEST_COUNT = 2**31 - 1

#: Characters of a text.
LONGEST_TEXT = 500


def check_count(number: int, largest: int, name: str) -> None:
    """Raise InputError unless a whole number is at most the largest one."""
    if abs(number) > largest:
        raise InputError(f"{name} = {shown(number)}, expected a whole number up to {largest:g}")


def check_plausible(number: float, bounds: tuple, name: str) -> None:
    """Raise InputError unless a number is between two bounds, which may be ()."""
    least, largest = bounds or (number, number)
    if not least <= number <= largest:
        raise InputError(f"{name} = {shown(number)}, expected {least:g} to {largest:g}")


def check_text(name: str, text: str) -> None:
    """Raise InputError unless a text is as long as one may be."""
    if len(text) > LONGEST_TEXT:
        raise InputError(f"{name} = {shown(text)}, expected at most {LONGEST_TEXT} characters")
