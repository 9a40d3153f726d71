"""A scene from its TOML file."""

import tomllib
from dataclasses import fields
from pathlib import Path

from ..arguments import checked
from ..container import WALLS
from ..errors import InputError, shortened, shown
from ..materials.j2 import J2
from ..materials.scatter import SCATTERED, Scatter
from ..units import keys_of
from .bounds import check_text
from .catalogue import MODELS, TABLES, TOP_KEYS
from .reference import Reference
from .scene import Scene
from .stages import Stage
from .tables import Group, Wall
from .tools import Tool
from .values import build, convert, convert_array, unknown_key

#: Bytes of a scene file.
LARGEST = 10_000_000


@checked
def load_scene(path: str | Path, changes: dict[str, str] | None = None) -> Scene:
    """Read a scene file. Relative paths in it stay in its folder; absolute ones lead anywhere.

    Args:
        path: The file.
        changes: Texts of values to put in place of the file's, by dotted key: "loading.speed",
            "stage.2.hold". What is no value of TOML is a text.

    Raises:
        InputError: not TOML, an unknown or missing key, a wrong type or unit, or a
            value that is not physical; the message names the dotted key.
    """
    path = Path(path)
    tables = _read_tables(path)
    for key, text in (changes or {}).items():
        _put(tables, key, text)

    known = [*TOP_KEYS, *TABLES, "material", "materials", "walls", "stage", "tool", "reference"]
    _check_keys(tables, known, "")
    folder = path.resolve().parent
    test = () if "loading" in tables else ("oedometer",)
    for name in ("material", "contact", *test):
        if name not in tables:
            raise InputError(f"[{name}] is missing in scene {path}, expected this table")
    title = tables.get("title", "")
    if not isinstance(title, str):
        raise InputError(f"title = {shown(title)}, expected a text")
    check_text("title", title)
    parts = {
        name: build(cls, _table(tables, name), lambda key, name=name: f"{name}.{key}", folder)
        for name, cls in TABLES.items()
        if name in tables
    }
    walls = _table(tables, "walls")
    _check_keys(walls, WALLS, "walls.")
    common = _table(tables, "material")
    material, scatter = _read_material(common)
    return Scene(
        title=title,
        accuracy=_top_value(tables, "accuracy", folder),
        modulus=_top_value(tables, "modulus", folder),
        gravity=_top_value(tables, "gravity", folder),
        material=material,
        scatter=scatter,
        materials=_read_groups(_table(tables, "materials"), common),
        walls={
            wall: build(
                Wall,
                _table(walls, wall, f"walls.{wall}"),
                lambda key, wall=wall: f"walls.{wall}.{key}",
            )
            for wall in walls
        },
        stages=_read_each(Stage, tables.get("stage", []), "stage", folder),
        tools=_read_each(Tool, tables.get("tool", []), "tool", folder),
        references=_read_each(Reference, tables.get("reference", []), "reference", folder),
        **parts,
    )


def _put(tables, dotted, text):
    """Put the value that a text says at a dotted key; tables of lists count from 1."""
    *names, key = dotted.split(".")
    at = tables
    for number, name in enumerate(names):
        so_far, expected = ".".join(names[: number + 1]), ""
        if isinstance(at, list):
            rows = ".".join(names[:number])
            expected = f", expected {rows}.1 to {rows}.{len(at)}"
            index = int(name) if name.isdecimal() else 0
            at = at[index - 1] if 1 <= index <= len(at) else None
        else:
            at = at.setdefault(name, {})
        if not isinstance(at, dict | list):
            raise InputError(f"{so_far} is no table of the scene{expected}")
    if isinstance(at, list):
        raise InputError(f"{dotted}, expected {'.'.join(names)}.1.{key} or another number")
    try:
        at[key] = tomllib.loads(f"value = {text}")["value"]
    except ValueError:
        at[key] = text


def _top_value(tables, name, folder):
    """Value of a key outside of all tables; None where it is left out."""
    if name not in tables:
        return None
    return convert(tables[name], keys_of(Scene)[name], name, folder)


def _read_tables(path):
    """Tables of a TOML file."""
    try:
        if path.exists() and not path.is_file():  # a pipe would be waited for
            raise InputError(f"scene {path} is no file, expected a TOML file")
        if path.stat().st_size > LARGEST:
            raise InputError(
                f"scene {path} has {path.stat().st_size} bytes, expected a TOML file of at most "
                f"{LARGEST}"
            )
        # With or without the byte order mark that editors of Windows put first.
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"scene {path}: {error.strerror}, expected a TOML file") from error
    except UnicodeDecodeError as error:
        raise InputError(f"scene {path} is not UTF-8 text, expected a TOML file") from error
    except tomllib.TOMLDecodeError as error:
        text = shortened(error) if len(str(error)) > 200 else error
        raise InputError(f"scene {path} is not valid TOML: {text}") from error
    except RecursionError:
        raise InputError(f"scene {path} is nested too deep, expected a scene") from None
    except InputError:
        raise
    except ValueError as error:  # a number of thousands of digits
        raise InputError(f"scene {path} is not valid TOML: {shortened(error)}") from error


def _read_each(cls, tables, name, folder=None):
    """The tables [[name]], in their order."""
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise InputError(f"{name} = {shown(tables)}, expected tables [[{name}]]")
    return tuple(
        build(cls, table, lambda key, number=number: f"{name}[{number}].{key}", folder)
        for number, table in enumerate(tables, start=1)
    )


def _read_groups(tables, common):
    """The tables [materials.NAME]: keys that they leave out are those of [material]."""
    groups = {}
    for key in tables:
        prefix = f"materials.{shortened(key)}"
        values = dict(_table(tables, key, prefix))
        labels = values.pop("labels", None)
        if labels is None:
            raise InputError(f"{prefix}.labels is missing, expected a list of labels")
        labels = convert_array(labels, keys_of(Group)["labels"], f"{prefix}.labels")
        model = values.get("model", common.get("model", "j2"))
        cls = MODELS.get(model if isinstance(model, str) else None, J2)
        known = [field.name for field in fields(cls)] + ["model"]
        inherited = {k: v for k, v in common.items() if k in known}
        if isinstance(common.get("scatter"), dict):
            lacking = [k for k, name in SCATTERED.items() if name not in known]
            inherited["scatter"] = {k: v for k, v in common["scatter"].items() if k not in lacking}
        try:
            groups[key] = Group(labels, *_read_material(inherited | values, prefix))
        except InputError as error:
            message = str(error)
            raise InputError(
                message if message.startswith(prefix) else f"{prefix}.{message}"
            ) from None
    return groups


def _read_material(values, prefix="material"):
    """Material and how it scatters, or None, of a table."""

    def name(key):
        return f"{prefix}.{key}"

    values = dict(values)
    model = values.pop("model", "j2")
    if not isinstance(model, str) or model not in MODELS:
        choices = " or ".join(f'"{choice}"' for choice in MODELS)
        raise InputError(f"{prefix}.model = {shown(model)}, expected {choices}")
    cls = MODELS[model]
    scatter = values.pop("scatter", None)
    known = ["model", "scatter", *(field.name for field in fields(cls))]
    for key in values:
        if key == "yield_stress" and model in ("elastic", "rigid"):
            raise InputError(f'{prefix}.yield_stress is given, expected none for model = "{model}"')
        if key not in known:
            raise InputError(unknown_key(name(key), shown(values[key]), key, known, name))
    material = build(cls, values, name)
    if scatter is None:
        return material, None
    if not isinstance(scatter, dict):
        raise InputError(f"{prefix}.scatter = {shown(scatter)}, expected a table")
    scatter = {**scatter}
    built = build(Scatter, scatter, lambda key: f"{prefix}.scatter.{key}")
    try:
        built.of(material, 0)
    except InputError as error:
        raise InputError(f"{prefix}.scatter.{error}") from None
    return material, built


def _table(tables, key, name=None):
    table = tables.get(key, {})
    if not isinstance(table, dict):
        raise InputError(f"{name or key} = {shown(table)}, expected a table [{name or key}]")
    return table


def _check_keys(table, known, prefix):
    for key, value in table.items():
        if key not in known:
            value = "a table" if isinstance(value, dict) else shown(value)
            raise InputError(
                unknown_key(f"{prefix}{key}", value, key, known, lambda near: f"{prefix}{near}")
            )
