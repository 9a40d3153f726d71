"""Scene files: TOML to the dataclasses of `scene` and back."""

import dataclasses
import difflib
import json
import os
import re
import tomllib
import types
import typing
from dataclasses import MISSING, fields
from decimal import Decimal
from pathlib import Path

from .errors import InputError
from .geometry.settings import MeshSettings, SegmentSettings
from .materials.auto import Auto
from .materials.elastic import Elastic
from .materials.j2 import J2
from .materials.rigid import Rigid
from .materials.scatter import SCATTERED, Scatter
from .scene import (
    PACKAGED_IMAGES,
    WALLS,
    Contact,
    Group,
    ImageSettings,
    Implicit,
    Loading,
    MassScaling,
    Oedometer,
    Output,
    QuasiStatic,
    Sample,
    Scene,
    Solver,
    Stage,
    Wall,
)
from .scene_loading import Axis, Until
from .units import expected, shown, to_si

MODELS = {"j2": J2, "elastic": Elastic, "rigid": Rigid, "auto": Auto}

#: Table of the file -> its class; [material], [walls.*] and [[stage]] are read apart.
TABLES = {
    "image": ImageSettings,
    "mesh": MeshSettings,
    "sample": Sample,
    "contact": Contact,
    "solver": Solver,
    "implicit": Implicit,
    "oedometer": Oedometer,
    "loading": Loading,
    "quasi_static": QuasiStatic,
    "mass_scaling": MassScaling,
    "output": Output,
}

_IMAGE_UNITS = {"voxel_size": "m"}
_ELASTIC_UNITS = {"E": "Pa", "rho": "kg/m^3"}

#: Units of the fields that have one.
UNITS = {
    SegmentSettings: _IMAGE_UNITS,
    ImageSettings: _IMAGE_UNITS,
    MeshSettings: {
        **dict.fromkeys(("size", "smallest_size", "contact_reach", "voxel_size", "scale"), "m"),
        "time_limit": "s",
    },
    Elastic: _ELASTIC_UNITS,
    Rigid: _ELASTIC_UNITS,
    J2: {**_ELASTIC_UNITS, "yield_stress": ("", "Pa")},
    Auto: {**_ELASTIC_UNITS, "yield_stress": ("", "Pa")},
    Sample: {"close_gaps": "m"},
    Solver: {"damping": "s^-1"},
    Output: {"checkpoint": "s"},
    MassScaling: {"time_step": "s"},
    Wall: {"velocity": "m/s", "stress": "Pa", "speed": "m/s"},
    QuasiStatic: {"slowest": "m/s", "fastest": "m/s"},
    Loading: {"speed": "m/s"},
    Stage: {"hold": "s"},
    Axis: {"stress": "Pa", "speed": "m/s"},
    Until: {
        **dict.fromkeys(("stress_x", "stress_y", "stress_z", "mean_stress", "deviator"), "Pa"),
        "time": "s",
    },
    Oedometer: {"speed": "m/s", "seating_stress": "Pa", "seating_speed": "m/s"},
}

#: Shapes of the fields that are arrays; -1 is any length.
SHAPES = {
    "shape": (3,),
    "voxel_size": (3,),
    "crop": (3, 2),
    "yield_stress": (-1, 2),
    "labels": (-1,),
}
#: Those of them that hold numbers with a fraction; a single number is no array of `voxel_size`.
FLOAT_ARRAYS = ("yield_stress", "voxel_size")


def register_material(name, cls, units=None):
    """Let scene files say ``material.model = name`` for a material of one's own.

    Args:
        name: Its name in scene files.
        cls: A frozen dataclass derived from :class:`~.materials.elastic.IsotropicSolid`.
        units: Units of its fields beyond E, nu and rho, e.g. ``{"cohesion": "Pa"}``.

    Raises:
        InputError: The name is taken.
    """
    if MODELS.get(name, cls) is not cls:
        raise InputError(f'material "{name}" is registered, expected a new name')
    MODELS[name] = cls
    UNITS[cls] = {**_ELASTIC_UNITS, **(units or {})}


def read_scene(path) -> Scene:
    """Read a scene file; see `scene.load_scene`."""
    path = Path(path)
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"scene {path}: {error.strerror}, expected a TOML file") from error
    except UnicodeDecodeError as error:
        raise InputError(f"scene {path} is not UTF-8 text, expected a TOML file") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"scene {path} is not valid TOML: {error}") from error

    known = ["title", "accuracy", *TABLES, "material", "materials", "walls", "stage"]
    _check_keys(tables, known, "")
    folder = path.resolve().parent
    test = () if "loading" in tables else ("oedometer",)
    for name in ("material", "contact", *test):
        if name not in tables:
            raise InputError(f"[{name}] is missing in scene {path}, expected this table")
    title = tables.get("title", "")
    if not isinstance(title, str):
        raise InputError(f"title = {shown(title)}, expected a text")
    parts = {
        name: build(cls, _table(tables, name), lambda key, name=name: f"{name}.{key}", folder)
        for name, cls in TABLES.items()
        if name in tables
    }
    walls = _table(tables, "walls")
    _check_keys(walls, WALLS, "walls.")
    common = _table(tables, "material")
    material, scatter = _read_material(common)
    accuracy = tables.get("accuracy")
    return Scene(
        title=title,
        accuracy=None if accuracy is None else to_si(accuracy, "", "accuracy"),
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
        stages=_read_stages(tables.get("stage", [])),
        **parts,
    )


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
    hints = typing.get_type_hints(cls)
    known = [field.name for field in fields(cls)]
    for key in values:
        if key not in known:
            raise InputError(_unknown(name(key), shown(values[key]), key, known, name))
    for field in fields(cls):
        required = field.default is MISSING and field.default_factory is MISSING
        if required and field.name not in values:
            wanted = _expected(hints[field.name], _unit(cls, field.name))
            raise InputError(f"{name(field.name)} is missing, expected {wanted}")
    converted = {
        key: _convert(value, hints[key], _unit(cls, key), key, name(key), folder)
        for key, value in values.items()
    }
    try:
        return cls(**converted)
    except InputError as error:  # these begin with the name of the field
        raise InputError(name(str(error))) from None


def write_scene(scene) -> str:
    """A scene as TOML; see `scene.scene_to_toml`."""
    lines = [f"title = {_toml(scene.title)}"]
    lines += [] if scene.accuracy is None else [f"accuracy = {_toml(scene.accuracy)}"]
    for name in ("image", "mesh", "sample"):
        lines += _write_table(name, getattr(scene, name))
    lines += _write_material("material", scene.material, scene.scatter)
    for key, group in scene.materials.items():
        labels = f"labels = [{', '.join(map(str, group.labels))}]"
        lines += _write_material(f"materials.{_key(key)}", group.material, group.scatter, [labels])
    for name in ("contact", "solver", "implicit"):
        lines += _write_table(name, getattr(scene, name))
    for wall in WALLS:
        lines += _write_table(f"walls.{wall}", scene.walls[wall])
    for name in ("oedometer", "loading", "quasi_static", "mass_scaling", "output"):
        lines += _write_table(name, getattr(scene, name))
    for stage in scene.stages:
        lines += ["", "[[stage]]"]
        lines += [f"{key} = {_toml(value)}" for key, value in _stated(stage).items()]
    return "\n".join(lines) + "\n"


def _read_stages(tables):
    """The tables [[stage]], in their order."""
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise InputError(f"stage = {shown(tables)}, expected tables [[stage]]")
    return tuple(
        build(Stage, table, lambda key, number=number: f"stage[{number}].{key}")
        for number, table in enumerate(tables, start=1)
    )


def _stated(content):
    """Fields of a dataclass that are not None, by name."""
    values = {field.name: getattr(content, field.name) for field in fields(content)}
    return {name: value for name, value in values.items() if value is not None}


def _read_groups(tables, common):
    """The tables [materials.NAME]: keys that they leave out are those of [material]."""
    groups = {}
    for key in tables:
        prefix = f"materials.{key}"
        values = dict(_table(tables, key, prefix))
        labels = values.pop("labels", None)
        if labels is None:
            raise InputError(f"{prefix}.labels is missing, expected a list of labels")
        labels = _convert_array(labels, SHAPES["labels"], ("",), int, f"{prefix}.labels")
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
            raise InputError(_unknown(name(key), shown(values[key]), key, known, name))
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
                _unknown(f"{prefix}{key}", value, key, known, lambda near: f"{prefix}{near}")
            )


def _unknown(full_name, value, key, known, name):
    """Message for an unknown key: the nearest of its table, or the same key of another one."""
    elsewhere = [
        f"{table}.{key}"
        for table, cls in {**TABLES, "material": J2}.items()
        if any(field.name == key for field in fields(cls)) and f"{table}.{key}" != full_name
    ]
    close = difflib.get_close_matches(key, known, n=1, cutoff=0.6)
    if elsewhere and not close:
        nearest = elsewhere[0]
    else:
        nearest = name((close or difflib.get_close_matches(key, known, n=1, cutoff=0.0))[0])
    return f"{full_name} = {value} is not a known key, expected {nearest}"


def _unit(cls, key):
    return UNITS.get(cls, {}).get(key, "")


def _expected(hint, unit):
    if hint is float:
        return expected(unit)
    if hint is Path or Path in typing.get_args(hint):
        return "a path"
    if isinstance(unit, tuple):
        return "a list of [number, value] pairs"
    return {int: "a whole number", bool: "true or false", str: "a text"}[hint]


def _convert(value, hint, unit, key, name, folder):
    """A value of the type that a field declares, in SI units."""
    kinds = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    if key in SHAPES and (float not in kinds or isinstance(value, list | tuple)):
        if isinstance(unit, str):
            unit = (unit,) * SHAPES[key][-1]
        return _convert_array(value, SHAPES[key], unit, float if key in FLOAT_ARRAYS else int, name)
    if Path in kinds:
        return _convert_path(value, name, folder)
    for kind in kinds:
        if dataclasses.is_dataclass(kind):
            if not isinstance(value, dict):
                raise InputError(f"{name} = {shown(value)}, expected a table like {{ … }}")
            return build(kind, value, lambda inner: f"{name}.{inner}", folder)
    if float in kinds and not (str in kinds and isinstance(value, str)):
        return to_si(value, unit, name)
    if int in kinds and (isinstance(value, bool) or not isinstance(value, int)):
        raise InputError(f"{name} = {shown(value)}, expected a whole number")
    if bool in kinds and not isinstance(value, bool):
        raise InputError(f"{name} = {shown(value)}, expected true or false")
    if str in kinds and not isinstance(value, str):
        raise InputError(f"{name} = {shown(value)}, expected a text")
    return value


def _convert_array(value, shape, units, kind, name):
    sizes = " x ".join("n" if size < 0 else str(size) for size in shape)
    if not isinstance(value, list | tuple) or shape[0] not in (-1, len(value)):
        raise InputError(f"{name} = {shown(value)}, expected a list of {sizes} numbers")
    if len(shape) > 1:
        return tuple(
            _convert_array(row, shape[1:], units, kind, f"{name}[{i}]")
            for i, row in enumerate(value)
        )
    if kind is int:
        for i, item in enumerate(value):
            if isinstance(item, bool) or not isinstance(item, int) or item < 0:
                raise InputError(f"{name}[{i}] = {shown(item)}, expected a whole number >= 0")
        return tuple(value)
    return tuple(
        to_si(item, unit, f"{name}[{i}]")
        for i, (item, unit) in enumerate(zip(value, units, strict=True))
    )


def _convert_path(value, name, folder):
    if not isinstance(value, str | Path) or not str(value):
        raise InputError(f"{name} = {shown(value)}, expected a path")
    if str(value) in PACKAGED_IMAGES:
        return str(value)
    path = Path(value).expanduser()
    if folder is None or path.is_absolute():
        return path
    path = Path(os.path.normpath(folder / path))
    if not path.is_relative_to(folder):
        raise InputError(
            f"{name} = {shown(str(value))} leaves the folder of the scene, expected a path in "
            f"{folder} or an absolute one"
        )
    return path


def _write_material(table, material, scatter, first_lines=()):
    model = next(name for name, cls in MODELS.items() if type(material) is cls)
    lines = _write_table(table, material, [*first_lines, f'model = "{model}"'])
    return lines + _write_table(f"{table}.scatter", scatter)


def _write_table(table, content, first_lines=()):
    if content is None:
        return []
    lines = ["", f"[{table}]", *first_lines]
    for field in fields(content):
        value = getattr(content, field.name)
        if value is None:
            lines.append(f"# {field.name} is not set")
            continue
        unit = _unit(type(content), field.name)
        if isinstance(unit, tuple):
            unit = ", ".join(part or "-" for part in unit)
        lines.append(f"{field.name} = {_toml(value)}" + (f"  # [{unit}]" if unit else ""))
    return lines


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
    if dataclasses.is_dataclass(value):
        pairs = (f"{name} = {_toml(item)}" for name, item in _stated(value).items())
        return "{ " + ", ".join(pairs) + " }"
    if isinstance(value, float) and abs(value) >= 1e5:  # 1e+11 is easier to read than its zeros
        return format(Decimal(repr(value)).normalize(), "e")
    return repr(value)
