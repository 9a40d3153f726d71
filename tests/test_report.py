"""Numbers of the analysis against exact cases; the report of a made-up run."""

import re

import numpy as np
import pandas
import pytest
from scipy.spatial.transform import Rotation

import mufe_fenicsx
from mufe_fenicsx.analysis import (
    energy_check,
    grain_energy,
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
from mufe_fenicsx.report import chains, compare, list_figures, motion, style, write_report
from mufe_fenicsx.report.sample import boundary_faces
from mufe_fenicsx.report.source import Source
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


def test_energies_of_a_bar_under_even_stress():
    """Uniaxial stress: elastic energy σ²/2E; plastic work is the area under the table."""
    points, cells = ball(2, 1.0, np.random.default_rng(0))
    volume = mesh_quality.mesh_quality(points, cells).volume
    E, nu, sigma = 1e9, 0.3, -3e4
    stress = np.tile([0, 0, sigma, 0, 0, 0], (len(cells), 1))
    strain = np.full(len(cells), 0.06)
    velocity = np.tile([0.0, 3.0, 4.0], (len(points), 1))
    moved = points * (1 + sigma / E * np.array([-nu, -nu, 1]))
    V = volume.sum()
    for element in ("averaged", "p1", "composite"):
        found = grain_energy.grain_energy(
            points, moved, cells, np.full(len(cells), 5), stress, strain, velocity,
            E, nu, 2000.0, [[0.0, 1e7], [0.05, 1.1e8]], "flat", element, 6,
        )  # fmt: skip
        # Small strain, but for terms of the next order in σ/E.
        assert found.elastic == pytest.approx(sigma**2 / (2 * E) * V, rel=5 * abs(sigma) / E)
    assert found.labels == [5]
    assert found.plastic == pytest.approx((0.05 * 6e7 + 0.01 * 1.1e8) * V, rel=ROUND_OFF)
    assert found.kinetic == pytest.approx(0.5 * 2000 * 25 * V, rel=ROUND_OFF)
    x = np.array([0.0, 0.02, 0.05, 0.07])
    slope = grain_energy.plastic_work(x, [[0.0, 1e7], [0.05, 1.1e8]], "slope")
    assert slope == pytest.approx(1e7 * x + 1e9 * x**2, rel=ROUND_OFF)


def test_mean_motion_of_a_linear_field_is_that_field():
    rng = np.random.default_rng(2)
    x, weight, A = rng.random((9, 3)), rng.random(9) + 0.1, rng.normal(size=(3, 3))
    field = x @ A.T + [1, 2, 3]
    # Rounding of a least-squares fit of well-spread points.
    assert motion.mean_motion(x, field, weight) == pytest.approx(field, abs=1e-12)
    noise = rng.normal(size=(9, 3))
    left = field + noise - motion.mean_motion(x, field + noise, weight)
    assert np.abs(weight @ left).max() < 1e-12 and np.abs(left).max() > 0.01


def test_tubes_have_their_radius_and_ends():
    start, end = np.array([[0, 0, 0], [1, 2, 3]]), np.array([[0, 0, 2], [3, 1, 2]])
    points, quads = chains.tubes(start, end, np.array([0.1, 0.2]), sides=6)
    assert points.shape == (24, 3) and quads.shape == (12, 4)
    for k, radius in enumerate((0.1, 0.2)):
        axis = (end - start)[k] / np.linalg.norm((end - start)[k])
        away = points[12 * k : 12 * (k + 1)] - start[k]
        across = away - np.outer(away @ axis, axis)
        assert np.linalg.norm(across, axis=1) == pytest.approx(radius, rel=ROUND_OFF)
        ends = np.repeat([0, np.linalg.norm((end - start)[k])], 6)
        assert away @ axis == pytest.approx(ends, abs=1e-12)
    # Each quadrilateral is of one tube, with two corners at either end.
    assert (quads // 12 == quads[:, :1] // 12).all() and ((quads % 12 >= 6).sum(axis=1) == 2).all()


def test_runs_are_named_by_what_differs(tmp_path):
    sources = []
    for k, (stress, title) in enumerate(((1e7, "a"), (2e7, "b"))):
        folder = tmp_path / f"run{k}"
        folder.mkdir()
        write_history(folder, fake_history(40))
        text = SCENE.replace("1e7", f"{stress:g}").replace('"title"', f'"{title}"')
        (folder / "scene.toml").write_text(text)
        sources.append(Source(folder))
    assert compare.name_runs(sources) == ["yield 10 MPa", "yield 20 MPa"]
    (tmp_path / "run1" / "scene.toml").unlink()
    assert compare.name_runs([Source(s.folder) for s in sources]) == ["run0", "run1"]


# -- the page -----------------------------------------------------------------------------

SCENE = (
    'title = "title"\n[material]\nmodel = "j2"\nE = 1e11\nnu = 0.15\nrho = 2650.0\n'
    "yield_stress = [[0.0, 1e7]]\n[contact]\nfriction = 0.5\n"
) + "".join(f"[walls.{a}_{end}]\nfriction = 0.25\n" for a in "xyz" for end in ("min", "max"))


def write_whole_run(folder, **options):
    """A made-up run that lacks nothing, with the contacts of a loaded lattice."""
    h = write_run(folder, **options)
    (folder / "scene.toml").write_text(SCENE)
    writer = ContactWriter(MPI.COMM_SELF, folder)
    for index in range(3):
        writer.write(index, 1e-6 * index, lattice_network(1.0 + index))
    return h


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    h = write_whole_run(folder)
    return folder, h, write_report(folder, folder / "out")


@pytest.fixture(scope="module")
def reported_page(reported):
    return (reported[0] / "out" / "report.html").read_text()


def test_page_holds_all_figures_and_nothing_from_outside(reported, reported_page):
    folder, _, result = reported
    page = reported_page
    rendered = not any("3D pictures" in sentence for sentence in result["missing"])
    assert len(result["figures"]) == (20 if rendered else 15)
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
    assert checks["residual"]["largest"] == pytest.approx(0.002, rel=1e-9)
    assert result["passed"]
    assert page.count("✓ pass") == 3


def test_figures_are_not_empty(reported):
    from matplotlib.image import imread

    for path in reported[2]["figures"]:
        image = imread(path)[..., :3]
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
        return pandas.read_csv(folder / "out" / "figures" / f"{name}.csv")

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
        assert row["I_1 [kg m²]"] == pytest.approx(2650 * mine["inertia_1"], rel=1e-9)
        assert row["N_cA [-]"] == run.grains(0).set_index("grain")["num_active_contacts"][label]
    label = int(table["grain"][0])
    course = data(f"course-grain-{label}-most-loaded")
    assert course["von Mises stress [Pa]"].tolist() == (
        run.probe(grains=[label])["von_mises"].tolist()
    )


def test_displacement_by_rotation_is_that_of_the_nodes(tmp_path):
    """A grain that turns by a known angle: root mean square of (R - 1) r over its volume."""
    points, cells = ball(2, 1e-4, np.random.default_rng(3))
    R = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    volume = mesh_quality.mesh_quality(points, cells).volume
    center = volume @ points[cells].mean(axis=1) / volume.sum()
    moved = (points - center) @ R.T + center - points
    writer = fields.FieldWriter(MPI.COMM_SELF, tmp_path, points, cells, np.ones(len(cells), int))
    writer.write(0, 1.0, 0.0, "loading", {"displacement": moved}, {"von_mises": volume})
    parts = motion.displacement_parts(Source(tmp_path))
    a = moved[cells]
    square = (np.einsum("cai,cai->c", a, a) + (a.sum(axis=1) ** 2).sum(axis=1)) / 20
    exact = np.sqrt(volume @ square / volume.sum())
    assert parts["by rotation [m]"] == pytest.approx(exact, rel=1e-9)
    assert parts["translation [m]"][0] < 1e-9 * exact
    assert parts["rotation [degrees]"] == pytest.approx(np.degrees(np.sqrt(0.14)), rel=1e-9)


def test_missed_target_is_said(tmp_path):
    h = fake_history()
    h["kinetic"] = 0.1 * (h["elastic"] + h["plastic"])
    write_history(tmp_path, h)
    result = write_report(tmp_path, only=["quasi-static"])
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
    course = pandas.read_csv(tmp_path / "out" / "figures" / "yield-initiation-share.csv")
    assert course["strain [-]"].tolist() == [0.0, 0.05]
    assert not (tmp_path / "report.html").exists()


def test_two_runs_in_one_report(tmp_path):
    h = []
    for k in range(2):
        folder = tmp_path / f"run{k}"
        folder.mkdir()
        h.append(fake_history(60))
        h[k]["stress"] = (1 + k) * h[k]["stress"]
        write_history(folder, h[k])
        (folder / "scene.toml").write_text(SCENE.replace("1e7", f"{k + 1}e7"))
    result = write_report([tmp_path / "run0", tmp_path / "run1"])
    out = tmp_path / "comparison"
    assert result["report"] == str(out / "report.html") and len(result["figures"]) == 3
    page = (out / "report.html").read_text()
    assert "yield 10 MPa" in page and "yield 20 MPa" in page
    for k, name in enumerate(("yield-10-MPa", "yield-20-MPa")):
        table = pandas.read_csv(out / "figures" / f"runs-stress-strain-{name}.csv")
        rows_of = h[k]["stage"] != "seating"
        assert np.array_equal(table["vertical stress [Pa]"], h[k]["stress"][rows_of])
    with pytest.raises(InputError, match="given twice"):
        write_report([tmp_path / "run0", tmp_path / "run0"])


def test_unknown_grain_or_place_is_refused_before_anything_is_written(tmp_path):
    write_run(tmp_path, (1, 1, 2), 2, 1)
    for options in ({"grains": [99]}, {"points": [[1.0, 0.0, 0.0]]}):
        with pytest.raises(InputError, match=r"grain 99 is not|is in no grain"):
            write_report(tmp_path, tmp_path / "out", **options)
    with pytest.raises(InputError, match="figure forcs is not known, expected forces or"):
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
