"""What a mesh and a plan say beforehand of what the report would not accept."""

from dataclasses import replace

import numpy as np
import pytest

from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.form.proportions import warnings_of_proportions
from mufe_fenicsx.geometry.grains import Grains
from mufe_fenicsx.planning.course import SOLID, elastic_wave_speed
from mufe_fenicsx.planning.servo import lagging_servos
from mufe_fenicsx.scene.stages import Loading
from tests.planning.samples import J2_ROCK, staged


def grains_of(*corners):
    """Boxes between lowest and highest corners [m]."""
    bodies = []
    for low, high in corners:
        points, cells = box(tuple(np.subtract(high, low)), (1, 1, 1))
        bodies.append((points + np.subtract(low, points.min(axis=0)), cells))
    return Grains.from_list(range(1, len(bodies) + 1), bodies, 1e-3)


def cubes(layers, side=1e-3):
    """Four columns of so many cubes."""
    places = np.array(list(np.ndindex(2, 2, layers))) * side
    return [(place, place + side) for place in places]


def test_grains_that_bridge_their_box_are_named():
    """A bar as high as seven layers of cubes, and a heap of two layers."""
    assert warnings_of_proportions(grains_of(*cubes(7))) == []
    bar = ((2e-3, 0, 0), (3e-3, 1e-3, 7e-3))
    (line,) = warnings_of_proportions(grains_of(*cubes(7), bar))
    assert line.startswith("grain 29 reaches from z_min to z_max")
    (line,) = warnings_of_proportions(grains_of(*cubes(2)))
    assert (
        "1.6 median diameters high; less than two" in line
    )  # of boxes: 2 sides over 1.24, 1.6 diameters
    assert warnings_of_proportions(grains_of(*cubes(1), bar)) == []  # too few to be a sample


@pytest.mark.parametrize(("speed", "told"), [(0.1, 0), (4.0, 1)])
def test_stages_faster_than_their_servo_are_told(speed, told):
    """ρc v/2 over the stress that x and y hold; a test that controls its speed is not told."""
    stress = 5e6
    scene = replace(staged(), loading=Loading(speed=speed))
    lines = lagging_servos(scene)
    assert len(lines) == told
    if told:
        impedance = SOLID * J2_ROCK.rho * elastic_wave_speed(J2_ROCK, stress)
        assert f"lags by about {0.5 * impedance * speed / stress:.0%} of it" in lines[0]
