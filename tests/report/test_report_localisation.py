"""Localisation in a report and for ParaView: a made-up band in a cylinder, even strain in a box."""

import json
import shutil

import matplotlib
import numpy as np
import pytest
import pyvista

import mufe_fenicsx
from mufe_fenicsx.container import CYLINDER
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output import fields, history, run_folder
from mufe_fenicsx.output.contacts import ContactWriter
from mufe_fenicsx.report import localisation, style, write_report
from mufe_fenicsx.report.figure import save
from mufe_fenicsx.report.paraview import write_paraview
from mufe_fenicsx.report.source import Source
from mufe_fenicsx.results.columns import exact_csv
from mufe_fenicsx.results.localisation import judge
from tests.analysis.test_localisation import D, band_motion
from tests.made_up_run import ball, write_run
from tests.networks import lattice_network
from tests.report.test_report_stages import staged_history

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)

RADIUS, HEIGHT = 3 * D, 10 * D
NORMAL, PLACE, WIDTH = np.array([0.6, 0.64, 0.48]), np.array([0, 0, 5 * D]), 2.5 * D


def write_cylinder(folder, fineness=1):
    """Balls in a cylinder that slide by simple shear in an inclined band; one also turns."""
    rng, parts, grain = np.random.default_rng(7), [], []
    n = np.arange(-3, 3) + 0.5
    places = np.stack(np.meshgrid(n, n, np.arange(10) + 0.5, indexing="ij"), -1).reshape(-1, 3)
    places = D * (places[np.hypot(*places[:, :2].T) < 2.9] + 0.2 * rng.uniform(-1, 1, 3))
    places += 0.15 * D * rng.uniform(-1, 1, places.shape)
    x, tets = ball(fineness, 0.5 * D, rng)
    for k, place in enumerate(places):
        parts.append((x + place, tets + k * len(x)))
        grain += [k + 1] * len(tets)
    points, cells = (np.concatenate(p) for p in zip(*parts, strict=True))
    moved = band_motion(places, NORMAL, PLACE, WIDTH, 0.4) - places
    moved = np.repeat(moved, len(x), axis=0)
    turned = 100  # this one, by a right angle about z
    nodes = slice(turned * len(x), (turned + 1) * len(x))
    arm = points[nodes] - points[nodes].mean(axis=0)
    moved[nodes] += arm @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]]) - arm
    h = staged_history((0.0, 0.02, 0.03, 0.1))
    count = len(h["step"])
    h |= {"force_side": np.ones(count), "diameter": np.full(count, 2 * RADIUS)}
    h |= {"height": HEIGHT * (1 - h["strain"]), "stress_r": np.full(count, 1e6)}
    h |= {"stress_z": h["stress"], "strain_r": -0.3 * h["strain"], "strain_z": h["strain"]}
    columns = [*history.history_columns(CYLINDER), "stress_r", "stress_z", "strain_r", "strain_z"]
    with history.HistoryWriter(folder / "history.csv", columns) as writer:
        for i in range(count):
            writer.append({n: str(h[n][i]) if n == "stage" else h[n][i] for n in columns})
    writer = fields.FieldWriter(MPI.COMM_SELF, folder, points, cells, np.array(grain))
    values = {"von_mises": np.ones(len(cells)), "plastic_strain": np.zeros(len(cells))}
    for index, at in enumerate((0, -1)):
        listed = h["time"][at], h["strain"][at], h["stage"][at]
        writer.write(index, *listed, {"displacement": index * moved}, values)
    note = {"shape": "cylinder", "centre": [0.0, 0.0], "radius": RADIUS}
    summary = {"num_grains": len(places), "num_cells": len(cells), "container": note}
    run_folder.write_run_json(folder, summary | {"finished": True})
    return turned + 1


@pytest.fixture(scope="module")
def cylinder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cylinder")
    return folder, write_cylinder(folder)


def test_a_band_in_a_cylinder_is_found_from_stored_states(cylinder):
    folder, turned = cylinder
    table = mufe_fenicsx.open_run(folder).localisation()
    found = judge(table)
    assert found.is_band and found.num_grains == len(table)
    assert abs(found.band.normal @ NORMAL) > np.cos(np.radians(5))
    assert found.band.width == pytest.approx(WIDTH, abs=D)
    assert abs((found.band.middle - PLACE) @ NORMAL) < 0.5 * D
    # Grains only move: beside the band none turns beyond its neighbours but the one that does.
    row = table[table["grain"] == turned].iloc[0]
    assert row["angle"] == pytest.approx(np.pi / 2, abs=1e-9)
    assert table["excess"].drop(row.name).max() < 0.4 < row["excess"]
    # Shear keeps volumes, but for cells that the edges of the band cross.
    assert np.abs(table["strain_volume"]).mean() < 0.01


def test_a_round_run_whose_container_is_not_known_is_refused_in_a_line(cylinder, tmp_path):
    folder = shutil.copytree(cylinder[0], tmp_path / "run")
    ContactWriter(MPI.COMM_SELF, folder).write(0, 0.0, lattice_network(1.0))
    run = mufe_fenicsx.open_run(folder)
    assert len(run.stresses()) == 1
    told = json.loads((folder / "run.json").read_text())
    run_folder.write_run_json(folder, {k: v for k, v in told.items() if k != "container"})
    with pytest.raises(InputError, match=r"run\.json has no container, expected its shape and"):
        mufe_fenicsx.open_run(folder).stresses()


def test_its_figure_has_the_section_of_the_band_and_says_so(cylinder, tmp_path):
    folder, _ = cylinder
    with matplotlib.rc_context(style.RC):
        drawing = localisation.draw_localisation(Source(folder))
    axes = drawing.figure.axes
    angle, words = axes[0].get_xlabel().split("° ")
    exact = np.degrees(np.arctan2(NORMAL[1], NORMAL[0]))
    assert float(angle) == pytest.approx(exact, abs=7) and words == "from x: mm"
    assert [line.get_linestyle() for line in axes[0].get_lines()] == ["--", "--"]
    assert np.ptp(axes[0].get_xlim()) == pytest.approx(2 * RADIUS * 1e3)
    assert "a band, between the dashed lines" in drawing.how
    picture = save(drawing, tmp_path)
    assert picture.image.stat().st_size > 10_000 and picture.vector.exists()
    table = exact_csv(picture.data[0])
    assert table["strain deviator [-]"].max() > 0.15 and "excess [rad]" in table


def test_even_strain_in_a_box_has_no_band(tmp_path):
    write_run(tmp_path, (5, 3, 5), 1, 3)
    with matplotlib.rc_context(style.RC):
        drawing = localisation.draw_localisation(Source(tmp_path))
    assert "no band" in drawing.how and not drawing.figure.axes[0].get_lines()
    table = mufe_fenicsx.open_run(tmp_path).localisation()
    assert table["strain_zz"].to_numpy() == pytest.approx(-np.log(0.9), rel=0.02)
    assert (drawing.tables[""]["strain zz [-]"] == table["strain_zz"]).all()


@pytest.mark.usefixtures("unpainted")
def test_few_grains_have_a_word_instead(tmp_path):
    write_run(tmp_path, (2, 2, 3), 1, 3)
    with pytest.raises(InputError, match="12 grains with neighbours, expected 60 or more"):
        judge(mufe_fenicsx.open_run(tmp_path).localisation())
    result = write_report(tmp_path, tmp_path / "out", only=["energies"])
    assert "12 grains are too few to tell of a band" in (tmp_path / "out/report.html").read_text()
    assert len(result["figures"]) == 1
    run = mufe_fenicsx.open_run(tmp_path)
    with pytest.raises(InputError, match="from state 2 to state 1, expected a later"):
        run.localisation(1, since=2)


def test_points_for_paraview_have_the_table(cylinder):
    folder, _ = cylinder
    result = write_paraview(mufe_fenicsx.open_run(folder))
    assert result["grains"] == 2
    series = json.loads((folder / "paraview/grains.vtp.series").read_text())["files"]
    points = pyvista.read(folder / "paraview" / series[1]["name"])
    table = mufe_fenicsx.open_run(folder).localisation()
    for name in ("strain_deviator", "strain_volume", "excess", "grain"):
        assert points.point_data[name] == pytest.approx(table[name].to_numpy(), rel=1e-12, abs=0.0)
    first = pyvista.read(folder / "paraview" / series[0]["name"])
    assert first.point_data["strain_deviator"].max() < 1e-12
