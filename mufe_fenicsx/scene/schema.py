"""The JSON schema of a scene file, for editors that complete and check TOML (Taplo, tombi)."""

import json
from dataclasses import MISSING
from pathlib import Path
from urllib.parse import unquote

from ..container import WALLS
from ..errors import shown
from ..materials.scatter import Scatter
from ..units import QUANTITIES, keys_of
from .catalogue import MODELS, TABLES, TOP_KEYS
from .explanations import expectation, first_lines
from .reference import Reference
from .scene import Scene
from .stages import Stage
from .tables import Wall
from .tools import Tool

#: Of numbers that are written as texts: a number, and a unit where there is one.
NUMBER = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
WITH_UNIT, WITHOUT = rf"^\s*{NUMBER}\s*[^\d\s].*$", rf"^\s*{NUMBER}\s*$"


def scene_schema() -> dict:
    """JSON schema (draft 7) of a scene file, as a dict."""
    properties = {name: _value(keys_of(Scene)[name]) for name in TOP_KEYS}
    properties |= {name: _table(cls) for name, cls in TABLES.items()}
    properties["material"] = _material(inherits=False)
    properties["materials"] = {
        "type": "object",
        "description": "Grains of other materials; keys left out are those of [material].",
        "additionalProperties": _material(inherits=True),
    }
    properties["walls"] = {
        "type": "object",
        "description": first_lines(Wall),
        "properties": {name: _table(Wall) for name in WALLS},
        "additionalProperties": False,
    }
    properties["stage"] = {"type": "array", "minItems": 1, "items": _table(Stage)}
    properties["tool"] = {"type": "array", "items": _table(Tool)}
    properties["reference"] = {"type": "array", "items": _table(Reference)}
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "Scene of mufe",
        "type": "object",
        "properties": properties,
        "required": ["material", "contact"],
        "oneOf": [
            {
                "required": ["oedometer"],
                "not": {"anyOf": [{"required": ["loading"]}, {"required": ["stage"]}]},
            },
            {"required": ["loading", "stage"], "not": {"required": ["oedometer"]}},
        ],
        "additionalProperties": False,
    }


def schema_text() -> str:
    """The same as JSON."""
    return json.dumps(scene_schema(), indent=1, ensure_ascii=False) + "\n"


def absent_schema(path: Path) -> str | None:
    """A line on the schema that a scene file names and that is not there, or None."""
    first = path.read_text(encoding="utf-8").partition("\n")[0].strip()
    named = first.removeprefix("#:schema ")
    if named == first or named.startswith(("http:", "https:")):
        return None
    there = path.parent / unquote(named.removeprefix("file://"))
    if there.is_file():
        return None
    new = path.parent / "scene.schema.json"
    return (
        f"schema {shown(named)} of {path} is not there, so that editors complete no keys: "
        f"`mufe scene --schema -o {new}`, and ./{new.name} in the first line"
    )


def _table(cls):
    keys = keys_of(cls)
    found = {
        "type": "object",
        "description": first_lines(cls),
        "properties": {name: _value(key) for name, key in keys.items()},
        "additionalProperties": False,
    }
    required = [name for name, key in keys.items() if key.required]
    return found | ({"required": required} if required else {})


def _material(inherits):
    """[material], or a table of [materials], which takes from it what it does not state."""
    properties = {
        "model": {"enum": list(MODELS), "default": "j2", "description": "The law of the material."},
        "scatter": _table(Scatter),
    }
    if inherits:
        properties["labels"] = {
            "type": "array",
            "items": {"type": "integer", "minimum": 0},
            "minItems": 1,
            "description": "Labels of these grains.",
        }
    always, branches = list(properties), []
    for name, cls in MODELS.items():
        keys = keys_of(cls)
        for key in keys.values():
            properties.setdefault(key.name, _value(key))
        has = {"properties": {"model": {"const": name}}}
        # Without a model it is the first one, or that of [material].
        has |= {} if name == "j2" and not inherits else {"required": ["model"]}
        then = {"propertyNames": {"enum": [*always, *keys]}}
        if not inherits:
            then["required"] = [key.name for key in keys.values() if key.required]
        branches.append({"if": has, "then": then})
    found = {
        "type": "object",
        "description": "Elasticity, density, and plastic flow.",
        "properties": properties,
        "additionalProperties": False,
        "allOf": branches,
    }
    return found | ({"required": ["labels"]} if inherits else {})


def _value(key):
    """Schema of the value of one key."""
    if key.table is not None:
        return _table(key.table) | {"description": key.text}
    if key.entries is not None:
        alone = _value(next(iter(keys_of(key.entries).values())))
        entry = {"anyOf": [*alone.pop("anyOf", [alone]), _table(key.entries)]}
        return {"type": "object", "description": key.text, "additionalProperties": entry}
    found = _type(key)
    found["description"] = f"{key.text}\n{expectation(key)}"
    if key.default not in (MISSING, None, "") and not isinstance(key.default, Path | tuple):
        found["default"] = key.default
    return found


def _type(key):
    kinds, options = key.kinds, []
    if key.shape:
        options.append(_array(key.shape, key))
    if float in kinds:
        options += _number(key.unit if isinstance(key.unit, str) else "", key.bounds)
    if bool in kinds:
        options.append({"type": "boolean"})
    elif int in kinds:
        options.append({"type": "integer", **key.bounds})
    if key.choices:
        options.append({"enum": list(key.choices)})
    elif str in kinds and float in kinds:  # a method or a number: its class lists the methods
        options = [{"type": ["number", "string"]}]
    elif str in kinds or Path in kinds:
        options.append({"type": "string"})
    return dict(options[0]) if len(options) == 1 else {"anyOf": options}


def _number(unit, bounds):
    return [
        {"type": "number", **bounds},
        {
            "type": "string",
            "pattern": WITH_UNIT if unit else WITHOUT,
            "examples": [QUANTITIES[unit][1]],
        },
    ]


def _array(shape, key):
    size = {} if shape[0] < 0 else {"minItems": shape[0], "maxItems": shape[0]}
    if len(shape) > 1:
        return {"type": "array", "items": _array(shape[1:], key), **size}
    if not key.unit:
        return {"type": "array", "items": {"type": "integer", "minimum": 0}, **size}
    return {"type": "array", "items": [{"anyOf": _number(unit, {})} for unit in key.units], **size}
