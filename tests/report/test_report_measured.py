"""Measured curves in reports: drawn beside those of the run, and the difference in a table."""

import numpy as np
import pandas
import pytest

from mufe_fenicsx.cli.main import main
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style, write_report
from mufe_fenicsx.report.source import Source
from mufe_fenicsx.report.triaxial import draw_triaxial
from mufe_fenicsx.results import Run
from tests.made_up_run import SCENE, write_whole_run
from tests.report.test_report_axes import legends_beside_axes
from tests.report.test_report_stages import staged_history, write_staged_run


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run that lacks nothing, and its curves with stresses over 1.1 as a laboratory has them."""
    folder = tmp_path_factory.mktemp("measured") / "run"
    folder.mkdir()
    write_whole_run(folder, n=2)
    curves = Run(folder).curves().assign(stress=Run(folder).history["stress"])
    curves = curves[curves["stage"] == "loading"]
    columns = {
        "strain [%]": 100 * curves["strain"],
        "stress [MPa]": curves["stress"] / 1.1e6,
        "void_ratio [-]": curves["void_ratio"],
        "k0 [-]": curves["K0"],
    }
    pandas.DataFrame(columns).to_csv(folder.parent / "lab.csv", index=False)
    return folder


def test_a_scaled_curve_of_its_own_is_off_by_its_scale(run, unpainted):
    """As overlay, in figures, table, file and result; then as that of the scene."""
    lab = run.parent / "lab.csv"
    only = ["stress-strain", "compression"]
    result = write_report(run, only=only, overlays=[lab])
    found = {(d["quantity"], d["branch"]): d for d in result["differences"]}
    assert set(found) == {(what, "loading") for what in ("stress", "void_ratio", "k0")}
    # Only rounding remains: the measured points are rows of the run.
    assert found["stress", "loading"]["mean"] == pytest.approx(0.1, abs=1e-12)
    assert found["stress", "loading"]["largest"] == pytest.approx(0.1, abs=1e-12)
    table = pandas.read_csv(run / "figures" / "differences.csv")
    assert table["mean"].tolist() == [d["mean"] for d in result["differences"]]
    drawn = pandas.read_csv(run / "figures" / "stress-strain-measured-lab.csv")
    np.testing.assert_allclose(
        drawn["vertical stress [Pa]"], 1e6 * pandas.read_csv(lab)["stress [MPa]"], rtol=1e-12
    )
    page = (run / "report.html").read_text()
    assert "Beside measured curves" in page and "+10.0 %" in page
    assert "Black with markers: measured." in page

    (run / "scene.toml").write_text(f'{SCENE}[[reference]]\nfile = "{lab}"\nname = "sand"\n')
    of_scene = write_report(run, only=only)["differences"]
    assert [d | {"reference": "lab"} for d in of_scene] == result["differences"]
    (run / "scene.toml").write_text(f'{SCENE}[[reference]]\nfile = "{run}/gone.csv"\n')
    result = write_report(run, only=only)
    assert result["differences"] == [] and not (run / "figures" / "differences.csv").exists()
    assert any(line.startswith("Measured curves: ") for line in result["missing"])
    (run / "scene.toml").write_text(SCENE)


def test_several_runs_have_one_table(run, tmp_path, unpainted):
    other = tmp_path / "other"
    other.mkdir()
    write_whole_run(other, n=2)
    lab = run.parent / "lab.csv"
    result = write_report(
        [run, other], tmp_path / "both", only=["runs-stress-strain"], overlays=[lab]
    )
    assert [d["run"] for d in result["differences"]] == ["run"] * 3 + ["other"] * 3
    assert (tmp_path / "both" / "figures" / "runs-stress-strain-measured-lab.csv").exists()


def test_an_overlay_that_is_no_use_is_one_line(run, tmp_path, capfd):
    path = tmp_path / "lab.csv"
    for text, said in (
        ("strain [%], stress\n0, 1\n", "stress has no unit"),
        ("strain [%], stress [MPa]\n20, 1\n30, 2\n", "expected points in the range of the run"),
    ):
        path.write_text(text)
        with pytest.raises(SystemExit) as end:
            main(["report", str(run), "-o", str(tmp_path / "page"), "--overlay", str(path)])
        lines = capfd.readouterr().err.splitlines()
        assert end.value.code == 2 and len(lines) == 1 and said in lines[0]
    assert not (tmp_path / "page").exists()
    with pytest.raises(InputError, match="cannot be read"):
        write_report(run, overlays=[tmp_path / "absent.csv"])
    with pytest.raises(InputError, match=r"overlays are named lab, lab, expected names that"):
        write_report(run, overlays=["a/lab.csv", "b/lab.csv"])


def test_a_test_by_stages_has_its_path_beside_the_measured_one(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    write_staged_run(folder, staged_history(), [0, 0, 0])
    lab = tmp_path / "lab.csv"
    lab.write_text("p [kPa], q [kPa]\n100, 0\n150, 150\n")
    with style.look():
        drawing = draw_triaxial(Source(folder, overlays=[lab]))
        assert legends_beside_axes(drawing.figure)
    assert drawing.tables["measured-lab-p-q"]["deviator stress [Pa]"].tolist() == [0, 1.5e5]
    assert "lab" in [text.get_text() for text in drawing.figure.legends[0].get_texts()]
