"""Public names for type checkers: those of ``MODULE_OF`` in `__init__.py`."""

from .bulk.tools import Tool as Tool
from .bulk.tools import ToolPath as ToolPath
from .contact.walls import Wall as Wall
from .errors import InputError as InputError
from .errors import SolverError as SolverError
from .explicit.simulation import Simulation as Simulation
from .geometry.bodies.half_ball import half_ball as half_ball
from .geometry.bodies.shapes import box as box
from .geometry.bodies.shapes import cylinder as cylinder
from .geometry.bodies.shapes import sphere as sphere
from .geometry.bodies.sleeve import sleeve as sleeve
from .geometry.grains import Grains as Grains
from .geometry.grains import load_grains as load_grains
from .geometry.grains import save_grains as save_grains
from .implicit.simulation import ImplicitSimulation as ImplicitSimulation
from .loading.membrane import Membrane as Membrane
from .loading.pressure import Pressure as Pressure
from .materials.auto import Auto as Auto
from .materials.elastic import Elastic as Elastic
from .materials.j2 import J2 as J2
from .materials.neo_hookean import NeoHookean as NeoHookean
from .materials.rigid import Rigid as Rigid
from .mesh import GrainMesh as GrainMesh
from .run.from_bodies import build as build
from .run.from_bodies import drive as drive
from .run.from_bodies import settle as settle
from .run.opened import Run as Run
from .run.opened import open_run as open_run
from .run.run import run_scene as run_scene
from .scene.catalogue import register_material as register_material
from .scene.reading import load_scene as load_scene
from .scene.scene import Scene as Scene
from .scene.writing import scene_to_toml as scene_to_toml

MODULE_OF: dict[str, str]
__version__: str
