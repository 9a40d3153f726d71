"""An open run in a notebook: its table and its figures."""

import numpy as np
import pytest

import mufe_fenicsx
from mufe_fenicsx.errors import InputError
from tests.made_up_run import write_whole_run

#: What the scene of a made-up run lacks to be one.
OEDOMETER = "[oedometer]\nstrain = 0.1\nspeed = 1.0\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    write_whole_run(folder)
    scene = folder / "scene.toml"
    scene.write_text(scene.read_text() + OEDOMETER)
    return folder


def test_the_table_says_what_was_run(folder):
    html = mufe_fenicsx.open_run(folder)._repr_html_()
    assert html.count("<table>") == html.count("</table>") == 1
    assert "Made-up &lt;sand&gt; &amp; gravel" in html and "<sand>" not in html
    for words in ("finished", "strain 0.1, stress", "E = 100 GPa", "yields at 10 MPa", "friction"):
        assert words in html


def test_the_table_of_a_damaged_run_says_what_is_left(folder, tmp_path):
    (tmp_path / "history.csv").write_bytes((folder / "history.csv").read_bytes())
    (tmp_path / "scene.toml").write_text("[contact\n")
    html = mufe_fenicsx.open_run(tmp_path)._repr_html_()
    assert "strain 0.1, stress" in html and "finished" not in html and "material" not in html


def test_plot_draws_the_figures_of_the_report(folder):
    run = mufe_fenicsx.open_run(folder)
    axis = run.plot().axes[0]
    assert "strain" in axis.get_xlabel() and "MPa" in axis.get_ylabel()
    curves = [line.get_ydata() for line in axis.lines]
    stress = run.history["stress"].to_numpy() / 1e6
    assert any(np.isclose(np.max(y), stress.max(), rtol=1e-12) for y in curves if len(y))
    picture = run.plot("energies")._repr_png_()
    assert picture.startswith(b"\x89PNG") and len(picture) > 5000
    course = run.plot("course", grains=[12])
    assert any("grain 12" in text.get_text() for text in course.legends[0].get_texts())


def test_plot_refuses_in_one_line(folder, tmp_path):
    run = mufe_fenicsx.open_run(folder)
    with pytest.raises(InputError, match=r'^figure "forcess", expected one of stress-strain, .+'):
        run.plot("forcess")
    with pytest.raises(InputError, match="grain 3 is not in the run"):
        run.plot("course", grains=[3])
    (tmp_path / "history.csv").write_text("step,time\n")
    with pytest.raises(InputError, match=r"history\.csv has no (column|row)"):
        mufe_fenicsx.open_run(tmp_path).plot()
