"""Bounds of the numbers and texts of a scene, by key, where those of units are too wide.

What a value has to be beyond that, each class of settings says itself.
"""

from ..errors import InputError, shown

#: Largest absolute value of whole numbers.
LARGEST_COUNT = 2**31 - 1

#: Key of a scene -> least and largest value, where those of its unit or of counts are too wide.
OF_KEYS = {
    "nu": (-0.99, 0.4999),
    "friction": (0.0, 1e3),
    "friction_kinetic": (0.0, 1e3),
    "wall_friction": (0.0, 1e3),
    "wall_friction_kinetic": (0.0, 1e3),
    "compliance": (1e-3, 1e3),
    "time_step_factor": (1e-3, 1.0),
    "close_gaps_over_h": (0.0, 10.0),
    "upsample": (0.05, 20.0),
    "filter_radius": (0.0, 50.0),
    "marker_depth": (0.0, 1e4),
    "scale": (1e-10, 1e4),
    "fields": (2, 100_000),
    "history": (2, 10_000_000),
    "max_iterations": (1, 100_000),
    "max_augmentations": (1, 100_000),
    "surface_nodes": (1, 1_000_000),
    "processes": (0, 4096),
    "seed": (0, 2**63 - 1),
}
#: Characters of a text.
LONGEST_TEXT = 500


def check_count(number: int, key: str, name: str) -> None:
    """Raise InputError unless a whole number of a key of a scene is a plausible one."""
    largest = OF_KEYS.get(key, (0, LARGEST_COUNT))[1]
    if abs(number) > largest:
        raise InputError(f"{name} = {shown(number)}, expected a whole number up to {largest:g}")


def check_key(key: str, number: float, name: str) -> None:
    """Raise InputError unless a number of a key of a scene is between its bounds."""
    least, largest = OF_KEYS.get(key, (number, number))
    if not least <= number <= largest:
        raise InputError(f"{name} = {shown(number)}, expected {least:g} to {largest:g}")


def check_text(name: str, text: str) -> None:
    """Raise InputError unless a text is as long as one may be."""
    if len(text) > LONGEST_TEXT:
        raise InputError(f"{name} = {shown(text)}, expected at most {LONGEST_TEXT} characters")
