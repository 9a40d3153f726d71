"""Checks of the values of a scene."""

import math
from collections.abc import Sequence

from ..errors import InputError, shown


def require(holds: bool, name: str, value: float, expectation: str) -> None:
    """Raise InputError unless ``holds`` and the value is finite."""
    if not (holds and math.isfinite(value)):
        raise InputError(f"{name} = {value}, expected {expectation}")


def require_kinetic(name: str, value: float | None, other_name: str, other: float) -> None:
    """Raise InputError unless a kinetic coefficient, if given, is between 0 and the static one."""
    if value is not None:
        require(0 <= value <= other, name, value, f"0 <= {name} <= {other_name} = {other}")


def one_of(name: str, value: object, choices: Sequence[str]) -> None:
    """Raise InputError unless the value is one of the choices."""
    if value not in choices:
        listed = " or ".join(f'"{choice}"' for choice in choices)
        raise InputError(f"{name} = {shown(value)}, expected {listed}")
