"""What a mesh and a plan say beforehand of what the report would not accept."""

import re
from dataclasses import replace

import numpy as np
import pytest

from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.form.proportions import warnings_of_proportions
from mufe_fenicsx.geometry.grains import Grains
from mufe_fenicsx.materials.fracture import Fracture
from mufe_fenicsx.planning.choice import plan_scene
from mufe_fenicsx.planning.course import SOLID, elastic_wave_speed
from mufe_fenicsx.planning.present import present_state
from mufe_fenicsx.planning.servo import lagging_servos
from mufe_fenicsx.planning.text import lines, lines_of_present
from mufe_fenicsx.scene.stages import Loading
from tests.planning.samples import J2_ROCK, sample, scene, staged


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


@pytest.mark.parametrize(("energy", "told"), [(10.0, ": too coarse"), (40.0, "")])
def test_plans_tell_the_edges_that_cracks_want(energy, told, table):
    """A fifth of E G/σ²; time and steps are those up to the first crack."""
    known = sample(1.0)  # 1000 tetrahedra in 0.2 mm: edges of 0.2 mm (√2 π/1000)^(1/3) = 32.9 um
    breaks = scene(fracture=Fracture(150e6, energy))
    zone = 1e6 * breaks.material.E * energy / 150e6**2
    for found in (present_state(breaks, known, table), plan_scene(breaks, known, 0.5, table)):
        wants, has = re.findall(
            r"edges of ([\d.]+) µm; the mean one of the mesh is ([\d.]+)", found.cracks
        )[0]
        assert float(wants) == pytest.approx(zone / 5, rel=1e-3)
        if found.tets == known.tets:
            assert float(has) == pytest.approx(32.88, rel=1e-3) and found.cracks.endswith(
                told or "m"
            )
        assert any("without cracks" in line for line in found.unknown)
        assert any(name == "cracks" for name, *_ in map(str.split, _of(found)))
    whole = present_state(scene(), known, table)
    assert whole.cracks == "" and not any("crack" in line for line in [*whole.unknown, *_of(whole)])


def _of(found):
    """Lines of a plan or of a test as it stands."""
    return (lines if hasattr(found, "settings") else lines_of_present)(found, None)
