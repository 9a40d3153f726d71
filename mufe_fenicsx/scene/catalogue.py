"""What scene files name: their tables, the models of [material], units and shapes of values."""

from typing import Any

from ..errors import InputError
from ..geometry.settings import MASKS, MeshSettings, SegmentSettings
from ..materials.auto import Auto
from ..materials.elastic import Elastic, IsotropicSolid
from ..materials.j2 import J2
from ..materials.rigid import Rigid
from .image import ImageSettings
from .implicit import Implicit
from .stages import Axis, Loading, Stage, Until
from .tables import Contact, MassScaling, Oedometer, Output, QuasiStatic, Sample, Solver, Wall

MODELS = {"j2": J2, "elastic": Elastic, "rigid": Rigid, "auto": Auto}

#: Keys outside of all tables, fields of `scene.Scene`.
TOP_KEYS = ("title", "accuracy")

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
UNITS: dict[type, dict[str, Any]] = {
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

#: Texts that a field whose others are paths may have as well.
WORDS = {"mask": MASKS}

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


def register_material(
    name: str, cls: type[IsotropicSolid], units: dict[str, str] | None = None
) -> None:
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


def unit_of(cls: type, key: str) -> str | tuple[str, ...]:
    """Unit of a field: a text, a tuple of those of its columns, or "" where it has none."""
    return UNITS.get(cls, {}).get(key, "")
