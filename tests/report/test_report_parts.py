"""What the figures of a report are made of, against exact cases."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mufe_fenicsx.analysis import mesh_quality
from mufe_fenicsx.output import fields
from mufe_fenicsx.output.history import HistoryWriter
from mufe_fenicsx.report import chains, compare, curves, motion, parts, profile, run_names, style
from mufe_fenicsx.report.sample import boundary_faces
from mufe_fenicsx.report.source import Source
from mufe_fenicsx.report.summary import largest_values
from tests.made_up_run import SCENE, ball, fake_history, write_history

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)

ROUND_OFF = 1e-12


def test_each_part_is_drawn_by_one_process():
    drawn = [name for group in parts.GROUPS for name in group]
    assert sorted(drawn) == sorted([*parts.NAMES, parts.VIEW, parts.TABLES])


def test_bars_of_the_profile_add_up_to_the_time_of_all_steps(tmp_path):
    """Eleven parts of uneven rows, of which the smallest are one bar: 66 s in 1000 steps."""
    names = [f"part {k}" for k in range(11)]
    rows = [[0.1 * n, n, *(n / 1000 * (k + 1) ** (1 + n % 2) for k in range(11))]
            for n in (0, 100, 400, 1000)]  # fmt: skip
    head = ",".join(["strain", "steps", *names])
    lines = [",".join(map(str, row)) for row in rows]
    (tmp_path / "profile.csv").write_text("\n".join([head, *lines, ""]))
    steps, run = profile.draw_profile(SimpleNamespace(folder=tmp_path)).figure.axes
    area = sum(bar.get_width() * bar.get_height() for bar in steps.patches)
    assert area / 1e3 == pytest.approx(66.0, rel=ROUND_OFF)  # bars are in ms
    assert len(run.patches) == len(style.SERIES)
    assert sum(bar.get_width() for bar in run.patches) == pytest.approx(66.0, rel=ROUND_OFF)


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
    assert run_names.name_runs(sources) == ["yield 10 MPa", "yield 20 MPa"]
    for source, strain in zip(sources, (0.1, 0.2), strict=True):
        stages = 3 * f"[[stage]]\nz.strain = {strain}\nz.walls = 'max'\n"
        (source.folder / "scene.toml").write_text(stages)  # too long for a name, and for a file
    assert run_names.name_runs([Source(s.folder) for s in sources]) == ["run0", "run1"]
    (tmp_path / "run1" / "scene.toml").unlink()
    assert run_names.name_runs([Source(s.folder) for s in sources]) == ["run0", "run1"]


def test_runs_on_two_meshes_are_compared_at_the_same_strain_and_height(tmp_path):
    """One is twice as stiff, and begins 2 % lower; its grains have more tetrahedra."""
    sources = []
    for k, (cells, factor, height) in enumerate(((100, 1.0, 1e-3), (200, 2.0, 0.98e-3))):
        folder = tmp_path / f"run{k}"
        folder.mkdir()
        h = fake_history(2000, height=height)
        h["stress"] = factor * 1e8 * h["strain"].clip(0)
        write_history(folder, h)
        (folder / "scene.toml").write_text(SCENE)
        (folder / "run.json").write_text(json.dumps({"num_cells": cells}))
        sources.append(Source(folder))
    names = run_names.name_runs(sources)
    assert names == ["tetrahedra 100", "tetrahedra 200"]
    title, rows, columns = compare.tables(sources, names)[2]
    assert "tetrahedra 100" in title and columns[0] == "Run"
    name, *ratios = rows[0]
    # Heights in common: 0.98 mm to 0.9 mm, where the strains are 0.02 to 0.1 and 0 to 0.0816.
    parts = np.array(compare.PARTS)
    there = 0.98 - parts * 0.08
    expected = [2.0] * len(parts) + list(2 * (1 - there / 0.98) / (1 - there))
    # Three digits, and rows that lie a little beside the place.
    assert name == names[1] and np.array(ratios, float) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("share", "said"), [(0.4, True), (0.009, False), (None, False)])
def test_dents_are_told_where_they_dissipate(tmp_path, share, said):
    """From a hundredth of the plastic dissipation on; None: a history of an earlier version."""
    h = fake_history(40)
    dents = h.pop("plastic_dents")
    if share is not None:
        h["plastic_dents"] = share * h["plastic"]
    assert dents.any()
    with HistoryWriter(tmp_path / "history.csv", tuple(h)) as writer:
        for i in range(len(h["step"])):
            writer.append({k: str(v[i]) if k == "stage" else v[i] for k, v in h.items()})
    source = Source(tmp_path)
    drawing = curves.draw_dissipation(source)
    labels = [line.get_label() for line in drawing.figure.axes[0].lines]
    assert ("plastic, in dents" in labels) == said == ("Dents" in drawing.how)
    assert ("plastic_dents [J]" in drawing.tables[""]) == (share is not None)
    rows = {name: value for name, value, _ in largest_values(source.history, None)}
    assert rows.get("Plastic dissipation in dents over all") == (str(share) if said else None)


def test_displacement_by_rotation_is_that_of_the_nodes(tmp_path):
    """A grain that turns by a known angle: root mean square of (R - 1) r over its volume."""
    points, cells = ball(2, 1e-4, np.random.default_rng(3))
    R = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    volume = mesh_quality.mesh_quality(points, cells).volume
    centre = volume @ points[cells].mean(axis=1) / volume.sum()
    moved = (points - centre) @ R.T + centre - points
    writer = fields.FieldWriter(MPI.COMM_SELF, tmp_path, points, cells, np.ones(len(cells), int))
    # What the grain has done before strain 0 is no part of its motion.
    seated = np.array([3e-5, 0, -1e-5])
    for index, u in enumerate((0 * moved + seated, moved + seated)):
        of_cells = {"von_mises": volume}
        writer.write(index, 1.0 + index, 0.1 * index, "loading", {"displacement": u}, of_cells)
    parts = motion.displacement_parts(Source(tmp_path))
    a = moved[cells]
    square = (np.einsum("cai,cai->c", a, a) + (a.sum(axis=1) ** 2).sum(axis=1)) / 20
    exact = np.sqrt(volume @ square / volume.sum())
    assert parts["by rotation [m]"] == pytest.approx(exact, rel=1e-9)
    assert parts["translation [m]"][0] < 1e-9 * exact
    assert parts["rotation [degrees]"] == pytest.approx(np.degrees(np.sqrt(0.14)), rel=1e-9)
