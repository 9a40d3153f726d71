"""How long seating takes in a membrane: the closed form against steps of the same motion."""

import math
from dataclasses import replace

import pytest

from mufe_fenicsx.planning.cost import Benchmark
from mufe_fenicsx.planning.course import SOLID, course_of, elastic_wave_speed
from mufe_fenicsx.planning.seating import closing_time, seating_time
from mufe_fenicsx.scene import load_scene
from mufe_fenicsx.synthetic.starter_scenes import IN_MEMBRANE

GAPS, PRESSED, H, D = 0.02, 0.01, 2e-3, 1.2e-3
MEASURED = Benchmark(
    1, 49, 8000, 3000, H, 2.0, 1e-3, (0, 0), (0.0, 0.0), GAPS + PRESSED, 0.0, 1e-9, 1e-9, 1e-9,
    4e8, of_sleeve=2000, diameter=D, pressed=PRESSED,
)  # fmt: skip


@pytest.fixture
def scene(tmp_path):
    text, _ = IN_MEMBRANE["triaxial"]
    (tmp_path / "grains").mkdir()
    (tmp_path / "scene.toml").write_text(text)
    return load_scene(tmp_path / "scene.toml")


def stepped(scene, dt=2e-9):
    """Time until σz is within the tolerance of σ, of pressure, gaps and stress one after another.

    The sleeve shrinks so little here that D stays; each platen goes half of the way.
    """
    course, sleeve, t = course_of(scene), scene.membrane, 0.0
    sigma, p, way = course.seating_stress, 0.0, 0.0
    while p < sigma:
        p += 2 * sleeve.E * sleeve.thickness * course.seating_speed / D**2 * dt
        t += dt
    while way < GAPS * H:
        way += course.speed * dt
        t += dt
    wave, stress = elastic_wave_speed(scene.material, sigma), 0.0
    impedance = SOLID * scene.material.rho * wave
    while stress < (1 - scene.loading.tolerance) * sigma:
        stress += sigma / (PRESSED * H) * 2 * (sigma - stress) / impedance * dt
        t += dt
    return t + 2 * H / wave


def test_seating_in_a_membrane_is_what_steps_of_the_same_motion_take(scene):
    """Euler steps: an error of a step for each part, and dt over 0.1 ms in the last one."""
    found = seating_time(scene, course_of(scene), MEASURED)
    assert found == pytest.approx(stepped(scene), rel=1e-3)
    loose = replace(scene, loading=replace(scene.loading, tolerance=0.5))
    assert seating_time(loose, course_of(loose), MEASURED) == pytest.approx(
        stepped(loose), rel=1e-3
    )
    assert seating_time(loose, course_of(loose), MEASURED) < 0.9 * found


def test_closing_at_half_of_the_pressure(scene):
    """Both platens at (σ - σ/2)/ρc: 1 % of H takes what they need at twice that speed."""
    course = course_of(scene)
    wave = elastic_wave_speed(scene.material, course.seating_stress)
    speed = 0.5 * course.seating_stress / (SOLID * scene.material.rho * wave)
    assert closing_time(scene, course, MEASURED) == pytest.approx(0.01 * H / (2 * speed))
    rigid = replace(scene, membrane=None)
    assert closing_time(rigid, course_of(rigid), MEASURED) == 0.0


def test_seating_between_walls_is_the_way_of_the_platen_and_its_waves(scene):
    """Waves at the seating stress fade at a rate of half of one over their time, to 0.02; two."""
    rigid = replace(scene, membrane=None)
    course = course_of(rigid)
    way = (MEASURED.travel + 0.5 * course.ramp) * H
    waves = (2 * math.log(50) + 2) * H / elastic_wave_speed(scene.material, course.seating_stress)
    found = seating_time(rigid, course, MEASURED)
    assert found == pytest.approx(way / course.seating_speed + waves)
