"""Reports of runs that lack something, of several runs, and of what may not be asked."""

import json
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output import run_folder
from mufe_fenicsx.report import list_figures, write_report
from mufe_fenicsx.results.columns import exact_csv
from tests.made_up_run import SCENE, fake_history, write_history, write_run, write_whole_run

pytestmark = pytest.mark.usefixtures("unpainted")


def test_missed_target_is_said(tmp_path):
    h = fake_history()
    h["kinetic"] = 0.1 * (h["elastic"] + h["plastic"])
    write_history(tmp_path, h)
    result = write_report(tmp_path, only=["quasi-static"])
    passed = {c["name"]: c["passed"] for c in result["checks"]}
    assert not passed["kinetic"] and passed["platens"] and not passed["residual"]
    assert not result["passed"]
    assert "at most 10.00%" in (tmp_path / "report.html").read_text()


def test_run_of_an_element_that_is_gone_has_a_report_without_energies_of_grains(tmp_path):
    write_whole_run(tmp_path, n=2)
    run = json.loads((tmp_path / "run.json").read_text()) | {"element": "composite", "family": 8}
    (tmp_path / "run.json").write_text(json.dumps(run))
    result = write_report(tmp_path, only=["energies-of-a-grain", "course"])
    assert any("element is 'composite', expected averaged or p1" in s for s in result["missing"])
    assert [Path(figure).stem for figure in result["figures"]] == ["course"]


def test_a_dynamic_first_half_is_said(tmp_path):
    """All targets of the loaded half are met, and yet half of the curve is not to be trusted."""
    h = fake_history()
    ratio = np.where(h["strain"] < 0.05, 0.2, 0.003)
    h["kinetic"] = ratio * (h["elastic"] + h["plastic"])
    write_history(tmp_path, h)
    result = write_report(tmp_path, only=["stress-strain"])
    (trusted,) = (c for c in result["checks"] if c["name"] == "trusted")
    assert trusted["since"] == pytest.approx(0.05, abs=1e-3) and trusted["grade"] == "warn"
    # Inertia acts in the first half, by energy that comes from nowhere.
    grades = {c["name"]: c["grade"] for c in result["checks"] if c["grade"] != "pass"}
    assert grades == dict.fromkeys(["all", "trusted", "kinetic", "residual"], "warn")
    assert "contacts" not in {c["name"] for c in result["checks"]}  # there are no tables of them
    page = (tmp_path / "report.html").read_text()
    assert (
        "Quasi-static from strain 0.0503 on. Before, in 50.25% of the strain, 100% of the" in page
    )
    h["kinetic"] = 0.2 * (h["elastic"] + h["plastic"])
    write_history(tmp_path, h)
    failed = [
        c for c in write_report(tmp_path, only=["stress-strain"])["checks"] if c["grade"] == "fail"
    ]
    assert [c["name"] for c in failed] == ["all", "trusted"] and failed[1]["since"] is None
    assert "Quasi-static nowhere" in (tmp_path / "report.html").read_text()


def test_coarse_contacts_are_said(tmp_path):
    """All of the force in contacts of 1.5 elements per radius, then in contacts of 0.5."""
    h = write_whole_run(tmp_path, n=2)
    found = {c["name"]: c for c in write_report(tmp_path, only=["forces"])["checks"]}
    assert found["contacts"]["grade"] == "pass" and found["contacts"]["largest"] == 0.0
    assert found["contacts"]["since"] == 0.0 and found["all"]["grade"] == "pass"
    page = (tmp_path / "report.html").read_text()
    # By the stored points between one and two elements per radius.
    assert re.search(r"of 1.50 is off by 4% where it flows and 2% where it is elastic", page)
    assert re.search(r"1 to 2</td><td>8</td><td>100.0%", page)  # of each four columns two contacts
    assert (
        "With 10.0 edges a diameter the stress of twenty grains of known shape is off by 8%" in page
    )
    text = (tmp_path / "run.json").read_text()
    (tmp_path / "run.json").write_text(
        text.replace('"edges_per_diameter": 10', '"edges_per_diameter": 4')
    )
    found = {c["name"]: c for c in write_report(tmp_path, only=["forces"])["checks"]}
    assert found["contacts"]["grade"] == found["all"]["grade"] == "warn"
    assert "grains are coarser than any whose error is known" in found["contacts"]["text"]
    (tmp_path / "run.json").write_text(text)
    for path in (tmp_path / "contacts").glob("patches_*.csv"):
        path.write_text(path.read_text().replace(",1.5,", ",0.5,"))
    h["elements_per_radius"] = 0.1 + 8 * np.maximum(h["strain"], 0)  # 0.6 at a strain of 0.0625
    write_history(tmp_path, h)
    found = {c["name"]: c for c in write_report(tmp_path, only=["forces"])["checks"]}
    check = found["contacts"]
    assert check["grade"] == "warn" and check["largest"] == 1.0
    assert check["since"] == found["all"]["since"] == pytest.approx(0.0625, abs=0.1 / 199)
    assert found["all"]["grade"] == "warn"
    text = (tmp_path / "report.html").read_text()
    lead = unescape(re.search(r'<p class="lead">(.*?)</p>', text)[1])
    assert "Trust it from strain 0.06" in lead and "that of mesh of contacts last" in lead
    (tmp_path / "contacts" / "patches_0002.csv").write_text("grain_a\n1\n")
    result = write_report(tmp_path, only=["forces"])
    assert any(s.startswith("No check of contacts: ") for s in result["missing"])
    assert "contacts" not in {c["name"] for c in result["checks"]}


def test_run_that_stopped_early(tmp_path):
    """A torn history and no states: curves, and a page that says what is not there."""
    write_history(tmp_path, fake_history())
    path = tmp_path / "history.csv"
    path.write_bytes(path.read_bytes()[:-9])
    result = write_report(tmp_path)
    assert len(result["figures"]) == 5  # those that need no states
    page = (tmp_path / "report.html").read_text()
    assert "run.json" in page and "no stored states" in page


def test_torn_states_and_absent_contacts(tmp_path):
    """A file cut in the middle: that state is left out and named, the others are drawn."""
    write_whole_run(tmp_path, n=2)
    torn = tmp_path / "fields" / "0002.vtkhdf"
    torn.write_bytes(torn.read_bytes()[: torn.stat().st_size // 2])
    (tmp_path / "contacts" / "contacts_0001.csv").unlink()
    names = ["stress-cut", "active-contacts", "course", "yield-initiation"]
    result = write_report(tmp_path, tmp_path / "out", only=names)
    drawn = [f["name"] for f in list_figures(tmp_path / "out")]
    assert sorted(drawn) == sorted(names)
    text = " ".join(result["missing"])
    assert "0002.vtkhdf cannot be read" in text and "contacts of state 1" in text
    course = exact_csv(tmp_path / "out" / "figures" / "yield-initiation-share.csv")
    assert course["strain [-]"].tolist() == [0.0, 0.05]
    assert not (tmp_path / "report.html").exists()


def test_a_run_that_still_seats(tmp_path):
    """Its report has the page and says which figures wait for the loading."""
    write_run(tmp_path, (1, 1, 2), 2, 2)
    h = fake_history(20)
    h["stage"] = np.full_like(h["stage"], "seating")
    write_history(tmp_path, h)
    result = write_report(tmp_path, only=["forces", "stress-strain"])
    assert "The loading stage: history.csv has no row of it." in result["missing"]
    assert "Oedometer test" in (tmp_path / "report.html").read_text()


def test_two_runs_in_one_report(tmp_path):
    h = []
    for k in range(2):
        folder = tmp_path / f"run{k}"
        folder.mkdir()
        h.append(fake_history(60))
        h[k]["stress"] = (1 + k) * h[k]["stress"]
        h[k]["kinetic"] = (1 + 999 * k) * h[k]["kinetic"]  # the second is far from quasi-static
        write_history(folder, h[k])
        (folder / "scene.toml").write_text(SCENE.replace("1e7", f"{k + 1}e7"))
    result = write_report([tmp_path / "run0", tmp_path / "run1"])
    out = tmp_path / "comparison"
    assert result["report"] == str(out / "report.html") and len(result["figures"]) == 4
    page = (out / "report.html").read_text()
    assert "yield 10 MPa" in page and "yield 20 MPa" in page
    assert "Worst of 2 runs: yield 20 MPa; 1 of them miss the target" in page
    against = exact_csv(out / "figures" / "runs-parameter.csv").to_numpy()
    assert against[:, 0].tolist() == [1e7, 2e7]
    assert against[1, 1:] == pytest.approx(2 * against[0, 1:])  # one is twice the other throughout
    for k, name in enumerate(("yield-10-MPa", "yield-20-MPa")):
        table = exact_csv(out / "figures" / f"runs-stress-strain-{name}.csv")
        rows_of = h[k]["stage"] != "seating"
        assert np.array_equal(table["vertical stress [Pa]"], h[k]["stress"][rows_of])
    with pytest.raises(InputError, match="given twice"):
        write_report([tmp_path / "run0", tmp_path / "run0"])
    runs, some = [tmp_path / "run0", tmp_path / "run1"], tmp_path / "some"
    result = write_report(runs, some, only=["runs-forces", "runs-energies"], skip=["runs-forces"])
    assert [Path(figure).stem for figure in result["figures"]] == ["runs-energies"]
    with pytest.raises(InputError, match="forces is one of a single run, expected runs-forces"):
        write_report(runs, some, only=["forces"])
    with pytest.raises(InputError, match="runs-forces is one of several runs, expected forces"):
        write_report(runs[:1], some, only=["runs-forces"])


def test_unknown_grain_or_place_is_refused_before_anything_is_written(tmp_path):
    write_run(tmp_path, (1, 1, 2), 2, 1)
    for options in ({"grains": [99]}, {"points": [[1.0, 0.0, 0.0]]}):
        with pytest.raises(InputError, match=r"grain 99 is not|is in no grain"):
            write_report(tmp_path, tmp_path / "out", **options)
    with pytest.raises(InputError, match="figure forcs is not known, expected forces"):
        write_report(tmp_path, tmp_path / "out", only=["forcs"])
    assert not (tmp_path / "out").exists()


def test_only_states(tmp_path):
    write_run(tmp_path, (1, 1, 2), 2, 1, finished=False)
    (tmp_path / "history.csv").unlink()
    result = write_report(tmp_path, only=["stress-cut", "forces"])
    assert len(result["figures"]) == 1 and not result["passed"]
    page = (tmp_path / "report.html").read_text()
    assert "history.csv" in page and "interrupted" in page


def test_without_graphics(tmp_path, monkeypatch):
    """Where nothing can be rendered the page says so and shows the rest."""
    monkeypatch.setattr("mufe_fenicsx.report.source.start_probe", lambda: None)
    monkeypatch.setattr("mufe_fenicsx.report.source.cannot_render", lambda probe: "no driver")
    write_run(tmp_path, (1, 1, 2), 2, 2)
    write_report(tmp_path, only=["stress-cut", "stress-3d", "chosen-grains", "animation"])
    drawn = {f["name"] for f in list_figures(tmp_path)}
    assert "stress-cut" in drawn and not drawn & {"stress-3d", "chosen-grains", "animation"}
    assert "no 3D pictures: no driver" in (tmp_path / "report.html").read_text()


def test_grains_that_failed_are_named(tmp_path):
    """By the mesher's table where the run does not list them."""
    run_folder.write_run_json(tmp_path, {"title": "t", "finished": True, "num_grains": 1})
    (tmp_path / "quality.csv").write_text("label,status\n3,ok\n8,failed\n11,failed\n")
    write_report(tmp_path, only=["forces"])
    assert "2, not in the test: 8, 11" in (tmp_path / "report.html").read_text()


def test_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(InputError, match="none of run"):
        write_report(tmp_path)
    with pytest.raises(InputError, match="absent"):
        write_report(tmp_path / "nothing")
