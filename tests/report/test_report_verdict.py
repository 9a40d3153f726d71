"""What the head of the page says: one verdict, the strictest of all checks."""

import re
from html import unescape

import numpy as np
import pytest

from mufe_fenicsx.analysis import checks, rows
from mufe_fenicsx.analysis.carriers import find_carriers
from mufe_fenicsx.analysis.cycles import find_cycles
from mufe_fenicsx.analysis.held import lack_of_stress
from mufe_fenicsx.geometry.form.proportions import median_diameter
from mufe_fenicsx.report import write_report
from mufe_fenicsx.report.parameters import _of_image, to_latex
from mufe_fenicsx.results.columns import exact_csv
from tests.made_up_run import fake_history, write_history, write_whole_run
from tests.report.test_report_stages import staged_history

ROUND_OFF = 1e-12


def tables(contacts, centres):
    """Tables of contacts (grain a, grain b or wall, place, force on a [N]) and of grains."""
    names = ("grain_a", "grain_b", "wall", "num_points", "normal_force")
    found = {name: [] for name in names} | {f"{n}_{a}": [] for n in ("force", "centroid")
                                            for a in "xyz"}  # fmt: skip
    for a, b, place, f in contacts:
        wall = b if isinstance(b, str) else ""
        row = {"grain_a": a, "grain_b": 0 if wall else b, "wall": wall, "num_points": 3}
        row |= {"normal_force": abs(f), "force_x": 0.0, "force_y": 0.0, "force_z": f}
        row |= {f"centroid_{axis}": x for axis, x in zip("xyz", place, strict=True)}
        for name, value in row.items():
            found[name].append(value)
    centres = np.asarray(centres, dtype=float)
    grains = {"grain": np.arange(1, len(centres) + 1)}
    grains |= {f"center_{a}": centres[:, i] for i, a in enumerate("xyz")}
    return {name: np.array(values) for name, values in found.items()}, grains


def heap(num_columns, height, idle=20):
    """Columns of balls of diameter 1 between platens, 1 N each, and balls that touch nothing."""
    contacts, centres = [], []
    for c in range(num_columns):
        first = 1 + c * height
        contacts.append((first, "z_min", (c, 0, 0), 1.0))
        contacts += [
            (k, k + 1, (c, 0, k - first + 1), -1.0) for k in range(first, first + height - 1)
        ]
        contacts.append((first + height - 1, "z_max", (c, 0, height), -1.0))
        centres += [(c, 0, k + 0.5) for k in range(height)]
    return tables(contacts, centres + [(9, 9, k) for k in range(idle)])


def test_who_carries_the_load():
    """Half of the load is in half of equal columns; a third of them is a third of it."""
    found = find_carriers(*heap(6, 3))
    assert (found.num_grains, found.num_idle, found.num_half) == (38, 20, 9)
    assert found.most == pytest.approx(1 / 18, rel=ROUND_OFF)
    assert found.bridging == () and found.bridged == 0.0 and found.doubtful is None
    assert find_carriers(*heap(0, 3)) is None
    doubted = find_carriers(*heap(6, 3), doubted=[(2, 1), (5, 4), (1, 5)])
    assert doubted.doubtful == pytest.approx(2 / 12, rel=ROUND_OFF)  # of twelve contacts two


def test_a_grain_from_platen_to_platen_is_said():
    """One of 21 grains is a column by itself: it carries all, and all that the walls press."""
    h = fake_history()
    found = find_carriers(*heap(1, 1))
    assert found.bridging == (1,) and found.bridged == 1.0 and found.num_half == 1
    graded = {c.name: c for c in checks.check_run(h, sample=(found, 1.9))}
    assert [c for c in graded if graded[c].grade != "pass"] == [
        "all",
        "carriers",
        "bridges",
        "height",
    ]
    assert graded["all"].text.startswith("Trust no part of the test")
    good = {c.name: c for c in checks.check_run(h, sample=(find_carriers(*heap(6, 3)), 6.0))}
    assert {c.grade for c in good.values()} == {"pass"}
    assert good["all"].text.startswith("Trust it from")
    # Two balls are a test of a contact, and no sample that is too small.
    assert not checks.check_sample(h, find_carriers(*heap(1, 2, idle=0)), 1.9)


def test_half_of_the_volume_is_finer_than_the_median_diameter():
    volumes = np.pi / 6 * np.array([1.0, 1.0, 2.0, 3.0]) ** 3
    assert median_diameter(volumes) == pytest.approx(3.0, rel=ROUND_OFF)
    assert median_diameter(volumes[:3]) == pytest.approx(2.0, rel=ROUND_OFF)


def servo(off):
    """A staged test whose side is to carry 5 MPa, and is off by a part that grows with strain."""
    h = staged_history((0.0, 0.02, 0.03, 0.05))
    done = h["strain"] / h["strain"].max()
    target = np.full(len(done), 5e6)
    h |= {f"target_{a}": target if a == "x" else 0 * target for a in "xyz"}
    return h | {
        "stress_x": target * (1 + off * done),
        "stress_y": 0 * target,
        "stress_z": h["stress"],
    }


def test_a_servo_that_lags_is_said():
    """44 % off at the end; what is not asked for counts for nothing."""
    assert lack_of_stress(servo(0.44))[-1] == pytest.approx(0.44, rel=ROUND_OFF)
    found = {off: {c.name: c for c in checks.check_run(servo(off))}["held"] for off in (0.44, 0.04)}
    assert [check.grade for check in found.values()] == ["warn", "pass"]
    assert found[0.44].row is None and "the servo lags" in found[0.44].text
    assert "held" not in {c.name for c in checks.check_run(fake_history())}
    # Nor does a stress that the seating alone held.
    h = servo(0.04)
    h["stage"] = np.where(h["step"] < 5, "seating", h["stage"])
    h["target_x"][rows.loading_rows(h)] = 0.0
    assert h["target_x"].any()
    assert "held" not in {c.name for c in checks.check_run(h)}


def test_a_single_row_decides_nothing():
    """One row beyond a target in the middle, and one at the end; two do."""
    for count, since in ((1, 0.0), (2, None)):
        h = fake_history()
        h["switching"][-count:] = 0.1 * h["work"].max()
        found = {c.name: c for c in checks.check_run(h)}["switching"]
        assert (
            found.passed == (since == 0.0) and checks.holds_from([found], h)["switching"] == since
        )


def test_where_checks_hold_names_its_stage():
    h = servo(0.0)
    late = np.flatnonzero(h["stage"] == "unload")[4]
    h["overlap"] = np.where(np.arange(len(h["step"])) < late, 0.02, 0.0)
    found = checks.holds_from(checks.check_run(h), h)["overlap"]
    assert found == {"stage": "unload", "strain": h["strain"][late], "time": h["time"][late]}


def test_what_is_before_strain_zero_is_no_cycle():
    """A stage of extension, then strain is set to zero: loops are those since then."""
    h = staged_history((0.0, -0.02, -0.02, 0.02))
    h = {name: np.concatenate([values, values[::-1][: 2 * 40]]) for name, values in h.items()}
    h["strain"], before = h["strain"].copy(), h["stage"] == "load"
    before[40:] = False
    h["stage"] = np.repeat(["load", "a", "b", "c", "d"], 40)
    up = np.linspace(0, 0.02, 40)
    h["strain"] = np.concatenate([-up, up, up[::-1], up, up[::-1]])
    h["height"] = np.where(before, 1e-4, 1.02e-4) * (1 - h["strain"])
    h |= {f"strain_{axis}": h["strain"] for axis in "xyz"} | {"time": 1e-6 * np.arange(200)}
    assert np.array_equal(rows.loading_rows(h), ~before)
    loading = {name: values[rows.loading_rows(h)] for name, values in h.items()}
    cycles = find_cycles(loading["strain"], loading["stress"])
    assert len(cycles) == 1 and loading["strain"][cycles[0].start] == pytest.approx(0.02)


def test_rows_that_wait_are_told():
    """Strain stays at the end of a stage: the first such row is where it is reached."""
    h = servo(0.0)
    stay = np.flatnonzero(h["stage"] == "load")[-10:]
    for name in ("strain", "strain_x", "strain_y", "strain_z", "height"):
        h[name] = h[name].copy()
        h[name][stay] = h[name][stay[0]]
    assert np.flatnonzero(rows.waiting_rows(h)).tolist() == stay[1:].tolist()
    assert not rows.waiting_rows(fake_history()).any()


@pytest.mark.usefixtures("unpainted")
def test_the_page_has_one_verdict_and_its_parameters(tmp_path):
    """The head has the sentence of the first check; parameters are in CSV and LaTeX too."""
    h = write_whole_run(tmp_path, n=2)
    h["overlap"] = np.full(len(h["step"]), 0.02)
    write_history(tmp_path, h)
    (tmp_path / "labels.png").write_bytes(b"png")
    result = write_report(tmp_path, only=["stress-strain"])
    page = (tmp_path / "report.html").read_text()
    lead = unescape(re.search(r'<p class="lead">(.*?)</p>', page)[1])
    assert result["checks"][0]["text"] in lead and "Trust no part" in lead and "overlap" in lead
    assert "Trusted from" not in page and "Scan and labels" in page
    table = exact_csv(tmp_path / "figures" / "parameters.csv").set_index("parameter")["value"]
    assert table["Material"] == "j2, E = 100 GPa, ν = 0.15, ρ = 2650 kg/m³"
    assert table["Friction between grains"] == "0.5" and table["Grains"] == "12"
    image = {"image": {"crop": [[20, 90], [180, 330], [0, 120]]}}
    assert ("Crop of the image", "x 0–120, y 180–330, z 20–90 voxels") in _of_image(image)
    latex = (tmp_path / "figures" / "parameters.tex").read_text()
    assert latex.count(r"\\") == len(table) + 1 and r"$\rho$ = 2650 kg/m$^3$" in latex
    assert to_latex([("a_b & 5 %", "{1}")]).splitlines()[4] == r"a\_b \& 5 \% & \{1\} \\"
