"""What is left of the forces on a sample, between rough walls and under tools."""

import numpy as np
import pytest

from mufe_fenicsx.analysis import quasi_static, rows
from mufe_fenicsx.analysis.checks import check_run
from mufe_fenicsx.output.history import HistoryWriter
from mufe_fenicsx.report.curves import draw_compression
from mufe_fenicsx.report.source import Source
from tests.made_up_run import fake_history, set_balance, write_history, write_run

ROUND_OFF = 1e-12


def grades(history):
    return {check.name: check for check in check_run(history)}


def rough_ring(part=0.3):
    """A ring whose friction carries a part of the bottom force, and that friction [N]."""
    h = fake_history()
    h["force_z_max"] = (1 + part) * h["force_z_min"]
    return h, part * h["force_z_min"]


def test_friction_of_the_side_is_no_lack_of_balance():
    """F_top - F_bottom = A, the side's force: nothing is left. Without A: 2·0.3/2.3 of the mean."""
    h, side = rough_ring()
    set_balance(h, side)
    assert {check.grade for check in check_run(h)} == {"pass"}
    set_balance(h)
    found = grades(h)
    assert quasi_static.force_difference(h) == pytest.approx(0.6 / 2.3, rel=ROUND_OFF)
    assert found["platens"].grade == "warn" and found["trusted"].grade == "fail"
    assert "dynamic to its end: unbalanced force up to 26.09%" in found["trusted"].text.replace(
        "kinetic energy up to 0.33%, ", ""
    )


def test_a_run_that_lacks_the_balance_is_judged_by_its_energies():
    h, _ = rough_ring()
    for axis in "xyz":
        del h[f"unbalanced_{axis}"]
    found = grades(h)
    assert found["platens"].grade == "warn" and "not judged" in found["platens"].text
    assert found["trusted"].grade == "pass" and "forces not judged" in found["trusted"].text
    assert found["all"].grade == "warn"
    h["kinetic"][-2:] = h["elastic"][-2:] + h["plastic"][-2:]
    assert grades(h)["trusted"].grade == "fail"


def test_platens_alone_are_compared_in_a_run_that_lacks_the_balance(tmp_path):
    """The scene says whether sides are rough: only where they are smooth the rest is known."""
    h = write_run(tmp_path)
    columns = [name for name in h if not name.startswith("unbalanced")]
    with HistoryWriter(tmp_path / "history.csv", columns) as writer:
        writer.append({name: h[name][-1] if name != "stage" else "loading" for name in columns})
    walls = "".join(f"[walls.{a}_{e}]\nfriction = 0.0\n" for a in "xy" for e in ("min", "max"))
    for scene, known in ((walls, True), (walls.replace("0.0", "0.1", 1), False),
                         ("gravity = [0.0, 0.0, -9.81]\n" + walls, False)):  # fmt: skip
        (tmp_path / "scene.toml").write_text(scene)
        assert quasi_static.knows_balance(Source(tmp_path).history) == known


def tool_test(left=0.0):
    """A tool that presses askew by a force F along d; ``left`` of it is not balanced."""
    h = fake_history()
    n = len(h["step"])
    force, d = np.linspace(0.0, 10.0, n), np.array([0.6, 0.0, -0.8])
    h |= {"strain": np.zeros(n), "height": np.full(n, 1e-3)}
    h |= {"stage": np.full(n, "push"), "force_z_max": np.zeros(n), "force_z_min": 0.8 * force}
    h |= {f"turn_cone_{a}": np.zeros(n) for a in "xyz"}
    h |= {f"force_cone_{a}": -force * d[i] for i, a in enumerate("xyz")}  # of grains on the tool
    h |= {f"unbalanced_{a}": left * force * d[i] for i, a in enumerate("xyz")}
    internal = h["elastic"] + h["plastic"]
    h["kinetic"] = np.where(force > 4.9, 0.001, 400.0) * internal  # free before it is met
    return h, force


def test_a_test_led_by_a_tool_is_judged_by_its_force():
    h, force = tool_test(left=0.02)
    assert rows.load(h) == pytest.approx(force, rel=ROUND_OFF)
    assert np.array_equal(rows.counted_rows(h), force > 5.0)
    assert quasi_static.force_difference(h)[1:] == pytest.approx(0.02, rel=ROUND_OFF)
    found = grades(h)
    assert "platens" not in found and "load" not in found  # nothing of the platens is there
    assert found["trusted"].grade == found["tool"].grade == found["kinetic"].grade == "pass"
    found = grades(tool_test(left=0.05)[0])
    assert found["tool"].grade == "warn" and found["trusted"].grade == "fail"
    # A platen that moves leads the test, whatever tools there are beside.
    h["height"] = h["height"] * np.linspace(1.0, 0.99, len(force))
    assert rows.tool_load(h) is None and "platens" in grades(h)


def test_a_sample_that_still_seats_is_not_said_to_be_unloaded():
    h = fake_history()
    h = {name: values[h["stage"] == "seating"] for name, values in h.items()}
    texts = [check.text for check in check_run(h)]
    assert not any("never loaded" in text or "not known" in text for text in texts)
    assert any("has not gone beyond its seating" in text for text in texts)


def test_a_side_that_moves_makes_no_oedometer(tmp_path):
    """Its slope is no constrained modulus, and its ratio of stresses not that at rest."""
    h = write_run(tmp_path)
    assert "earth pressure at rest" in draw_compression(Source(tmp_path)).caption
    h["length_x"] = h["length_x"] * np.linspace(1.0, 1.001, len(h["step"]))
    write_history(tmp_path, h)
    assert "ratio of side to axial stress" in draw_compression(Source(tmp_path)).caption
