"""Ways, times and costs of a test, by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.container import Bounds
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.planning.contacts import closing_points
from mufe_fenicsx.planning.cost import (
    CLOSED,
    FLOWS,
    LATE,
    SEARCHES,
    TET_MEMORY,
    Benchmark,
    loading_time,
    predict,
)
from mufe_fenicsx.planning.course import (
    course_of,
    elastic_wave_speed,
    speed_under,
    wave_speed,
)
from mufe_fenicsx.planning.errors import contact_radius, elastic_radius, flows
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.run.rebalance import PAIR_COSTS
from mufe_fenicsx.scene import Contact, Oedometer, Scene
from mufe_fenicsx.scene.stages import Axis, Stage, Until
from tests.planning.samples import J2_ROCK, ROCK, staged


def test_cost_by_hand():
    """A way at 1 m/s and 0.5 ns a step, without the seating; twice as fine a mesh."""
    closing = 1500.0, 500.0
    due = tuple(CLOSED * np.array(closing))  # as many as the loading has
    b = Benchmark(1, 10, 10000, 3000, 1e-3, 2.0, 1e-3, due, closing, 0.0, 0.5e-9, 1e-9, 4e8)
    s = Scene(J2_ROCK, Contact(0.23), Oedometer(LATE, 1.0, ramp=0.005, seating_speed=1.0))
    loading = LATE * 1e-3 / 0.5e-9
    cost = predict(s, b)
    assert cost.num_steps == pytest.approx(loading, abs=2) and cost.seats
    pairs = PAIR_COSTS[0] * due[0] + PAIR_COSTS[1] * due[1]
    more = (FLOWS * 10000 + pairs) / (10000 + pairs)
    # States and rows: less than a second.
    stepping = SEARCHES * 1e-3 * loading * more
    assert cost.wall_s == pytest.approx(2.0 + stepping, abs=1.0)
    assert cost.limit == "contact"
    finer = predict(s, b, finer=8.0, shorter=0.5)
    assert finer.num_steps == pytest.approx(2 * cost.num_steps, rel=1e-4)
    assert finer.wall_s == pytest.approx(16 * (cost.wall_s - 2.0) + 16, rel=0.03)
    assert finer.memory_bytes - cost.memory_bytes == pytest.approx(70_000 * TET_MEMORY)


def test_a_stated_speed_is_reached_from_that_of_the_seating():
    """Without a ramp it is itself; over a ramp as long as the test the time is that of a march."""
    whole = Scene(J2_ROCK, Contact(0.23), Oedometer(0.01, 1.0, ramp=0.0, seating_speed=5.0))
    assert loading_time(whole, 1e-3) == pytest.approx(1e-5, rel=1e-12)
    ramp = replace(whole, oedometer=replace(whole.oedometer, ramp=0.01))
    strain, time, dt = 0.0, 0.0, 1e-9
    while strain < 0.01:
        s = strain / 0.01
        strain += (5.0 - 4.0 * s**3 * (10 - 15 * s + 6 * s**2)) * dt / 1e-3
        time += dt
    assert loading_time(ramp, 1e-3) == pytest.approx(time, rel=1e-3)
    # From rest the ramp goes by time, in which it comes half as far.
    rest = replace(ramp, oedometer=replace(ramp.oedometer, strain=0.02, seating_at_rest=True))
    assert loading_time(rest, 1e-3) == pytest.approx((0.02 + 0.5 * 0.01) * 1e-3)


def test_the_course_of_a_test_by_stages():
    """A linear sample: M = 0.6 ρ (0.08 c)². Stages that reach a stress count as stiff as balls."""
    found, c = course_of(staged()), 0.08 * J2_ROCK.wave_speed
    M = 0.6 * 2650 * c**2
    assert (found.key, found.seating_stress, found.seating_speed) == ("loading.speed", 5e5, 3.0)
    isotropic, shear = found.parts
    assert isotropic.way == pytest.approx(4.5e6 / M) and isotropic.waits == 5e-6
    # Strains begin at zero after the seating: the shear goes on from that of the isotropic part.
    assert shear.way == pytest.approx(0.03 - isotropic.way)
    assert shear.level == pytest.approx(5e6 / M + shear.way)
    stiff = elastic_wave_speed(J2_ROCK, 5e6)
    assert isotropic.level == pytest.approx(5e6 / (0.6 * 2650 * c * stiff), rel=1e-12)
    assert 1000 < stiff < 2000  # where sound in dense sand of hard grains is at 5 MPa
    for until, wanted in ((Until(strain_z=0.02), 0.02), (Until(deviator=3e6), 8e6 / M - 0.5e6 / M),
                          (Until(mean_stress=6e6), 8e6 / M - 0.5e6 / M)):  # fmt: skip
        part = course_of(staged(z=Axis(speed=0.3), until=until)).parts[1]
        assert part.way == pytest.approx(wanted - isotropic.way) and part.stated == 0.3
    # Sides of half the strain the other way; and sides of (3 p - σz)/2, here less by 1 MPa.
    shut = course_of(staged(undrained=True, z=Axis(speed=0.3), until=Until(q=3e6))).parts[1]
    assert shut.way == pytest.approx(2e6 / M)
    assert shut.level == pytest.approx(7e6 / (0.6 * 2650 * c * elastic_wave_speed(J2_ROCK, 7e6)))
    path = course_of(staged(z=None, p=5e6, q=3e6)).parts[1]
    assert path.way == pytest.approx(2e6 / M)
    shear = course_of(staged(p=5e6, z=Axis(strain=isotropic.way + 2e6 / M))).parts[1]
    assert shear.way == pytest.approx(2e6 / M) and shear.slows
    rest = course_of(staged(z=None, hold=3e-6)).parts[1]
    assert rest.way == 0.0 and rest.waits == 3e-6 and rest.level == math.inf


@pytest.mark.parametrize(("stress", "least", "most"), [(3e6, 1100, 1200), (1e7, 1350, 1450)])
def test_stages_of_elastic_grains_count_with_the_stiffness_of_their_contacts(stress, least, most):
    """Glass at 3 to 10 MPa: 1100 to 1400 m/s. The part of the rock's that sand has was 450 m/s."""
    glass = Elastic(E=70e9, nu=0.22, rho=2500.0)
    stages = (*staged().stages[:1], Stage("press", xyz=Axis(stress=stress)))
    scene = replace(staged(), material=glass, stages=stages)
    c = wave_speed(scene)
    assert least < c < most and c == elastic_wave_speed(glass, stress)
    (part,) = course_of(scene).parts
    assert part.way == pytest.approx((stress - 5e5) / (0.6 * 2500 * c**2))
    for more in ({"p": 2e7, "z": Axis(strain=0.03)}, {"until": Until(mean_stress=2e7)}):
        there = replace(staged(**({"z": Axis(speed=0.3)} | more)), material=glass)
        assert wave_speed(there) == elastic_wave_speed(glass, 2e7)
    assert wave_speed(replace(scene, material=J2_ROCK)) == 0.08 * J2_ROCK.wave_speed


@pytest.mark.parametrize(("first_yield", "elastic"), [(3e9, True), (2e9, True), (5e8, False)])
def test_glass_given_as_j2_counts_as_elastic_until_its_contacts_flow(first_yield, elastic):
    """At 10 MPa balls press on each other by 2.2 GPa in the mean, large forces by 3.8 GPa."""
    rock = {"E": 70e9, "nu": 0.22, "rho": 2500.0}
    glass, plain = J2(**rock, yield_stress=((0.0, first_yield),)), Elastic(**rock)
    # Hertz's law for two balls under the mean force F = 4π R² p/(φ n): a, and F/(π a²).
    p, R = 1e7, 1e-3
    F, E = 4 * math.pi * R**2 * p / (0.6 * 6), plain.contact_modulus / 2
    a = (3 * F * (R / 2) / (4 * E)) ** (1 / 3)
    assert 5 ** (1 / 3) * F / (math.pi * a**2) == pytest.approx(3.8e9, rel=0.02)
    assert flows(glass, p) is not elastic and flows(plain, p) is False
    scene = replace(
        staged(), material=glass, stages=(*staged().stages[:1], Stage("press", xyz=Axis(stress=p)))
    )
    assert wave_speed(scene) == (
        elastic_wave_speed(glass, p) if elastic else 0.08 * glass.wave_speed
    )
    assert (contact_radius(glass) == elastic_radius(glass)) is elastic


def test_a_modulus_that_is_known_gives_the_speed_of_waves():
    scene = replace(staged(), modulus=300e6)
    c = math.sqrt(300e6 / (0.6 * 2650))
    assert wave_speed(scene) == speed_under(scene, 1e3) == pytest.approx(c)
    assert course_of(scene).parts[0].way == pytest.approx(4.5e6 / 300e6)
    assert course_of(scene).parts[0].level == pytest.approx(5e6 / 300e6)


def test_points_of_cubes_close_with_their_gaps():
    """Two cubes of 1 mm, 0.1 mm apart, 0.05 mm from the platens: all close at 1/11."""
    comm, size = MPI.COMM_SELF, 1e-3
    points, cells = box((size,) * 3, (2, 2, 2))
    high = np.array([size, size, 2.2 * size])
    bodies = [(points + np.array([0.0, 0.0, z * size]), cells) for z in (0.05, 1.15)]
    s = build(comm, bodies, Elastic(**ROCK), np.zeros(3), high, axes="z")
    bounds = Bounds(np.zeros(3), high, np.zeros(2), 0.0)
    # Middles are 1.1 mm from each other and half of that from the platens. A face has eight facets
    # and eight sharp vertices, these for platens alone: the other cube's edges slant their normals.
    assert not closing_points(s, bounds, 0.99 / 11).any()
    assert closing_points(s, bounds, 1.01 / 11).tolist() == [2 * 8, 2 * (8 + 8)]


def test_a_measured_motion_takes_the_time_that_its_fastest_axis_needs(tmp_path):
    """Strains of 0, 0.02 and 0.01 at even times: 0.04 times the whole one, and more in between."""
    path = tmp_path / "motion.csv"
    path.write_text("time, strain_z\n0, 0\n1, 0.02\n2, 0.01\n")
    part = course_of(staged(z=None, follow=path)).parts[1]
    assert 0.04 < part.way < 0.08 and part.slows
    M = 0.6 * 2650 * (0.08 * J2_ROCK.wave_speed) ** 2
    assert part.level == pytest.approx(5e6 / M + 0.01)
