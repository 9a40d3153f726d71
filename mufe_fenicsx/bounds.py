"""What is plausible: bounds of every number that enters, by its unit or its key, in one place.

They are wide, since they shall stop slips of the keyboard and values that no computation survives,
not unusual tests. What a value has to be beyond that, each class of settings says itself.
"""

import difflib
import math

from .errors import InputError

#: SI unit -> least and largest absolute value, of numbers that are not zero.
OF_UNITS = {
    "m": (1e-10, 1e4),
    "m/s": (1e-12, 1e5),
    "s": (1e-18, 1e10),
    "Pa": (1e-6, 1e15),
    "kg/m^3": (1e-3, 1e12),
    "s^-1": (1e-9, 1e18),
    "": (1e-15, 1e12),
}
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
#: Characters of a value in a message.
SHOWN = 60
#: Names count as misspelled from this ratio of :mod:`difflib` on.
SIMILAR = 0.6


def check_number(number, unit, name, value, expected):
    """Raise InputError unless a number of a unit is finite and plausible.

    Args:
        number: In SI units.
        unit: A key of :data:`OF_UNITS`.
        name: What messages call it.
        value: As it was written.
        expected: What is expected, in words.
    """
    least, largest = OF_UNITS[unit]
    if not math.isfinite(number):
        raise InputError(f"{name} = {shown(value)}, expected {expected}, finite")
    if number and not least <= abs(number) <= largest:
        raise InputError(
            f"{name} = {shown(value)}, expected {expected}, of {least:g} to {largest:g} {unit}"
            .rstrip()
        )  # fmt: skip


def check_count(number, key, name):
    """Raise InputError unless a whole number of a key of a scene is a plausible one."""
    largest = OF_KEYS.get(key, (0, LARGEST_COUNT))[1]
    if abs(number) > largest:
        raise InputError(f"{name} = {shown(number)}, expected a whole number up to {largest:g}")


def check_key(key, number, name):
    """Raise InputError unless a number of a key of a scene is between its bounds."""
    least, largest = OF_KEYS.get(key, (number, number))
    if not least <= number <= largest:
        raise InputError(f"{name} = {shown(number)}, expected {least:g} to {largest:g}")


def check_text(name, text):
    """Raise InputError unless a text is as long as one may be."""
    if len(text) > LONGEST_TEXT:
        raise InputError(f"{name} = {shown(text)}, expected at most {LONGEST_TEXT} characters")


def shown(value):
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


def nearest_name(word, known):
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


def shortened(text):
    """The beginning of a text on one line, without characters that no terminal shows."""
    text = str(text)
    cut = text if len(text) <= SHOWN else text[:SHOWN] + "…"
    return "".join(c if c.isprintable() else "?" for c in cut)
