"""Plans of scenes: what they promise, what they cost, what is refused."""

import math
import re
from dataclasses import replace

import pytest
from mpi4py import MPI

from mufe_fenicsx.analysis.checks import UNTRUSTED
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.materials.sand import SAND
from mufe_fenicsx.planning import run as planning
from mufe_fenicsx.planning.choice import follow, plan_scene
from mufe_fenicsx.planning.cost import Benchmark, loading_time, predict
from mufe_fenicsx.planning.course import course_of, wave_speed
from mufe_fenicsx.planning.errors import (
    KNOWN_STRESS,
    elastic_radius,
    of_loading,
    sample_errors,
    time_for,
)
from mufe_fenicsx.planning.present import present_state
from mufe_fenicsx.planning.run import plan_within, planned_scene
from mufe_fenicsx.planning.text import lines, lines_of_present
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import (
    Contact,
    MassScaling,
    Oedometer,
    Output,
    QuasiStatic,
    Scene,
    Solver,
    load_scene,
)
from mufe_fenicsx.scene.stages import Axis
from mufe_fenicsx.synthetic.starter_scenes import KINDS
from tests.bodies import RADIUS, packed_grains
from tests.planning.samples import J2_ROCK, ROCK, point, sample, scene, staged


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
    # 3k/2 = (T/t)²/2 is 3 % from t = 4.08 T on.
    assert "targets from 41 % of the strain on" in "\n".join(lines_of_present(found, None))
    assert "targets from 41 % of the strain on" in "\n".join(lines(plan, None))
    coarse = present_state(scene(Rigid(**ROCK)), sample(0.1), table + hertz_table(table))
    assert math.isinf(coarse.error) and coarse.parts["fidelity"] == pytest.approx(0.5)
    text = "\n".join(lines_of_present(coarse, None))
    assert (
        "expected error  not known, as the mesh has 0.033 elements per contact radius, and with "
        "0.5, the coarsest measured, forces are 32 % off: here by more; known are loading 0.077 %"
    ) in text
    fast = replace(scene(), oedometer=Oedometer(0.1, 0.1 * wave / 2.0), mass_scaling=None)
    text = "\n".join(lines_of_present(present_state(fast, sample(1.0), table), None))
    assert "as loading takes 2 times as long as a wave takes through the sample, and" in text
    assert "known from 3 times on; known are mesh 8 %" in text
    assert "the report will trust no part of the test" in text
    # Targets lead the speed: nothing is known of where they are met.
    led = replace(slow, quasi_static=QuasiStatic(kinetic=0.01))
    assert "checks" not in "\n".join(lines_of_present(present_state(led, sample(1.0), table), None))


def test_several_samples_of_known_shape_count_with_their_mean(table):
    more = [
        replace(p, error=3 * p.error, command=p.command + " --set sample=2")
        for p in table
        if p.case == "sample"
    ]
    assert sample_errors(table + more).of_mesh(1.0) == pytest.approx(2 * 0.08, rel=1e-12)


def test_what_cannot_be_reached_is_refused_with_what_would(table):
    with pytest.raises(InputError, match=r'500 grains rigid.*"j2" would do'):
        plan_scene(scene(Rigid(**ROCK)), sample(1), 0.05, table + hertz_table(table))
    with pytest.raises(InputError, match=r"and not 1 \(error about 0.08\).*mesh.size = "):
        plan_scene(scene(), sample(1), 0.05, table, keep_mesh=True)
    with pytest.raises(InputError, match=r"accuracy = 0.004, expected more than 0.0071"):
        plan_scene(scene(), sample(1), 0.004, table)
    with pytest.raises(InputError, match=r"added = 0.5, expected at most 0.01"):
        plan_scene(scene(mass_scaling=MassScaling(0.5)), sample(1), 0.1, table)
    with pytest.raises(InputError, match=r'element = "p1", expected one of which'):
        averaged = [p for p in table if p.parameters.get("element") != "p1"]
        plan_scene(scene(solver=Solver(element="p1")), sample(1), 0.1, averaged)


def hertz_table(table):
    """The same errors for elastic contacts."""
    n_of_edges = elastic_radius(SAND, KNOWN_STRESS)
    return [
        *(replace(p, case="hertz") for p in table if p.case == "plastic-sphere"),
        *(
            point(e, 1.0, "sample", elements_per_diameter=n / n_of_edges, fidelity="elastic")
            for e, n in ((0.32, 0.5), (0.08, 1.0), (0.02, 2.0))
        ),
    ]


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


def test_grains_finer_than_any_that_are_known_have_a_plan(table):
    plan = plan_scene(scene(), sample(20.0), 0.05, table, keep_mesh=True)
    assert not plan.mesh_again and "the mesh at contacts" not in plan.driver


def test_a_plan_within_a_time_has_the_least_error_that_it_buys(monkeypatch):
    """Less time buys a larger error; less than all plans take is refused."""
    b = Benchmark(
        1, 500, 500_000, 150_000, 1e-3, 2.0, 1e-3, (0, 0), (0.0, 0.0), 0.0, 0.5e-9, 1e-9, 4e8
    )  # fmt: skip
    monkeypatch.setattr(planning, "benchmark", lambda *args, **options: b)
    monkeypatch.setattr(planning, "ACCURACIES", (0.03, 0.06, 0.12, 0.5))
    monkeypatch.setattr(planning, "read_sample", lambda folder: sample(1.0))
    found, seconds = [], 1e9
    for _ in range(2):
        plan, cost = plan_within(scene(), "grains", MPI.COMM_SELF, seconds)
        assert cost.wall_s <= seconds
        assert "not known before it is run" in "\n".join(lines(plan, cost))
        finer, shorter = plan.tets / 1000, plan.size / 20e-6
        assert cost == predict(follow(scene(), plan), b, finer, shorter)
        found.append(plan.error)
        seconds = 0.6 * cost.wall_s
    assert found[0] < found[1]
    with pytest.raises(InputError, match=r"cost = 1 s, expected at least .*, for an error of"):
        plan_within(scene(), "grains", MPI.COMM_SELF, 1.0)


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
    assert (
        line.startswith("predicted without the seating ")
        and f"actual {result['wall_s']:.3g} s" in line
    )
    # At 20 m/s the platen is far ahead of the first wave. A machine at work makes clocks useless.
    predicted = result["plan"]["predicted"]
    assert 0.6 < predicted["num_steps"] / result["num_steps"] < 1.7
    assert 0.7 < predicted["memory_bytes"] / result["peak_memory_bytes"] < 1.3
    # The plan of the planned scene is itself: a run that goes on finds the same.
    again, _ = planned_scene(stored, folder / "grains", comm, measure=False)
    assert again == stored


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_known_of_each_new_scene(kind, tmp_path):
    """Of tests that unload to nothing, and of stages that load nothing, too."""
    path = tmp_path / "scene.toml"
    path.write_text(KINDS[kind][0], encoding="utf-8")
    scene = load_scene(path)
    found, course = present_state(scene, sample(2)), course_of(scene)
    assert all(part.level > 0 for part in course.parts)
    if course.presses:
        assert 0 < found.time < math.inf and found.quasi_static_from > 0


@pytest.mark.parametrize("accuracy", [0.5, 0.1, 0.05])
def test_plans_are_quasi_static_in_the_loaded_half(accuracy, table):
    """However large the error that is allowed: k = (T/t)²/3 is 2 % at half of r ≥ 8.16 waves."""
    plan = plan_scene(scene(), sample(1.0), accuracy, table)
    assert plan.quasi_static_from <= 0.5 * (1 + 1e-9)
    # The speed that is named leaves a tenth, as the report allows, and no warning.
    (line,) = (text for text in plan.warnings if "will not trust" in text)
    better = float(re.search(r"; at (\S+) m/s", line)[1])
    told = replace(scene(), oedometer=Oedometer(0.1, 0.98 * better))
    found = present_state(told, sample(1.0), table)
    assert found.quasi_static_from == pytest.approx(UNTRUSTED, rel=0.05)
    assert not any("will not trust" in text for text in found.warnings)
    if accuracy == 0.5:  # the coarsest mesh; a larger error would change nothing
        assert plan.quasi_static_from == pytest.approx(0.5) and plan.driver.startswith("none")
