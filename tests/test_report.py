"""Numbers of the analysis against exact cases; the report of a made-up run."""

import re

import numpy as np
import pytest

from mufe_fenicsx.analysis import (
    energy_check,
    grain_means,
    mesh_quality,
    quasi_static,
    rows,
    stress_strain,
)
from mufe_fenicsx.analysis.checkerboard import checkerboard
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output import fields, history, run_folder
from mufe_fenicsx.output.contacts import ContactWriter
from mufe_fenicsx.report import style, write_report
from mufe_fenicsx.report.sample import boundary_faces
from tests.networks import lattice_network

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)

ROUND_OFF = 1e-12


def ball(n, radius, rng):
    """A lumpy ball: a cube of n³ small cubes of six tets each, blown up."""
    i = np.arange(n + 1)
    grid = np.stack(np.meshgrid(i, i, i, indexing="ij"), axis=-1).reshape(-1, 3)
    x = 2.0 * grid / n - 1
    length = np.linalg.norm(x, axis=1)
    x *= (np.abs(x).max(axis=1) / np.where(length > 0, length, 1))[:, None]
    x *= 1 + 0.06 * np.sin(3 * x @ rng.normal(size=3) + rng.random())[:, None]
    corner = np.array(
        [(a * (n + 1) + b) * (n + 1) + c for a in range(n) for b in range(n) for c in range(n)]
    )
    steps = np.array([(n + 1) ** 2, n + 1, 1])
    orders = np.array([[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]])
    path = np.concatenate([np.zeros((6, 1), int), np.cumsum(steps[orders], axis=1)], axis=1)
    cells = (corner[:, None, None] + path).reshape(-1, 4)
    volume = np.linalg.det(x[cells[:, 1:]] - x[cells[:, :1]])
    cells[volume < 0] = cells[volume < 0][:, [0, 2, 1, 3]]
    return radius * x, cells


def fake_history(num_rows=200, strain=0.1, area=1e-6, height=1e-3):
    """A plausible oedometer test whose energies add up to the work but for 0.2 %."""
    e = np.concatenate([np.linspace(-0.003, 0, num_rows // 10), np.linspace(0, strain, num_rows)])
    x = np.maximum(e, 0)
    stress = 5e4 * np.exp(e / 0.003) * (e <= 0) + (e > 0) * (5e4 + 40e6 * x + 4e9 * x**2.2)
    force = stress * area
    step = np.diff(e, prepend=e[0]) * height
    work = np.cumsum(force * step)
    wiggle = 1 + 0.01 * np.sin(900 * e)
    share = {
        "elastic": 0.12,
        "plastic": 0.78,
        "friction": 0.085,
        "contact": 0.01,
        "kinetic": 0.003,
        "damping": 0.0,
    }
    h = {name: share_of * work for name, share_of in share.items()}
    h["plastic"] = np.where(e > 0.005, 0.78 * (work - np.interp(0.005, e, work)), 0.0)
    h["elastic"] = work * 0.9 - h["plastic"]
    h |= {
        "step": 50 * np.arange(e.size),
        "time": 1e-6 * np.arange(e.size),
        "dt": np.full(e.size, 2e-8),
        "strain": e,
        "height": height * (1 - e),
        "stress": stress,
        "speed": np.full(e.size, 2.0),
        "added_mass": np.zeros(e.size),
        "added_mass_of_grain": np.zeros(e.size),
        "stage": np.where(np.arange(e.size) < num_rows // 10, "seating", "loading"),
        "force_z_max": force * wiggle,
        "force_z_min": force / wiggle,
        "work": work,
        "num_contacts": (200 + 4e4 * x).astype(int),
        "num_active_grains": 60 + (e > 0.02),
        "num_active_contacts": 3 + 40 * e,
        "length_x": np.full(e.size, area**0.5),
        "length_y": np.full(e.size, area**0.5),
    }
    for i, name in enumerate(("x_min", "x_max", "y_min", "y_max")):
        h[f"force_{name}"] = (0.3 + 0.02 * i) * force
    h["residual"] = work - sum(h[name] for name in energy_check.ENERGIES)
    return {name: np.asarray(h[name]) for name in history.COLUMNS}


def write_history(folder, h):
    with history.HistoryWriter(folder / "history.csv") as writer:
        for i in range(len(h["step"])):
            writer.append({name: str(v[i]) if name == "stage" else v[i] for name, v in h.items()})


def write_run(folder, counts=(2, 2, 3), n=3, num_states=3, finished=True):
    """A run folder as `mufe run` leaves it: lumpy balls on a lattice, squeezed."""
    rng = np.random.default_rng(4)
    radius = 1e-4
    parts, label, at = [], [], 0
    for k, place in enumerate(np.ndindex(*counts)):
        x, cells = ball(n, radius * rng.uniform(0.9, 1.06), rng)
        centre = 2 * radius * (np.array(place) + 0.5)
        parts.append((x + centre, cells + at, np.tile(centre, (len(x), 1)), x / radius))
        label += [10 + k] * len(cells)
        at += len(x)
    points, cells, centre, inner = (np.concatenate(p) for p in zip(*parts, strict=True))
    label = np.array(label)
    size = 2 * radius * np.array(counts)
    h = fake_history(area=size[0] * size[1], height=size[2])
    write_history(folder, h)
    writer = fields.FieldWriter(MPI.COMM_SELF, folder, points, cells, label)
    chain = 1 + 0.8 * np.sin(5e3 * centre[:, 0]) * np.cos(7e3 * centre[:, 1])
    poles = np.abs(inner).max(axis=1)
    for index, strain in enumerate(np.linspace(0, 0.1, num_states)):
        level = strain / 0.1
        node = level * 40e6 * chain * (0.3 + poles**4)
        mises = node[cells].mean(axis=1)
        stress = np.zeros((len(cells), 6))
        stress[:, 2] = -mises
        pressure = level * 3e8 * chain * np.maximum(poles - 0.93, 0)
        moved = -strain * points * [0, 0, 1] + 0.05 * strain * inner * radius * [1, 1, 0]
        writer.write(
            index,
            np.interp(strain, h["strain"], h["time"]),
            strain,
            "loading",
            {
                "displacement": moved,
                "velocity": 0 * moved,
                "contact_pressure": pressure,
                "contact_shear": 0.1 * pressure,
            },
            {
                "stress": stress,
                "von_mises": mises,
                "pressure": mises / 3,
                "plastic_strain": 1e-3 * np.maximum(mises / 1e7 - 1, 0),
            },
        )
    run_folder.write_run_json(
        folder,
        {
            "title": "Made-up <sand> & gravel",
            "command": "mufe run scene.toml",
            "versions": run_folder.versions(),
            "num_ranks": 2,
            "num_grains": len(parts),
            "num_cells": len(cells),
            "num_nodes": len(points),
            "finished": finished,
            "stop_reason": "strain reached" if finished else "interrupted",
            "wall_s": 100.0,
            "num_steps": int(h["step"][-1]),
            "stages": [
                {"name": "seating", "step": 0, "time": 0.0, "strain": -0.003},
                {"name": "loading", "step": 1000, "time": 2e-5, "strain": 0.0},
            ],
            "strain_definition": "fall of the top platen since seating over the height then",
            "reference_height": size[2],
            "area": size[0] * size[1],
            "separation": {"overlap_nodes": 120, "max_depth": 1.1e-6, "volume_change": -0.004},
            "failed_grains": [],
            "peak_memory_bytes": 200_000_000,
        },
    )
    return h


# -- numbers ------------------------------------------------------------------------------


def test_modulus_of_a_parabola():
    """A least-squares line over a symmetric window has the slope in its middle, exactly."""
    strain = np.linspace(0, 0.1, 101)
    stress = 1e7 * strain + 5e8 * strain**2
    found = stress_strain.tangent_modulus(strain, stress, 0.05, 0.02)
    assert found == pytest.approx(1e7 + 2 * 5e8 * 0.05, rel=ROUND_OFF)
    assert stress_strain.secant_modulus(strain, stress) == pytest.approx(6e7, rel=ROUND_OFF)
    assert np.isnan(stress_strain.tangent_modulus(strain, stress, 0.05, 1e-6))


def test_ratios_of_a_known_history():
    h = fake_history()
    loaded = rows.loaded_rows(h)
    assert h["strain"][loaded].min() > 0.05 and h["strain"][loaded].max() == 0.1
    # As made: kinetic 0.003 and internal 0.9 of the work; residual 1 - 0.9 - 0.085 - 0.01 - 0.003.
    # Round-off of the sums.
    assert quasi_static.kinetic_ratio(h)[loaded] == pytest.approx(0.003 / 0.9, rel=1e-9)
    assert energy_check.residual_ratio(h)[loaded] == pytest.approx(0.002, rel=1e-9)
    wiggle = 1 + 0.01 * np.sin(900 * h["strain"])
    exact = np.abs(wiggle - 1 / wiggle) / (0.5 * (wiggle + 1 / wiggle))
    assert quasi_static.force_difference(h) == pytest.approx(exact, rel=1e-9)


def test_ratios_without_load_are_not_known():
    h = {k: np.zeros(2) for k in ("kinetic", "elastic", "plastic", "force_z_max", "force_z_min")}
    assert np.isnan(quasi_static.kinetic_ratio(h)).all()
    assert np.isnan(quasi_static.force_difference(h)).all()


def test_quality_of_a_regular_and_a_corner_tetrahedron():
    regular = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    cells = np.array([[0, 2, 1, 3], [4, 5, 6, 7]])
    q = mesh_quality.mesh_quality(np.vstack([regular, corner]), cells)
    edge = np.sqrt(8)
    assert q.volume == pytest.approx([edge**3 / (6 * np.sqrt(2)), 1 / 6], rel=ROUND_OFF)
    assert q.altitude == pytest.approx([edge * np.sqrt(2 / 3), 1 / np.sqrt(3)], rel=ROUND_OFF)
    angle = [np.degrees(np.arccos(1 / 3)), np.degrees(np.arctan(np.sqrt(2)))]
    assert q.angle == pytest.approx(angle, rel=ROUND_OFF)


def test_mean_stress_equals_the_load_on_a_column():
    """A block of even stress fills half of the sample: the mean is half of it."""
    points, cells = ball(2, 1.0, np.random.default_rng(0))
    volume = mesh_quality.mesh_quality(points, cells).volume
    stress = np.tile([0, 0, -3e6, 0, 0, 0], (len(cells), 1))
    found = grain_means.sample_stress(stress, volume, 2 * volume.sum())
    assert found == pytest.approx([0, 0, -1.5e6, 0, 0, 0], rel=ROUND_OFF)
    assert grain_means.void_ratio(volume.sum(), 2 * volume.sum()) == pytest.approx(1)
    labels, means = grain_means.grain_means(
        np.array([1.0, 5.0, 2.0]), np.array([3.0, 1.0, 2.0]), np.array([7, 7, 4])
    )
    assert list(labels) == [4, 7] and means == pytest.approx([2, 2])


def test_boundary_faces_close_the_body():
    """Outward faces of a closed body: their flux of x is three times its volume."""
    points, cells = ball(3, 1.0, np.random.default_rng(1))
    faces, cell = boundary_faces(cells)
    a, b, c = points[faces].transpose(1, 0, 2)
    assert len(faces) == 6 * 2 * 3 * 3
    flux = np.einsum("ij,ij->", a, np.cross(b, c)) / 2
    volume = mesh_quality.mesh_quality(points, cells).volume.sum()
    assert flux == pytest.approx(3 * volume, rel=ROUND_OFF)
    assert (faces[:, :, None] == cells[cell][:, None, :]).any(axis=2).all()


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (2.5e7, "25 MPa"),
        (999.9, "1 kPa"),
        (0.0, "0 Pa"),
        (1.234e-5, "12.3 µPa"),
        (float("nan"), "not known"),
    ],
)
def test_quantities_in_words(value, text):
    assert style.quantity(value, "Pa") == text


# -- the page -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    h = write_run(folder)
    ContactWriter(MPI.COMM_SELF, folder).write(2, h["time"][-1], lattice_network(1.0))
    return folder, h, write_report(folder)


def test_page_holds_all_figures_and_nothing_from_outside(reported):
    folder, _, result = reported
    page = (folder / "report.html").read_text()
    rendered = not any("3D" in sentence for sentence in result["missing"])
    assert len(result["figures"]) == (10 if rendered else 8)
    assert page.count('src="data:image/png;base64,') == len(result["figures"])
    assert not re.search(r"https?:|file:|\ssrc=(?!\"data:image/png)|<link|url\(|@import", page)
    assert "default-src 'none'" in page and "eval(" not in page
    assert str(folder) not in page
    assert "Made-up &lt;sand&gt; &amp; gravel" in page


def test_numbers_of_the_page_are_those_of_the_history(reported):
    folder, h, result = reported
    page = (folder / "report.html").read_text()
    largest = h["stress"].max() / 1e6
    assert f"{largest:.4g} MPa" in page
    assert f"{h['force_z_max'].max():.4g} N" in page
    assert "2 nodes" not in page and "120 nodes were inside a neighbour" in page
    speed = run_folder.read_run_json(folder)["num_cells"] * h["step"][-1] / 100.0 / 1e6
    assert f"{speed:.3g} million element-steps a second" in page
    checks = {c["name"]: c for c in result["checks"]}
    assert checks["residual"]["largest"] == pytest.approx(0.002, rel=1e-9)
    assert result["passed"]
    assert page.count("✓ pass") == 3


def test_figures_are_not_empty(reported):
    from matplotlib.image import imread

    for path in reported[2]["figures"]:
        image = imread(path)[..., :3]
        # A picture for print (300 dpi, at least a column wide) with some ink in it.
        assert image.shape[1] >= 1000
        assert (image.min(axis=2) < 0.5).mean() > 1e-3


def test_missed_target_is_said(tmp_path):
    h = fake_history()
    h["kinetic"] = 0.1 * (h["elastic"] + h["plastic"])
    write_history(tmp_path, h)
    result = write_report(tmp_path)
    passed = {c["name"]: c["passed"] for c in result["checks"]}
    assert not passed["kinetic"] and passed["platens"] and not passed["residual"]
    assert not result["passed"]
    assert "at most 10.00%" in (tmp_path / "report.html").read_text()


def test_run_that_stopped_early(tmp_path):
    """A torn history and no states: curves, and a page that says what is not there."""
    write_history(tmp_path, fake_history())
    path = tmp_path / "history.csv"
    path.write_bytes(path.read_bytes()[:-9])
    result = write_report(tmp_path)
    assert len(result["figures"]) == 5
    page = (tmp_path / "report.html").read_text()
    assert "run.json" in page and "no stored states" in page


def test_only_states(tmp_path):
    write_run(tmp_path, (1, 1, 2), 2, 1, finished=False)
    (tmp_path / "history.csv").unlink()
    result = write_report(tmp_path)
    assert result["figures"] and not result["passed"]
    page = (tmp_path / "report.html").read_text()
    assert "history.csv" in page and "interrupted" in page


def test_without_graphics(tmp_path, monkeypatch):
    """Where nothing can be rendered the page says so and shows the rest."""
    monkeypatch.setattr("mufe_fenicsx.report.write.cannot_render", lambda: "no driver")
    write_run(tmp_path, (1, 1, 2), 2, 2)
    result = write_report(tmp_path)
    assert len(result["figures"]) == 7
    assert "No 3D pictures: no driver" in (tmp_path / "report.html").read_text()


def test_grains_that_failed_are_named(tmp_path):
    """By the mesher's table where the run does not list them."""
    run_folder.write_run_json(tmp_path, {"title": "t", "finished": True, "num_grains": 1})
    (tmp_path / "quality.csv").write_text("label,status\n3,ok\n8,failed\n11,failed\n")
    write_report(tmp_path)
    assert "2, not in the test: 8, 11" in (tmp_path / "report.html").read_text()


def test_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(InputError, match="none of run"):
        write_report(tmp_path)
    with pytest.raises(InputError, match="absent"):
        write_report(tmp_path / "nothing")


def test_checkerboard_is_one_where_neighbours_alternate_and_small_where_smooth():
    """A chain of tetrahedra in a prism, each with the next one face: alternating, even, linear."""
    n = 40
    cells = np.array([[k, k + 1, k + 2, k + 3] for k in range(n)])
    volume, sign = np.ones(n), (-1.0) ** np.arange(n)
    assert checkerboard(cells, sign, volume) == pytest.approx(1, abs=1e-12)
    assert checkerboard(cells, np.ones(n), volume) == pytest.approx(0, abs=1e-12)
    # A linear course has its neighbours' mean but at both ends, where it is off by one step.
    assert checkerboard(cells, np.linspace(1, 2, n), volume) < 0.5 * np.sqrt(2 / n) / (n - 1)
    # Two in turn with one pressure: from pair to pair.
    pairs = np.repeat(sign[: n // 2], 2)
    assert checkerboard(cells, pairs, volume, family=2) == pytest.approx(1, abs=1e-12)
