"""What a scene file may hold, in words: its tables, and each key of them."""

import functools
import inspect
import re
import textwrap
import tomllib
from pathlib import Path

from ..container import WALLS
from ..errors import InputError, nearest_name, shown
from ..materials.scatter import Scatter
from ..units import BOUNDS, QUANTITIES, keys_of
from .catalogue import MODELS, TABLES, TOP_KEYS
from .reference import Reference
from .scene import Scene
from .stages import Stage
from .tables import Wall
from .tools import Tool


@functools.cache
def tables():
    """All tables of a scene file: dotted name -> dataclass; NAME stands for any name.

    That of [material] is the one of each model; the default one is named without it.
    """
    found = dict(TABLES)
    found |= {f'material (model = "{name}")': cls for name, cls in MODELS.items()}
    found |= {"material.scatter": Scatter, "walls.NAME": Wall, "stage": Stage}
    found["tool"] = Tool
    found["reference"] = Reference
    found["reference.columns.NAME"] = keys_of(Reference)["columns"].entries
    found |= {
        f"{table}.{key.name}.NAME": key.entries
        for table, cls in TABLES.items()
        for key in keys_of(cls).values()
        if key.entries is not None
    }
    for key in keys_of(Stage).values():
        if key.table is not None:
            found[f"stage.{key.name}"] = key.table
        elif key.entries is not None:
            found[f"stage.{key.name}.NAME"] = key.entries
    return found


def explain(wanted):
    """Lines that say what a key or a table of a scene file is.

    Args:
        wanted: Dotted name such as "oedometer.speed", a table, or a key without its table.

    Raises:
        InputError: There is none of that name.
    """
    name = re.sub(r"\[\d*\]", "", wanted.strip().strip("[]"))
    parts = name.split(".")
    if parts[0] == "materials":  # of one's own name: as [material]
        parts = ["material", *parts[2:]]
    if parts[:2] == ["contact", "pairs"] and len(parts) > 2:
        parts[2] = "NAME"
    if parts[0] == "walls" and len(parts) > 1 and parts[1] in WALLS:
        parts[1] = "NAME"
    name = ".".join(parts)
    if name in TOP_KEYS:
        return _explain_key("", keys_of(Scene)[name])
    if name in ("walls", "contact.pairs"):
        name += ".NAME"
    found = [(table, cls) for table, cls in tables().items() if _plain(table) == name]
    if found:
        return _explain_table(*found[0] if len(found) == 1 else (name, found[0][1]), found)
    lines, seen = [], set()
    for table, cls in tables().items():
        for key in keys_of(cls).values():
            full = f"{_plain(table)}.{key.name}"
            same = {(full, key.text), (cls, key.name)}
            if name in (full, key.name) and not same & seen:
                seen |= same
                lines += ([""] if lines else []) + _explain_key(table, key)
    if not lines:
        known = list(dict.fromkeys([*TOP_KEYS, *map(_plain, tables())]))
        keys = [f"{_plain(t)}.{key}" for t, cls in tables().items() for key in keys_of(cls)]
        near = nearest_name(name, known + keys)
        near = near if near in known + keys else nearest_name(name, known)
        raise InputError(f"{shown(wanted)} is not a key of a scene, expected {near}")
    return lines


def in_file(wanted, path):
    """Lines that say what a scene file has of a key or table, as it is written there.

    Args:
        wanted: As of :func:`explain`.
        path: The file, which :func:`~mufe_fenicsx.scene.load_scene` takes.
    """
    name, found = wanted.strip().strip("[]"), []

    def walk(value, full):
        if isinstance(value, dict):
            for key, inner in value.items():
                walk(inner, f"{full}.{key}" if full else key)
        elif isinstance(value, list) and value and all(isinstance(row, dict) for row in value):
            for number, row in enumerate(value):
                walk(row, f"{full}[{number}]")
        else:
            plain = re.sub(r"\[\d+\]", "", full)
            if any(f".{name}." in f".{part}." for part in (full, plain)):
                found.append(f"    {full} = {shown(value)}")

    walk(tomllib.loads(Path(path).read_text(encoding="utf-8")), "")
    return [f"{path} says:", *found] if found else [f"{path} leaves it out"]


def expectation(key):
    """What a value of a key has to be, in words."""
    if key.table is not None:
        return f"a table {{ … }}: {', '.join(keys_of(key.table))}"
    if key.entries is not None:
        keys = keys_of(key.entries)
        return f"a table of NAME = {next(iter(keys))}, or {{ … }}: {', '.join(keys)}"
    parts = []
    if key.choices:
        parts.append(" or ".join(f'"{choice}"' for choice in key.choices))
    if bool in key.kinds:
        parts.append("true or false")
    elif key.shape and float not in key.kinds:
        sizes = " x ".join("n" if size < 0 else str(size) for size in key.shape)
        parts.append(f"a list of {sizes} numbers")
    elif int in key.kinds:
        parts.append("a whole number")
    elif float in key.kinds:
        what, example = QUANTITIES[key.unit if isinstance(key.unit, str) else ""]
        parts.append(f'{what} such as "{example}", or a number in {key.unit}' if key.unit else what)
        if Path in key.kinds:
            parts += [*(f'"{word}"' for word in key.words), "a path"]
    elif Path in key.kinds:
        parts.append("a path")
    elif not key.choices:
        parts.append("a text")
    limits = " and ".join(f"{BOUNDS[word][1]} {limit:g}" for word, limit in key.limits.items())
    return ", or ".join(parts) + (f"; {limits}" if limits else "")


def first_lines(cls):
    """First paragraph of the docstring of a table."""
    text = inspect.getdoc(cls) or ""
    text = re.sub(r"^\[.*?\]+( and so on)?: ", "", text.split("\n\n")[0].replace("\n", " "))
    return text.replace("``", "").replace("`", "")


def _plain(table):
    """Name of a table without the model."""
    return table.split(" ")[0]


def _explain_table(name, cls, found):
    lines = [f"[[{name}]]" if name in ("stage", "tool", "reference") else f"[{name}]"]
    for table, member in found:
        if len(found) > 1:
            lines += ["", table]
        lines += textwrap.wrap(first_lines(member), 92, initial_indent="    ",
                               subsequent_indent="    ")  # fmt: skip
        width = max(map(len, keys_of(member)))
        for key in keys_of(member).values():
            lines.append(f"    {key.name:{width}}  {key.text or expectation(key)}")
    return lines


def _explain_key(table, key):
    where = _plain(table)
    if key.required:
        default = "has to be given"
    elif key.default in (None, "", {}):
        default = "left out: not set"
    else:
        shown = str(key.default).lower() if isinstance(key.default, bool) else key.default
        default = f"left out: {shown}"
    having = [name for name, cls in MODELS.items() if key.name in keys_of(cls)]
    only = where == "material" and len(having) < len(MODELS)
    return [
        f"{where}.{key.name}".lstrip(".") + (f"  (model = {' or '.join(having)})" if only else ""),
        f"    {key.text}",
        f"    {expectation(key)}",
        f"    {default}",
    ]
