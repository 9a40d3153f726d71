"""A scene as TOML, with every default written out."""

import dataclasses
import json
import re
from dataclasses import fields
from decimal import Decimal
from pathlib import Path

from ..arguments import checked
from ..units import keys_of
from .catalogue import MODELS
from .scene import Scene


@checked
def scene_to_toml(scene: Scene) -> str:
    """The scene as TOML with every default written out: loading it gives it back."""
    lines = [f"title = {_toml(scene.title)}"]
    for name in ("accuracy", "modulus", "gravity"):
        value = getattr(scene, name)
        lines += [] if value is None else [f"{name} = {_toml(value)}"]
    for name in ("image", "mesh", "sample", "container"):
        lines += _write_table(name, getattr(scene, name))
    lines += _write_material("material", scene.material, scene.scatter)
    for key, group in scene.materials.items():
        labels = f"labels = [{', '.join(map(str, group.labels))}]"
        lines += _write_material(f"materials.{_key(key)}", group.material, group.scatter, [labels])
    for name in ("contact", "solver", "implicit"):
        lines += _write_table(name, getattr(scene, name))
    for name, wall in scene.walls.items():
        lines += _write_table(f"walls.{name}", wall)
    tests = "oedometer", "loading", "quasi_static", "mass_scaling", "membrane"
    for name in (*tests, "fracture", "output"):
        lines += _write_table(name, getattr(scene, name))
    lists = {"tool": scene.tools, "stage": scene.stages, "reference": scene.references}
    for name, tables in lists.items():
        for table in tables:
            lines += ["", f"[[{name}]]"]
            lines += [f"{key} = {_toml(value)}" for key, value in _stated(table).items()]
    return "\n".join(lines) + "\n"


def _write_material(table, material, scatter, first_lines=()):
    model = next(name for name, cls in MODELS.items() if type(material) is cls)
    lines = _write_table(table, material, [*first_lines, f'model = "{model}"'])
    return lines + _write_table(f"{table}.scatter", scatter)


def _write_table(table, content, first_lines=()):
    if content is None:
        return []
    lines, below = ["", f"[{table}]", *first_lines], []
    for field in fields(content):
        value = getattr(content, field.name)
        if isinstance(value, dict):
            below += ["", f"[{table}.{field.name}]"]
            below += [f"{_key(name)} = {_toml(entry)}" for name, entry in value.items()]
            continue
        if value is None:
            lines.append(f"# {field.name} is not set")
            continue
        unit = keys_of(type(content))[field.name].unit
        if isinstance(unit, tuple):
            unit = ", ".join(part or "-" for part in unit)
        lines.append(f"{field.name} = {_toml(value)}" + (f"  # [{unit}]" if unit else ""))
    return lines + below


def _key(name):
    """A name as a key of TOML: bare where it can be."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _toml(name)


def _toml(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str | Path):
        # A JSON string is a TOML basic string, but for the one control it leaves bare.
        return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {_toml(v)}" for k, v in value.items()) + " }"
    if dataclasses.is_dataclass(value):
        pairs = (f"{name} = {_toml(item)}" for name, item in _stated(value).items())
        return "{ " + ", ".join(pairs) + " }"
    if isinstance(value, float) and abs(value) >= 1e5:  # 1e+11 is easier to read than its zeros
        return format(Decimal(repr(value)).normalize(), "e")
    return repr(value)


def _stated(content):
    """Fields of a dataclass that are not None, by name."""
    values = {field.name: getattr(content, field.name) for field in fields(content)}
    return {name: value for name, value in values.items() if value is not None and value != {}}
