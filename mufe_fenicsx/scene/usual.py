"""Values that may be meant, but hardly are: a scene with E = 70 runs, and is told."""

from dataclasses import fields, is_dataclass

from ..units import keys_of, with_unit


def unusual(settings, name=""):
    """A line for each number that lies outside of what its key calls usual.

    Args:
        settings: A scene, or a table of one.
        name: Its name in lines, "" of the scene.
    """
    lines = []
    for item in fields(settings):
        value = getattr(settings, item.name)
        for key, part in _parts(f"{name}.{item.name}" if name else item.name, value):
            if is_dataclass(part):
                lines += unusual(part, key)
            elif "key" in item.metadata and (usual := keys_of(type(settings))[item.name]).usual:
                lines += _line(key, part, usual)
    return lines


def _parts(name, value):
    """A value, or those of a table or list, each with its name."""
    if isinstance(value, dict):
        return [(f"{name}.{key}", part) for key, part in value.items()]
    if isinstance(value, tuple | list):
        return [(f"{name}[{number}]", part) for number, part in enumerate(value, start=1)]
    return [(name, value)]


def _line(name, value, key):
    low, high = key.usual
    if not isinstance(value, int | float) or value == 0 or low <= abs(value) <= high:
        return []
    usual = " to ".join(with_unit(limit, key.unit) for limit in key.usual)
    return [f"{name} = {with_unit(value, key.unit)}, usual is {usual}: has a unit been left out?"]
