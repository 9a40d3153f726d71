"""The scene that goes on with a packing."""

from ...materials.sand import scene_table
from ..starter_scenes import DAMPED, HEAD, OEDOMETER, OUTPUT
from .container import CYLINDER

ROUND = """
[container]
shape = "cylinder"        # side, z_min and z_max are its walls
"""


def scene_text(num_grains, kind):
    """Oedometer test (TOML) of a packing in a box or cylinder; see `scene.load_scene`."""
    head = HEAD.format(
        title=f"Oedometer test on a packing of {num_grains} grains",
        grains="what `mufe pack` packed",
        friction=0.23,
        wall=0.0,
        material=scene_table(),
    )
    container = ROUND if kind == CYLINDER else ""
    return head + container + DAMPED.format(100) + OEDOMETER + OUTPUT
