"""Texts of scenes for tests, and how they are read."""

import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.scene import load_scene

SMALLEST = """
[material]
E = 100e9
nu = 0.15
rho = 2650
yield_stress = [[0.0, 10e6], [0.05, 110e6]]
[contact]
friction = 0.23
[oedometer]
strain = 0.1
speed = 2
"""

FULL = (
    SMALLEST
    + """
ramp = 0.01
seating_stress = "20 kPa"
seating_speed = "50 cm/s"
[image]
file = "scans/sand.raw"
voxel_size = "5 um"
shape = [200, 300, 400]
dtype = "<u2"
crop = [[0, 50], [10, 60], [0, 400]]
threshold = 1234
[mesh]
size = "0.03 mm"
processes = 2
[sample]
grains = "grains"
separation = false
[solver]
element = "p1"
damping = "2 ms^-1"
[walls.x_max]
stress = "100 kPa"
speed = 0.1
friction = 0.3
[walls.y_min]
velocity = "-1 mm/s"
[material.scatter]
strength = 0.2
distribution = "weibull"
seed = 3
[materials."soft ones"]
labels = [3, 5]
E = "1 GPa"
[materials.stones]
labels = [9]
model = "rigid"
"""
)

#: The smallest scene without what loads it, for stages.
UNLOADED = SMALLEST.partition("[oedometer]")[0]

WITH_PAIRS = (
    FULL
    + """
[contact.pairs]
stones-material = 0.2
"soft ones-stones" = { friction = 0.3, friction_kinetic = 0.25 }
"""
)


def scene_file(folder, text):
    path = folder / "test.toml"
    path.write_text(text, encoding="utf-8")
    return path


def message_of(folder, text):
    with pytest.raises(InputError) as caught:
        load_scene(scene_file(folder, text))
    message = str(caught.value)
    assert "\n" not in message
    return message
