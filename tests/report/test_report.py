"""The report of a made-up run that lacks nothing: page, figures, files, data."""

import re

import numpy as np
import pytest
from PIL import Image

import mufe_fenicsx
from mufe_fenicsx.output import run_folder
from mufe_fenicsx.report import list_figures, write_report
from mufe_fenicsx.results.columns import exact_csv
from tests.made_up_run import write_whole_run

ROUND_OFF = 1e-12


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    h = write_whole_run(folder)
    return folder, h, write_report(folder, folder / "out", processes=2)


@pytest.fixture(scope="module")
def reported_page(reported):
    return (reported[0] / "out" / "report.html").read_text()


def test_page_holds_all_figures_and_nothing_from_outside(reported, reported_page):
    folder, _, result = reported
    page = reported_page
    rendered = not any("3D pictures" in sentence for sentence in result["missing"])
    assert len(result["figures"]) == (21 if rendered else 16)
    if rendered:
        assert result["missing"] == []
    assert page.count('src="data:image/') == len(result["figures"])
    assert not re.search(r"https?:|file:|\ssrc=(?!\"data:image/)|<link|url\(|@import", page)
    assert "default-src 'none'" in page and "eval(" not in page
    assert str(folder) not in page
    assert "Made-up &lt;sand&gt; &amp; gravel" in page


def test_numbers_of_the_page_are_those_of_the_history(reported, reported_page):
    folder, h, result = reported
    page = reported_page
    largest = h["stress"].max() / 1e6
    assert f"{largest:.4g} MPa" in page
    assert f"{h['force_z_max'].max():.4g} N" in page
    assert "2 nodes" not in page and "120 nodes were inside a neighbour" in page
    speed = run_folder.read_run_json(folder)["num_cells"] * h["step"][-1] / 100.0 / 1e6
    assert f"{speed:.3g} million element-steps a second" in page
    checks = {c["name"]: c for c in result["checks"]}
    assert checks["residual"]["largest"] == pytest.approx(0.0005, rel=1e-9)
    assert result["passed"]
    assert page.count("✓ pass") == 12
    assert checks["trusted"]["since"] == 0.0 and checks["trusted"]["largest"] == 0.0
    # All contacts of the lattice have 1.5 elements per radius.
    assert "half of it 1.50, nine tenths 1.50" in page


def test_figures_are_not_empty(reported):
    for path in reported[2]["figures"]:
        image = np.asarray(Image.open(path).convert("RGB"))
        # A picture for print (300 dpi, at least a column of 84 mm wide) with some ink in it.
        assert image.shape[1] >= (700 if path.endswith("gif") else 84 / 25.4 * 300 - 1)
        assert (image.min(axis=2) < 0.5 * image.max()).mean() > 1e-3


def test_each_figure_has_its_files_and_its_list(reported):
    folder = reported[0] / "out"
    listed = list_figures(folder)
    assert [str(folder / "figures" / f["image"]) for f in listed] == reported[2]["figures"]
    for figure in listed:
        assert figure["caption"] and figure["how"] and figure["data"]
        for name in (*figure["data"], figure["vector"] or figure["image"]):
            assert (folder / "figures" / name).stat().st_size > 0
    # Pictures of bodies in space have no vector file.
    flat = {f["name"] for f in listed if f["vector"]}
    space = {"stress-3d", "chosen-grains", "force-chains", "displacement-split", "animation"}
    assert flat == {f["name"] for f in listed} - space


def test_data_beside_the_figures_are_those_of_the_run(reported):
    folder, h, _ = reported
    run = mufe_fenicsx.open_run(folder)

    def data(name):
        return exact_csv(folder / "out" / "figures" / f"{name}.csv")

    table = data("stress-strain")
    assert np.array_equal(table["vertical stress [Pa]"], h["stress"])
    assert np.array_equal(table["strain [-]"], h["strain"])
    curves = run.curves()
    loading = (curves["stage"] != "seating").to_numpy()
    found = data("compression")["K0 [-]"].to_numpy()
    assert found == pytest.approx(curves["K0"][loading].to_numpy(), rel=ROUND_OFF)
    assert data("active-contacts-state2")["active contacts [-]"].tolist() == (
        run.grains(2)["num_active_contacts"].tolist()
    )
    assert data("active-contacts-mean")["mean of all grains [-]"].tolist() == (
        run.network()["N_cA"].tolist()
    )
    grains, parts = run.grain_table(), data("displacement-split")
    for ours, theirs in (
        ("translation z [m]", "translation_z"),
        ("by strain [m]", "misfit"),
        ("shear strain [-]", "shear_strain"),
    ):
        scale = grains[theirs].abs().max()
        assert np.abs(parts[ours] - grains[theirs]).max() < 1e-9 * scale  # rounding of both
    table = data("table-1-inertia")
    first = table[table["strain [-]"] == 0].set_index("grain")
    for label, row in first.iterrows():
        mine = grains[grains["grain"] == label].iloc[0]
        assert row["I_1 [kg m²]"] == pytest.approx(2650 * mine["inertia_1"], rel=1e-9, abs=0.0)
        assert row["N_cA [-]"] == run.grains(0).set_index("grain")["num_active_contacts"][label]
    label = int(table["grain"][0])
    course = data(f"course-grain-{label}-most-loaded")
    assert course["von Mises stress [Pa]"].tolist() == (
        run.probe(grains=[label])["von_mises"].tolist()
    )
