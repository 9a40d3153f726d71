"""Values that can be computed and that nobody means are named, with what is usual."""

import json
from dataclasses import replace

import pytest

from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.fracture import Fracture
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.report.write import write_report
from mufe_fenicsx.run.unusual import relations
from mufe_fenicsx.scene import (
    Contact,
    ContainerSettings,
    Group,
    Loading,
    Oedometer,
    Scene,
    Solver,
    Stage,
    Wall,
)
from mufe_fenicsx.scene.membrane import MembraneSettings
from mufe_fenicsx.scene.stages import Axis
from tests.made_up_run import write_whole_run

ROCK = J2(100e9, 0.15, 2650.0, ((0.0, 10e6),))
USUAL = Scene(material=ROCK, contact=Contact(friction=0.3), oedometer=Oedometer(0.1, 2.0))
STAGES = replace(
    USUAL, oedometer=None, loading=Loading(speed=2.0), stages=(Stage(z=Axis(strain=0.1)),)
)
SIZES = {"diameter": 1e-4, "height": 1e-3, "radius": 1.0}


def material(**changes):
    return replace(USUAL, material=replace(ROCK, **changes))


def staged(**axis):
    return replace(STAGES, stages=(Stage(z=Axis(**axis)),))


CASES = [
    (material(nu=0.499), {}, "material.nu, with plasticity,", "0.499"),
    (
        replace(USUAL, materials={"soft": Group((1,), Elastic(1e5, 0.15, 1.0))}), {},
        "materials.soft.E over material.E", "1e-06",
    ),
    (
        replace(USUAL, fracture=Fracture(30e6, 10.0)), {},
        "fracture.strength over the last yield stress of material", "3",
    ),
    (replace(USUAL, contact=Contact(friction=50.0)), {}, "contact.friction", "50"),
    (replace(USUAL, contact=Contact(0.3, wall_friction=1e3)), {}, "contact.wall_friction", "1000"),
    (
        replace(
            STAGES, membrane=MembraneSettings(E=1e12), walls={},
            container=ContainerSettings("cylinder"),
        ),
        {}, "membrane.E over the least of grains", "10",
    ),
    (replace(USUAL, oedometer=Oedometer(0.9, 2.0)), {}, "oedometer.strain", "0.9"),
    (staged(strain=0.9), {}, "stage stage 1, z.strain", "0.9"),
    (replace(USUAL, solver=Solver(damping=1e18)), {}, "solver.damping times the travel", ""),
    (USUAL, {"diameter": 3.0}, "mean diameter of the grains", "3 m"),
    (USUAL, {"diameter": 2e-9}, "mean diameter of the grains", "2 nm"),
    (USUAL, {"radius": 250.0}, "container.radius over that of the sample", "250"),
    (
        replace(USUAL, oedometer=Oedometer(0.1, 2.0, ramp=0.09)), {},
        "oedometer.ramp over oedometer.strain", "0.9",
    ),
    (
        replace(STAGES, loading=Loading(2.0, ramp=0.9)), {},
        "loading.ramp over the largest strain of a stage", "9",
    ),
    (
        replace(USUAL, walls={"x_max": Wall(stress=1e-6, speed=1.0)}), {},
        "walls.x_max.stress", "1 µPa",
    ),
    (staged(stress=1e10), {}, "stage stage 1, z.stress", "10 GPa"),
    (
        replace(USUAL, oedometer=Oedometer(0.1, 600.0)), {}, "oedometer.speed over that of waves",
        "0.09",
    ),
]  # fmt: skip


def test_usual_values_are_told_nothing_of():
    for scene in (USUAL, STAGES):
        assert relations(scene, **SIZES) == []


@pytest.mark.parametrize(("scene", "sizes", "name", "value"), CASES, ids=[c[2] for c in CASES])
def test_unusual_values_are_named(scene, sizes, name, value):
    found = relations(scene, **(SIZES | sizes))
    assert any(line.startswith(name) and f" = {value}" in line for line in found), found
    assert all(", usual is " in line for line in found)


def test_unusual_values_stand_in_the_report(tmp_path):
    write_whole_run(tmp_path, n=2)
    path, line = tmp_path / "run.json", "contact.friction = 50, usual is 0 to 1.5"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"unusual": [line]}))
    write_report(tmp_path, only=["stress-strain"])
    assert f"<td>{line}</td>" in (tmp_path / "report.html").read_text()
