"""A scene: everything that a user decides about a test. TOML is its written form.

Values are in SI units. Each class is one table of the scene file and states its defaults;
`load_scene` and `scene_to_toml` read and write the file.
"""

from .catalogue import register_material
from .image import ImageSettings, image_path
from .implicit import Implicit
from .reading import load_scene
from .scene import Scene
from .stages import Axis, Loading, Stage, Until
from .tables import (
    Contact,
    ContainerSettings,
    Group,
    MassScaling,
    Oedometer,
    Output,
    Pair,
    QuasiStatic,
    Sample,
    Solver,
    Wall,
)
from .tools import Tool
from .writing import scene_to_toml

__all__ = [
    "Axis",
    "Contact",
    "ContainerSettings",
    "Group",
    "ImageSettings",
    "Implicit",
    "Loading",
    "MassScaling",
    "Oedometer",
    "Output",
    "Pair",
    "QuasiStatic",
    "Sample",
    "Scene",
    "Solver",
    "Stage",
    "Tool",
    "Until",
    "Wall",
    "image_path",
    "load_scene",
    "register_material",
    "scene_to_toml",
]
