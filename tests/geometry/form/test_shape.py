"""Size and form of bodies whose numbers are known."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.form.shape import (
    describe,
    inertia_of,
    principal,
    shapes_of_labels,
    shapes_of_meshes,
    size_at,
    tet_moments,
)
from mufe_fenicsx.geometry.form.shape_table import write_shapes
from mufe_fenicsx.geometry.grains import Grains
from tests.bodies import sphere

ROOT = Path(__file__).resolve().parents[3]

RNG = np.random.default_rng(5)


def rotation():
    q, _ = np.linalg.qr(RNG.standard_normal((3, 3)))
    return q * np.sign(np.linalg.det(q))


def test_a_brick_has_its_own_numbers_wherever_it_lies():
    a, b, c = 3e-3, 2e-3, 1e-3
    points, cells = box((a, b, c), (3, 2, 2))
    R = rotation()
    points = np.add(points, [1.0, -2.0, 0.5]) @ R.T
    row = shapes_of_meshes(Grains.from_list([7], [(points, cells)], 1e-3))[0]
    exact = {
        "label": 7, "volume_m3": a * b * c, "surface_m2": 2 * (a * b + b * c + c * a),
        "length_m": a, "width_m": b, "thickness_m": c, "elongation": b / a, "flatness": c / b,
        "convexity": 1.0, "principal_1_m5": a * b * c / 12 * (b * b + c * c),
        "principal_3_m5": a * b * c / 12 * (a * a + b * b),
    }  # fmt: skip
    # 1 m from the origin: digits of the coordinates, 1e-16 over 1e-3, twice for moments.
    for name, value in exact.items():
        assert row[name] == pytest.approx(value, rel=1e-10), name
    axis = np.array([row[f"axis_1_{k}"] for k in "xyz"])
    assert abs(axis @ R[:, 0]) == pytest.approx(1.0, abs=1e-10) and axis[2] >= 0
    assert row["inclination_deg"] == pytest.approx(math.degrees(math.asin(axis[2])))


def test_lengths_say_what_they_are(tmp_path):
    """In the summary, in the picture and in the documentation."""
    labels = np.kron(np.arange(1, 9).reshape(2, 2, 2), np.ones((12, 18, 24), np.uint16))
    np.savez(tmp_path / "labels.npz", labels=labels.astype(np.uint16))
    result = write_shapes(tmp_path / "labels.npz", tmp_path / "shapes", voxel_size=1e-5)
    assert "length L >= width W >= thickness T: extents along" in result["lengths"]
    with (tmp_path / "shapes" / "shapes.csv").open() as file:
        row = next(csv.DictReader(file))
    # The filter rounds edges, and the surface then grows to the volume of the voxels: by 0.6 %, as
    # the square of a voxel over the lengths.
    for name, voxels in (("length_m", 24), ("width_m", 18), ("thickness_m", 12)):
        assert float(row[name]) == pytest.approx(voxels * 1e-5, rel=0.01)
        assert f"`{name}`" in (ROOT / "docs" / "reference" / "files.md").read_text()


def test_inertia_of_an_ellipsoid_and_that_tensors_are_valid():
    points, cells = sphere(1.0, 0.2)
    points = points * [3.0, 2.0, 1.0] @ rotation().T
    volume, _, second = tet_moments(points, cells)
    moments, axes = principal(inertia_of(second))
    assert (moments > 0).all() and moments[2] <= moments[0] + moments[1]
    assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-14) and np.linalg.det(axes) > 0
    # The polyhedron is smaller than the ellipsoid, alike in all directions: h²/R² = 0.04 of it.
    exact = volume / 5 * np.array([2**2 + 1, 3**2 + 1, 3**2 + 2**2])
    assert np.allclose(moments, exact, rtol=0.02)


def test_a_ball_of_voxels():
    n, radius = 41, 16.3
    z, y, x = np.indices((n, n, n)) - n // 2
    labels = np.zeros((n, n, n), np.uint16)
    labels[x * x + y * y + z * z <= radius**2] = 3
    row = shapes_of_labels(labels, 1e-5)[0]
    ball = 4 / 3 * math.pi * (radius * 1e-5) ** 3
    assert row["label"] == 3
    # Of 18 000 voxels those of the surface, 3300, are in or out at random: 0.3 %, and three times.
    assert row["volume_m3"] == pytest.approx(ball, rel=0.01)
    assert row["surface_m2"] == pytest.approx(4 * math.pi * (radius * 1e-5) ** 2, rel=0.02)
    assert row["sphericity"] == pytest.approx(1.0, abs=0.02)
    assert row["convexity"] == pytest.approx(1.0, abs=0.02)
    assert row["centroid_x_m"] == pytest.approx((n // 2 + 0.5) * 1e-5, rel=1e-12)


SPAM = """
import importlib.resources, sys, numpy, spam.label
labels = numpy.load(sys.argv[1])
moments, _ = spam.label.momentOfInertia(labels)
numpy.savez(sys.argv[2], volumes=spam.label.volumes(labels), moments=moments,
            radii=spam.label.equivalentRadii(labels))
"""


@pytest.mark.slow
def test_numbers_of_labels_agree_with_spam(by_spam):
    labels = np.zeros((40, 60, 60), np.uint32)
    z, y, x = np.indices(labels.shape)
    for k, (centre, axes) in enumerate(
        [((20, 20, 18), (14, 10, 9)), ((20, 42, 42), (12, 9, 14))], start=1
    ):
        r = ((np.stack([z, y, x], -1) - centre) / axes) ** 2
        labels[r.sum(axis=-1) <= 1] = k
    rows = shapes_of_labels(labels, 1.0)
    theirs = by_spam(SPAM, labels)
    for k, row in enumerate(rows, start=1):
        assert row["volume_m3"] == theirs["volumes"][k]
        assert row["equivalent_diameter_m"] == pytest.approx(2 * theirs["radii"][k], rel=1e-6)
        own = [row[f"principal_{i}_m5"] for i in (1, 2, 3)]
        assert np.allclose(own, np.sort(theirs["moments"][k]), rtol=0.01)


def test_half_of_the_mass_is_finer_than_d50():
    rows = [{"equivalent_diameter_m": d, "volume_m3": d**3} for d in (1.0, 1.0, 2.0, 2.0)]
    assert 1.0 < size_at(rows, 0.5) <= 2.0
    assert size_at(rows[:2], 0.5) == 1.0


def test_what_are_no_labels():
    with pytest.raises(InputError, match="expected integers"):
        shapes_of_labels(np.zeros((3, 3, 3)), 1.0)
    with pytest.raises(InputError, match="expected 0 for void"):
        shapes_of_labels(np.zeros((3, 3, 3), int), 1.0)


def test_a_brick_is_convex_and_a_notched_one_is_not():
    points, cells = box((2.0, 1.0, 1.0), (4, 2, 2))
    full = describe(1, tet_moments(points, cells), points, 10.0)
    cut = cells[points[cells].mean(axis=1)[:, 0] + points[cells].mean(axis=1)[:, 1] > 1.0]
    part = describe(1, tet_moments(points, cut), points, 10.0)
    assert full["convexity"] == pytest.approx(1.0) and part["convexity"] < 0.9
