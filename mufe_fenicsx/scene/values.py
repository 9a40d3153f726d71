"""Untyped values of a table, checked, converted to SI and put into its dataclass."""

import os
from dataclasses import fields
from pathlib import Path

from ..errors import InputError, nearest_name, shortened, shown
from ..materials.j2 import J2
from ..units import expected, keys_of, to_si
from .bounds import LARGEST_COUNT, check_count, check_plausible, check_text
from .catalogue import TABLES
from .image import PACKAGED_IMAGES
from .shipped import SHIPPED, shipped_mesh

#: Characters of a path.
LONGEST_PATH = 4000


def build(cls, values, name, folder=None):
    """An instance of a dataclass from untyped values, each checked and converted to SI.

    Args:
        cls: One of the classes in `TABLES`, `MODELS`, or `Wall` or `SegmentSettings`.
        values: Mapping of field to value, as TOML gives it.
        name: Function that turns the name of a field into how messages call it.
        folder: What relative paths are relative to; None: the current folder.

    Raises:
        InputError: an unknown or missing key, a wrong type or unit, a value out of range.
    """
    known = keys_of(cls)
    for key in values:
        if key not in known:
            raise InputError(unknown_key(name(key), shown(values[key]), key, list(known), name))
    for key in known.values():
        if key.required and key.name not in values:
            raise InputError(f"{name(key.name)} is missing, expected {_expected(key)}")
    converted = {
        key: convert(value, known[key], name(key), folder) for key, value in values.items()
    }
    try:
        built = cls(**converted)
    except InputError as error:  # these begin with the name of the field
        raise InputError(name(_with_default(str(error), known, converted))) from None
    for key, value in converted.items():
        if isinstance(value, int | float) and not isinstance(value, bool):
            check_plausible(value, known[key].plausible, name(key))
    return built


def _with_default(message, known, given):
    """A message `key = value, expected …` that says where the value is not one of the scene."""
    key, equals, rest = message.partition(" = ")
    if equals and key in known and key not in given:
        return f"{key} = " + rest.replace(", expected", " (the default), expected", 1)
    return message


#: Keys of earlier versions, and what stands in their place.
DELETED = {
    "mesh.angle": 'none: mesh.sizing = "contact" makes edges shorter near other grains',
    "implicit.gap_tolerance": "none: layers of contact stay, and match the mesh",
    "implicit.max_augmentations": "none: layers of contact stay, and match the mesh",
}


def unknown_key(full_name, value, key, known, name):
    """Message for an unknown key: one like it, the same of another table, or all there are."""
    if full_name in DELETED:
        return f"{full_name} = {value} is no key any more, expected {DELETED[full_name]}"
    elsewhere = [
        f"{table}.{key}"
        for table, cls in {**TABLES, "material": J2}.items()
        if any(field.name == key for field in fields(cls)) and f"{table}.{key}" != full_name
    ]
    nearest = nearest_name(key, known)
    if nearest in known:
        nearest = name(nearest)
    elif elsewhere:
        nearest = elsewhere[0]
    return f"{shortened(full_name)} = {value} is not a known key, expected {nearest}"


def _expected(key):
    if float in key.kinds:
        return expected(key.unit)
    if Path in key.kinds:
        return "a path"
    if isinstance(key.unit, tuple):
        return "a list of [number, value] pairs"
    return {int: "a whole number", bool: "true or false", str: "a text"}[key.hint]


def convert(value, key, name, folder):
    """A value of the type that a key declares, in SI units."""
    kinds = key.kinds
    if key.entries is not None:
        return _convert_entries(value, key.entries, name)
    if key.shape and (float not in kinds or isinstance(value, list | tuple)):
        return convert_array(value, key, name)
    if Path in kinds and (float not in kinds or isinstance(value, str | Path)):
        return value if value in key.words else _convert_path(value, name, folder)
    if isinstance(value, str):
        check_text(name, value)
    if key.table is not None:
        if not isinstance(value, dict):
            raise InputError(f"{name} = {shown(value)}, expected a table like {{ … }}")
        return build(key.table, value, lambda inner: f"{name}.{inner}", folder)
    if float in kinds and not (str in kinds and isinstance(value, str)):
        return to_si(value, key.unit, name)
    if int in kinds and (isinstance(value, bool) or not isinstance(value, int)):
        raise InputError(f"{name} = {shown(value)}, expected a whole number")
    if bool in kinds and not isinstance(value, bool):
        raise InputError(f"{name} = {shown(value)}, expected true or false")
    if str in kinds and not isinstance(value, str):
        raise InputError(f"{name} = {shown(value)}, expected a text")
    if isinstance(value, int):
        check_count(value, key.plausible[1] if key.plausible else LARGEST_COUNT, name)
    return value


def _convert_entries(table, cls, name):
    """A table with names of one's own: each a table, or the first of its values alone."""
    if not isinstance(table, dict):
        raise InputError(f"{name} = {shown(table)}, expected a table [{name}]")
    first, found = fields(cls)[0].name, {}
    for key, value in table.items():
        check_text(name, key)
        entry = f"{name}.{shortened(key)}"
        if isinstance(value, dict):
            found[key] = build(cls, value, lambda inner, entry=entry: f"{entry}.{inner}")
        else:  # what is said of that value is said of the entry
            found[key] = build(
                cls, {first: value}, lambda inner, entry=entry: entry + inner.removeprefix(first)
            )
    return found


def convert_array(value, key, name):
    """A list of numbers, or of such lists, as tuples in SI units.

    Args:
        value: As TOML gives it.
        key: Its `Key`. Without a unit its numbers are whole and >= 0.
        name: What messages call it.

    Raises:
        InputError: it has another shape, or an item is no such number.
    """
    return _tuple_of(value, key.shape, key, name)


def _tuple_of(value, shape, key, name):
    sizes = " x ".join("n" if size < 0 else str(size) for size in shape)
    if not isinstance(value, list | tuple) or shape[0] not in (-1, len(value)):
        meant = f" ({key.form})" if key.form else ""
        raise InputError(f"{name} = {shown(value)}, expected a list of {sizes} numbers{meant}")
    if len(shape) > 1:
        return tuple(_tuple_of(row, shape[1:], key, f"{name}[{i}]") for i, row in enumerate(value))
    if not key.unit:
        for i, item in enumerate(value):
            if isinstance(item, bool) or not isinstance(item, int) or item < 0:
                raise InputError(f"{name}[{i}] = {shown(item)}, expected a whole number >= 0")
            check_count(item, LARGEST_COUNT, f"{name}[{i}]")
        return tuple(value)
    return tuple(
        to_si(item, unit, f"{name}[{i}]")
        for i, (item, unit) in enumerate(zip(value, key.units, strict=True))
    )


def _convert_path(value, name, folder):
    if not isinstance(value, str | Path) or not str(value):
        raise InputError(f"{name} = {shown(value)}, expected a path")
    if str(value) in PACKAGED_IMAGES:
        return str(value)
    if str(value).startswith(SHIPPED):
        return shipped_mesh(str(value), name)
    if "\0" in str(value) or len(str(value)) > LONGEST_PATH:
        raise InputError(f"{name} = {shown(str(value))}, expected a path")
    try:
        path = Path(value).expanduser()
    except RuntimeError:  # nobody of that name
        raise InputError(
            f"{name} = {shown(str(value))}, expected a path, or ~ with the name of a user"
        ) from None
    if folder is None or path.is_absolute():
        return path
    path = Path(os.path.normpath(folder / path))
    if not path.is_relative_to(folder):
        raise InputError(
            f"{name} = {shown(str(value))} leaves the folder of the scene, expected a path in "
            f"{folder} or an absolute one"
        )
    return path
