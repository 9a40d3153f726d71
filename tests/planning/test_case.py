"""Plans of verification cases: the cheapest point within an accuracy."""

import json
import math

import pytest

from mufe_fenicsx.analysis import evidence
from mufe_fenicsx.analysis.evidence import command_of
from mufe_fenicsx.cli.main import main
from mufe_fenicsx.cli.plan import CASES
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.planning.case import expected_error, plan_case, settled
from tests.planning.samples import point


def on_meshes(errors):
    """Points on meshes of n elements that take n³ seconds, {n: error}, and the same elsewhere."""
    on = [point(e, n**3, elements_per_radius=n) for n, e in errors.items()]
    return on, {p.command: everywhere(p.error) for p in on}


def everywhere(error):
    """The same error at two Poisson's ratios."""
    return {"nu": {0.1: error, 0.3: error}}


@pytest.mark.parametrize("case", ["hertz", "mindlin", "impact", "plastic-sphere", "jammed"])
def test_plans_are_near_the_front_of_what_is_within_everywhere(case):
    """The cheapest point within the accuracy in the table and at all parameters that are known.

    An error that grows again on a finer mesh counts as that: it was small by chance. A plan that
    knows no parameters can do no better but by luck. 1.5 times is what it may cost.
    """
    own = evidence.usable(evidence.read_points(), case)
    elsewhere = settled(own, evidence.read_elsewhere())

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


@pytest.mark.parametrize("case", CASES)
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


@pytest.mark.parametrize(
    ("value", "told"),
    [("0 Pa", "modulus = 0.0, expected > 0 Pa"), ("1 m", "modulus"), ("3e8", "grains")],
)
def test_a_modulus_is_read_as_the_key_of_a_scene(value, told, tmp_path, capfd):
    path = tmp_path / "a.toml"
    path.write_text(
        '[material]\nmodel = "elastic"\nE = "1 GPa"\nnu = 0.2\nrho = 2650\n'
        "[contact]\nfriction = 0.5\n[oedometer]\nstrain = 0.1\nspeed = 1.0\n"
    )
    for scene in (str(path), "hertz"):
        with pytest.raises(SystemExit) as end:
            main(["plan", scene, "--modulus", value])
        assert end.value.code == 2
        line = capfd.readouterr().err
        assert (told if scene != "hertz" else "with a case") in line and line.count("\n") == 1, line
