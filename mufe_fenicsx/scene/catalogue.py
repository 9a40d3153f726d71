"""What scene files name: their tables, and the models of [material]."""

from ..errors import InputError
from ..geometry.settings import MeshSettings
from ..materials.auto import Auto
from ..materials.elastic import Elastic, IsotropicSolid
from ..materials.fracture import Fracture
from ..materials.j2 import J2
from ..materials.rigid import Rigid
from .image import ImageSettings
from .implicit import Implicit
from .membrane import MembraneSettings
from .stages import Loading
from .tables import (
    Contact,
    ContainerSettings,
    MassScaling,
    Oedometer,
    Output,
    QuasiStatic,
    Sample,
    Solver,
)

MODELS = {"j2": J2, "elastic": Elastic, "rigid": Rigid, "auto": Auto}

#: Keys outside of all tables, fields of `scene.Scene`.
TOP_KEYS = ("title", "accuracy", "modulus", "gravity")

#: Table of the file -> its class; [material], [walls.*] and [[stage]] are read apart.
TABLES = {
    "image": ImageSettings,
    "mesh": MeshSettings,
    "sample": Sample,
    "container": ContainerSettings,
    "contact": Contact,
    "solver": Solver,
    "implicit": Implicit,
    "oedometer": Oedometer,
    "loading": Loading,
    "quasi_static": QuasiStatic,
    "mass_scaling": MassScaling,
    "membrane": MembraneSettings,
    "fracture": Fracture,
    "output": Output,
}


def register_material(name: str, cls: type[IsotropicSolid]) -> None:
    """Let scene files say ``material.model = name`` for a material of one's own.

    Args:
        name: Its name in scene files.
        cls: A frozen dataclass derived from :class:`~.materials.elastic.IsotropicSolid`, whose own
            fields are made by :func:`~mufe_fenicsx.units.setting`.

    Raises:
        InputError: The name is taken.
    """
    if MODELS.get(name, cls) is not cls:
        raise InputError(f'material "{name}" is registered, expected a new name')
    MODELS[name] = cls
