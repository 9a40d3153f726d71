"""The arithmetic of charts and plans, by hand; what the stored table says; what is refused."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.cli.arguments import number_or_text
from mufe_fenicsx.cli.main import main
from mufe_fenicsx.container import Bounds
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.planning import evidence
from mufe_fenicsx.planning.case import expected_error, plan_case, settled
from mufe_fenicsx.planning.choice import follow, plan_scene
from mufe_fenicsx.planning.contacts import Closing
from mufe_fenicsx.planning.cost import (
    CLOSED,
    FLOWS,
    LATE,
    SEARCHES,
    TET_MEMORY,
    WHILE_SEATING,
    Benchmark,
    loading_time,
    predict,
)
from mufe_fenicsx.planning.course import course_of, elastic_wave_speed, wave_speed
from mufe_fenicsx.planning.errors import GRAINS, falling, of_loading, sample_errors, time_for
from mufe_fenicsx.planning.evidence import Point, cheapest, command_of, cost_at, pareto
from mufe_fenicsx.planning.present import present_state
from mufe_fenicsx.planning.run import planned_scene
from mufe_fenicsx.planning.sample import Sample
from mufe_fenicsx.planning.text import lines_of_present
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.run.rebalance import PAIR_COSTS
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import Contact, MassScaling, Oedometer, Output, Scene, Solver, load_scene
from mufe_fenicsx.scene.stages import Axis, Loading, Stage, Until
from mufe_fenicsx.verification.cases import run_cases
from tests.bodies import RADIUS, packed_grains

ROCK = {"E": 100e9, "nu": 0.15, "rho": 2650.0}
J2_ROCK = J2(**ROCK, yield_stress=((0.0, 10e6), (0.05, 110e6)))


def point(error, seconds, case="hertz", series="averaged", curve=(), cells=20000, **parameters):
    command = command_of(case, parameters)
    return Point(case, series, error, seconds, 1e6 * seconds, cells, 100, "done", command, curve)


def test_front_of_the_best():
    """Of five points three are beaten by none: 1 s 10 %, 2 s 4 %, 8 s 1 %."""
    a, b, c, d, e = (point(*v) for v in [(0.1, 1), (0.12, 1.5), (0.04, 2), (0.05, 3), (0.01, 8)])
    assert pareto([d, e, b, c, a]) == [a, c, e]
    assert cheapest([a, b, c, d, e], 0.05) is c
    assert cheapest([a, b, c, d, e], 0.005) is None
    # Increments have no element-steps: wherever they stand, they are not of that front.
    some = replace(b, error=0.001, element_steps=math.nan)
    for points in ([d, some, b, c, e, a], [some, d, e, b, c, a], [a, b, c, some, d, e]):
        assert pareto(points, "element_steps") == [a, c, e]


@pytest.mark.parametrize("case", ["hertz", "mindlin", "impact", "plastic-sphere", "jammed"])
def test_plans_are_near_the_front_of_what_is_within_everywhere(case):
    """The cheapest point within the accuracy in the table and at all parameters that are known.

    A plan that knows none of them can do no better but by luck. 1.5 times is what it may cost.
    """
    own, elsewhere = evidence.usable(evidence.read_points(), case), evidence.read_elsewhere()

    def largest(point):
        known = elsewhere.get(point.command, {"": {0.0: math.inf}})
        return max(point.error, *(e for along in known.values() for e in along.values()))

    for accuracy in (0.2, 0.1, 0.05, 0.03, 0.02):
        within = [p.seconds for p in own if largest(p) <= accuracy]
        if not within:
            with pytest.raises(InputError, match="expected at least"):
                plan_case(case, accuracy)
        else:
            assert plan_case(case, accuracy).seconds <= 1.5 * min(within)


def test_cost_at_an_error_lies_on_a_straight_line_of_logarithms():
    """Error 0.1 to 0.01 while cost grows 1 to 100: at 0.0316 it is 10, and no more is known."""
    points = [point(0.1, 1.0), point(0.01, 100.0)]
    assert cost_at(points, 10**-1.5) == pytest.approx(10.0, rel=1e-12)
    assert math.isnan(cost_at(points, 0.005)) and cost_at(points, 0.5) == 1.0


def test_a_table_gives_back_its_points(tmp_path):
    wanted = [point(0.125, 2.0, "oedometer", curve=(1.0, 2.5), element="p1", element_size=0.5)]
    evidence.write_points(tmp_path / "t.csv", wanted)
    assert evidence.read_points(tmp_path / "t.csv") == wanted
    assert wanted[0].parameters == {"element": "p1", "element_size": "0.5"}


def test_error_of_inertia():
    """ln(r)/(2 r²): 0.0115 at ten times the time of a wave; and back."""
    assert of_loading(10.0) == pytest.approx(0.5 * math.log(10) / 100, rel=1e-12)
    assert time_for(of_loading(10.0)) == pytest.approx(10.0, rel=1e-9)
    assert math.isinf(of_loading(2.0)) and math.isinf(time_for(0.0))


def test_the_mean_error_of_inertia_is_that_of_its_course():
    """Weighted by a force that grows with the time s: error (T/s)²/4 from s = T on."""
    s = np.linspace(1.0, 10.0, 200001)
    mean = np.trapezoid(0.25 / s**2 * s, s) / np.trapezoid(np.linspace(0, 10, 3), dx=5.0)
    assert of_loading(10.0) == pytest.approx(mean, rel=1e-6)


def test_an_error_that_happens_to_vanish_does_not_count():
    assert falling([(10, 0.2), (20, 0.01), (40, 0.05)]) == ((10, 0.2), (20, 0.05), (40, 0.05))


def course(error):
    """Stress at eight parts of the strain that is off by a part everywhere."""
    return tuple(1e6 * k * (1 + error) for k in range(1, 9))


@pytest.fixture
def table():
    """Errors that are known: mesh 32, 8, 2 %; 1 % of mass 0.5 %; rigid 50 %; rounding 0.2 %."""

    def of(error, n, **parameters):
        return point(error, 1.0, "plastic-sphere", cells=round(500 * n**2),
                     elements_per_radius=n, **parameters)  # fmt: skip

    def grains(error, **parameters):
        return point(error, 1.0, "oedometer", curve=course(error), element_size=0.5, **parameters)

    return [
        *(of(e, n) for e, n in ((0.32, 0.5), (0.08, 1.0), (0.02, 2.0))),
        *(of(e, n, element="p1") for e, n in ((0.6, 0.5), (0.3, 1.0), (0.15, 2.0))),
        of(0.085, 1.0, added_mass=0.01),
        grains(0.0), grains(0.5, fidelity="rigid"), grains(0.002, time_step_factor=0.85),
    ]  # fmt: skip


def scene(material=J2_ROCK, **more):
    return Scene(material, Contact(0.23), Oedometer(0.1, 1.0), **more)


def sample(n, num_grains=500):
    """Grains of 0.2 mm, 1000 tetrahedra each, n elements per contact radius of 20 um."""
    labels = tuple(range(1, num_grains + 1))
    return Sample("grains", labels, num_grains * 1000, 20e-6 / n, 200e-6)


def test_errors_follow_from_the_table(table):
    errors = sample_errors(table)
    assert errors.of_mesh(1.0) == pytest.approx(0.08)
    # Half-way in logarithms between 8 and 2 %.
    assert errors.of_mesh(math.sqrt(2)) == pytest.approx(0.04)
    assert errors.of_mesh(4.0) == pytest.approx(0.01)  # beyond: with the length of edges
    assert math.isinf(errors.of_mesh(0.4)) and math.isinf(errors.elements_for(0.009))
    assert errors.elements_for(0.04) == pytest.approx(math.sqrt(2), rel=1e-6)
    assert errors.masses[0.01] == pytest.approx((0.005, 1.0))
    assert errors.fidelities["rigid"] == pytest.approx(0.5)
    assert errors.of_path(4 * GRAINS) == pytest.approx(0.001)
    assert sample_errors(table, "p1").of_mesh(1.0) == pytest.approx(0.3)


def test_meshes_for_a_contact(table):
    """Even edges at half the length: eight times as many; or patches, 7 x 500 n²."""
    errors, grains = sample_errors(table), sample(0.5)
    assert grains.mesh_for(0.25, 0.1, errors) == pytest.approx((80e-6, 80e-6, 125))
    assert grains.mesh_for(1.0, 0.1, errors) == pytest.approx((20e-6, 40e-6, 1000 + 3500))
    even = sample(0.9).mesh_for(1.0, 0.1, errors)
    assert even == pytest.approx((20e-6, 20e-6, 1000 / 0.9**3))


def test_a_plan_keeps_what_it_promises_and_finer_is_never_cheaper(table):
    costs = []
    for accuracy in (0.3, 0.12, 0.06, 0.03):
        plan = plan_scene(scene(), sample(0.5), accuracy, table)
        assert plan.error == pytest.approx(sum(plan.parts.values())) and plan.error <= accuracy
        speed = plan.settings["oedometer.speed"]
        costs.append(plan.tets / plan.size / speed)
        assert follow(scene(), plan).oedometer.speed == speed
    assert costs == sorted(costs)


def test_a_plan_is_near_the_cheapest_of_all_by_brute_force(table):
    """Cost n t/h over a fine grid of meshes and times that meet the accuracy."""
    errors = sample_errors(table)
    accuracy, grains = 0.06, sample(0.5)
    plan = plan_scene(scene(), grains, accuracy, table)

    def cost(n, t):
        size, _, tets = grains.mesh_for(n, 0.1, errors)
        return tets / size * t

    best = min(
        cost(n, t)
        for n in [0.5 * 1.02**k for k in range(104)]
        for t in [3 * 1.02**k for k in range(200)]
        if errors.of_mesh(n) + of_loading(t) <= accuracy
    )
    found = cost(plan.elements_per_radius, time_for(plan.parts["loading"]))
    assert found <= 1.05 * best


def test_a_test_as_it_stands_tells_its_error(table):
    """One element per contact radius: 8 %. A strain of 0.1 at v: t = 0.1 c/v of a wave's time."""
    wave = wave_speed(scene())
    slow = scene(mass_scaling=MassScaling(0.01))
    slow = replace(slow, oedometer=Oedometer(0.1, 0.1 * wave / 10.0))  # ten times a wave's time
    found = present_state(slow, sample(1.0), table)
    parts = {"mesh": 0.08, "loading": of_loading(10.0), "mass": 0.005, "fidelity": 0.0}
    assert found.parts == pytest.approx(parts) and found.time == pytest.approx(10.0)
    assert found.error == pytest.approx(sum(parts.values()))
    # A plan that changes nothing promises the same.
    plan = plan_scene(slow, sample(1.0), found.error * 1.0001, table, keep_mesh=True)
    assert plan.parts["mesh"] == found.parts["mesh"]
    assert plan.parts["loading"] == pytest.approx(found.parts["loading"], rel=1e-2)
    coarse = present_state(scene(Rigid(**ROCK)), sample(0.1), table + hertz_table(table))
    assert math.isinf(coarse.error) and coarse.parts["fidelity"] == pytest.approx(0.5)
    text = "\n".join(lines_of_present(coarse, None))
    assert "expected error  more than is known of forces: mesh more than is known" in text


def test_what_cannot_be_reached_is_refused_with_what_would(table):
    with pytest.raises(InputError, match=r'500 grains rigid.*"j2" would do'):
        plan_scene(scene(Rigid(**ROCK)), sample(1), 0.05, table + hertz_table(table))
    with pytest.raises(InputError, match=r"and not 1 \(error about 0.08\).*mesh.size = "):
        plan_scene(scene(), sample(1), 0.05, table, keep_mesh=True)
    with pytest.raises(InputError, match=r"accuracy = 0.004, expected more than 0.014"):
        plan_scene(scene(), sample(1), 0.004, table)
    with pytest.raises(InputError, match=r"added = 0.5, expected at most 0.01"):
        plan_scene(scene(mass_scaling=MassScaling(0.5)), sample(1), 0.1, table)
    with pytest.raises(InputError, match=r'element = "composite", expected one of which'):
        plan_scene(scene(solver=Solver(element="composite")), sample(1), 0.1, table)


def hertz_table(table):
    """The same errors for elastic contacts."""
    return [replace(p, case="hertz") for p in table if p.case == "plastic-sphere"]


def test_cost_by_hand():
    """A way at 1 m/s and 0.5 ns a step, and that of seating at 1 m/s; twice as fine a mesh."""
    closing = 1500.0, 500.0
    due = tuple(CLOSED * np.array(closing))  # as many as the loading has
    b = Benchmark(
        1, 10, 10000, 3000, 1e-3, 2.0, 1e-3, due, closing, 0.02, 0.0, 1e-9, 0.5e-9, 1e-9, 4e8
    )
    s = Scene(J2_ROCK, Contact(0.23), Oedometer(LATE, 1.0, ramp=0.005, seating_speed=1.0))
    way = (0.02 + 0.0025) * 1e-3
    seating = way / s.oedometer.seating_speed / (1.1 * 0.5e-9)
    loading = LATE * 1e-3 / 0.5e-9
    cost = predict(s, b)
    assert cost.num_steps == pytest.approx(seating + loading, abs=2)
    pairs = PAIR_COSTS[0] * due[0] + PAIR_COSTS[1] * due[1]
    less = (10000 + WHILE_SEATING * pairs) / (10000 + pairs)
    more = (FLOWS * 10000 + pairs) / (10000 + pairs)
    # States and rows: less than a second.
    stepping = SEARCHES * 1e-3 * (seating * less + loading * more)
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


def staged(**last):
    """Seating, 5 MPa on all sides, then shear."""
    stages = (
        Stage(zero=True, xyz=Axis(stress=5e5, speed=3.0)),
        Stage("isotropic", xyz=Axis(stress=5e6), hold=5e-6),
        Stage("shear", **({"z": Axis(strain=0.03)} | last)),
    )
    return Scene(J2_ROCK, Contact(0.23), loading=Loading(speed=0.5, ramp=0.001), stages=stages)


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


def test_a_plan_of_a_test_by_stages_sets_its_speed_and_judges_stated_ones(table):
    plan = plan_scene(staged(), sample(0.5), 0.12, table)
    time = time_for(plan.parts["loading"])
    level = min(part.level for part in course_of(staged()).parts)
    speed = plan.settings["loading.speed"]
    assert speed == pytest.approx(level * 0.08 * J2_ROCK.wave_speed / time, rel=5e-3)
    followed = follow(staged(), plan)
    assert followed.loading.speed == speed and followed.output.fields == 5
    way, H = sum(part.way for part in course_of(staged()).parts), 1e-3
    # Ramps of three stages' ends, the hold, and the time that stresses settle in.
    least = way * H / speed + 5e-6
    assert least < loading_time(followed, H) < least + 4 * 0.001 * H / speed + 8 * H / 500
    with pytest.raises(InputError, match=r'stage "shear": speed = 80 m/s, expected at most .* or'):
        plan_scene(staged(z=Axis(strain=0.03, speed=80.0)), sample(0.5), 0.12, table)


def test_a_chain_of_cubes_closes_by_the_sum_of_its_gaps():
    """Two cubes of 1 mm, 0.1 mm apart, 0.05 mm from the platens: 0.2 mm to go, all at 1/11."""
    comm, size = MPI.COMM_SELF, 1e-3
    points, cells = box((size,) * 3, (2, 2, 2))
    high = np.array([size, size, 2.2 * size])
    bodies = [(points + np.array([0.0, 0.0, z * size]), cells) for z in (0.05, 1.15)]
    s = build(comm, bodies, Elastic(**ROCK), np.zeros(3), high, axes="z")
    closing = Closing(s, Bounds(np.zeros(3), high, np.zeros(2), 0.0))
    assert closing.travel() == pytest.approx(0.2 * size, rel=1e-6)
    # Middles are 1.1 mm from each other and half of that from the platens. A face has eight facets
    # and eight sharp vertices, these for platens alone: the other cube's edges slant their normals.
    assert not closing.num_points(0.99 / 11).any()
    assert closing.num_points(1.01 / 11).tolist() == [2 * 8, 2 * (8 + 8)]
    # A quarter of m v²/2 at the platen and of half of that between the cubes is the work p A x of
    # faces that flow from the start; on the platen sharp vertices add 1.75 times their area.
    mass, v, p = ROCK["rho"] * size**3, 5.0, 1e6
    more = (0.125 / 2.75 + 0.0625) * mass * v**2 / (p * size**2)
    assert closing.travel(v, p) == pytest.approx(0.2 * size + more, abs=0.01 * more)


def test_the_stored_table_repeats():
    """A cheap point's command gives its stored error again: nothing random, to rounding."""
    stored = evidence.read_points()
    point = next(p for p in stored if p.case == "impact" and p.series == "rigid")
    given = {name: number_or_text(text) for name, text in point.parameters.items()}
    (answer,) = run_cases(["impact-point"], given, MPI.COMM_SELF)
    # Different processors round differently; impacts of rigid balls do not amplify that.
    assert answer["results"]["error"]["computed"] == pytest.approx(point.error, rel=1e-3)


def on_meshes(errors):
    """Points on meshes of n elements that take n³ seconds, {n: error}, and the same elsewhere."""
    on = [point(e, n**3, elements_per_radius=n) for n, e in errors.items()]
    return on, {p.command: everywhere(p.error) for p in on}


def everywhere(error):
    """The same error at two Poisson's ratios."""
    return {"nu": {0.1: error, 0.3: error}}


def test_a_plan_of_a_case_lies_between_two_meshes():
    """Errors 0.4/n²: 5 % with a margin of 0.75 at n = √(32/3), rounded up to 3.27, in n³ s."""
    on, known = on_meshes({n: 0.4 / n**2 for n in (1.0, 2.0, 4.0)})
    plan = plan_case("hertz", 0.05, on, known)
    assert plan.command == command_of("hertz", {"elements_per_radius": 3.27})
    assert plan.seconds == pytest.approx(3.27**3) and plan.error == pytest.approx(0.4 / 3.27**2)
    assert plan.status == "not measured, between elements_per_radius = 2 and 4"
    # Edges' lengths fall as meshes get finer.
    edges = [point(0.4 * h**2, h**-3, element_size=h) for h in (1.0, 0.5, 0.25)]
    plan = plan_case("hertz", 0.05, edges, {p.command: everywhere(p.error) for p in edges})
    assert plan.parameters == {"element_size": "0.306"}


def test_errors_that_are_small_by_chance_do_not_draw_plans_to_coarse_meshes():
    """None between 20 and 1 % where 10 % follow; and 16 to 0.1 % on half the edges counts as h²."""
    on, known = on_meshes({1.0: 0.2, 2.0: 0.01, 4.0: 0.1, 8.0: 0.01})
    known[on[1].command] = everywhere(0.1)
    assert float(plan_case("hertz", 0.05, on, known).parameters["elements_per_radius"]) > 4
    on, known = on_meshes({2.0: 0.16, 4.0: 0.001})
    # 2 (0.16/0.075)^½ with the margin.
    assert plan_case("hertz", 0.1, on, known).parameters == {"elements_per_radius": "2.93"}


def test_a_plan_knows_the_speed_that_it_is_for():
    """Error 0.3 at 2, 0.1 at 6 and 0.12 at 10, over 0.94; on lines between them, over 0.84."""
    cheap = point(0.1, 1.0, elements_per_radius=2.0, fidelity="rigid")
    dear = point(0.01, 8.0, elements_per_radius=2.0)
    known = {cheap.command: {"speed": {2.0: 0.3, 6.0: 0.1, 10.0: 0.12}, "nu": {0.1: 0.1}},
             dear.command: {"speed": {2.0: 0.01, 10.0: 0.02}}}  # fmt: skip

    def plan(accuracy, **stated):
        return plan_case("hertz", accuracy, [cheap, dear], known, stated)

    assert plan(0.25) == dear  # at any speed
    found = plan(0.2 / 0.84 + 1e-9, speed=4)
    assert found.error == pytest.approx(0.2) and found.status == "not measured at speed = 4"
    assert found.parameters == cheap.parameters | {"speed": "4"}
    assert plan(0.2 / 0.84 - 1e-9, speed=4.0).parameters == dear.parameters | {"speed": "4"}
    assert plan(0.1 / 0.94 + 1e-9, speed=6.0, nu=0.1).parameters["fidelity"] == "rigid"
    assert "fidelity" not in plan(0.1 / 0.94 - 1e-9, speed=6.0).parameters
    assert plan(0.11 / 0.84 + 1e-9, speed=8.0).parameters == cheap.parameters | {"speed": "8"}
    # Nothing is known of 12: it may be as bad as at the worst speed.
    assert plan(0.25, speed=12.0).parameters == dear.parameters | {"speed": "12"}
    # At 6 a finer mesh is worse than the cheap one, which is within 0.11 by chance then.
    finer = point(0.1, 16.0, elements_per_radius=3.0, fidelity="rigid")
    known[finer.command] = {"speed": {2.0: 0.1, 6.0: 0.15, 10.0: 0.1}}
    assert "fidelity" not in plan_case(
        "hertz", 0.11, [cheap, dear, finer], known, {"speed": 6.0}).parameters  # fmt: skip
    with pytest.raises(InputError, match="parameter spede of a plan for hertz, expected nu or spe"):
        plan(0.2, spede=4.0)
    with pytest.raises(InputError, match="speed = fast, expected a number"):
        plan(0.2, speed="fast")


@pytest.mark.parametrize(
    "case", ["hertz", "mindlin", "impact", "plastic-sphere", "oedometer", "jammed"]
)
def test_stored_points_plan_their_cases(case):
    """Finer is never cheaper, and no point within the accuracy is cheaper than what is chosen."""
    stored, known = evidence.usable(evidence.read_points(), case), evidence.read_elsewhere()
    stored = [p for p in stored if p.command in known] or stored
    elsewhere = settled(stored, known)
    best = min(expected_error(p, elsewhere) for p in stored)
    coarse, fine = plan_case(case, min(3 * best, 0.9)), plan_case(case, 1.1 * best)
    assert coarse.seconds <= fine.seconds
    good = [p for p in stored if expected_error(p, elsewhere) <= 1.1 * best]
    assert fine.error <= 1.1 * best and fine.seconds <= min(p.seconds for p in good)
    with pytest.raises(InputError, match="accuracy = 1e-06, expected at least"):
        plan_case(case, 1e-6)


def test_a_run_follows_its_plan_and_tells_what_was_predicted(tmp_path_factory):
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path_factory.mktemp("plan") if comm.rank == 0 else None)
    if comm.rank == 0:
        save_grains(folder / "grains", packed_grains((2, 2, 1), h=0.26 * RADIUS))
    comm.Barrier()
    wanted = Scene(
        J2_ROCK, Contact(0.23), Oedometer(0.01, 1.0, seating_stress=1e4, seating_speed=20.0),
        output=Output(fields=3, history=21), accuracy=0.6,
    )  # fmt: skip
    planned, after = planned_scene(wanted, folder / "grains", comm)
    result = run_scene(planned, folder / "grains", folder / "out", comm, quiet=True, after=after)
    stored = load_scene(folder / "out" / "scene.toml")
    for dotted, value in result["plan"]["settings"].items():
        table, key = dotted.split(".")
        assert getattr(getattr(stored, table), key) == value
    assert stored.accuracy == 0.6
    line = result["predicted_and_actual"]
    assert line.startswith("predicted ") and f"actual {result['wall_s']:.3g} s" in line
    # At 20 m/s the platen is far ahead of the first wave. A machine at work makes clocks useless.
    predicted = result["plan"]["predicted"]
    assert 0.6 < predicted["num_steps"] / result["num_steps"] < 1.7
    assert 0.7 < predicted["memory_bytes"] / result["peak_memory_bytes"] < 1.3
    # The plan of the planned scene is itself: a run that goes on finds the same.
    again, _ = planned_scene(stored, folder / "grains", comm, measure=False)
    assert again == stored


def test_mufe_plan_of_a_case(capfd):
    with pytest.raises(SystemExit) as end:
        main(["plan", "impact", "--accuracy", "0.05", "--json", "-"])
    assert end.value.code == 0
    found = json.loads(capfd.readouterr().out)
    assert found["error"] <= 0.05 and found["command"].startswith("mufe verify impact-point")
    with pytest.raises(SystemExit) as end:
        main(["plan", "hertz", "--accuracy", "1.5"])
    assert end.value.code == 2
    assert "accuracy = 1.5, expected 0 < accuracy < 1" in capfd.readouterr().err


def test_a_measured_motion_takes_the_time_that_its_fastest_axis_needs(tmp_path):
    """Strains of 0, 0.02 and 0.01 at even times: 0.04 times the whole one, and more in between."""
    path = tmp_path / "motion.csv"
    path.write_text("time, strain_z\n0, 0\n1, 0.02\n2, 0.01\n")
    part = course_of(staged(z=None, follow=path)).parts[1]
    assert 0.04 < part.way < 0.08 and part.slows
    M = 0.6 * 2650 * (0.08 * J2_ROCK.wave_speed) ** 2
    assert part.level == pytest.approx(5e6 / M + 0.01)
