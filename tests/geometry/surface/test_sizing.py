"""Edges as long as curvature, the next grain or the user wants them."""

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.geometry.surface.edge_sizes import curvature
from mufe_fenicsx.geometry.tets.jobs import surface_jobs, voxel_jobs
from mufe_fenicsx.geometry.tets.mesher import mesh_one
from tests.bodies import sphere
from tests.geometry.scenes import positions, two_balls

S = 1e-5  # voxel size [m]


def edges(mesh):
    """Middles and lengths of the edges of a mesh's surface."""
    x = mesh.points[measure.boundary_triangles(mesh.cells)]
    y = np.roll(x, 1, axis=1)
    return ((x + y) / 2).reshape(-1, 3), np.linalg.norm(x - y, axis=2).ravel()


def test_curvature_of_a_sphere_and_of_a_cylinder():
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(4000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # Chords turn normals by exactly chord / R.
    assert curvature(2.0 * normals, normals, 0.3) == pytest.approx(0.5, rel=1e-6)
    angle, z = rng.random(6000) * 2 * np.pi, rng.random(6000) * 4
    normals = np.stack([np.cos(angle), np.sin(angle), 0 * z], axis=1)
    points = 2.0 * normals + np.outer(z, (0, 0, 1))
    inner = (z > 1) & (z < 3)
    # cos²φ over some twenty random directions: 5 % of the mean over all points.
    found = curvature(points, normals, 0.3)[inner].mean()
    assert found == pytest.approx(0.5 / np.sqrt(2), rel=0.05)


def test_edges_follow_curvature():
    """A long ellipsoid is meshed finely at its tips: κ there against the waist as theory says."""
    shape, half = (28, 28, 60), np.array((9.0, 9.0, 25.0))
    inside = (((positions(shape) - np.array(shape) / 2) / half) ** 2).sum(axis=-1) < 1
    settings = MeshSettings(
        size=8 * S, smallest_size=2 * S, sizing="curvature", angle=25, growth=2.0
    )
    (job,) = voxel_jobs(inside.astype(np.int32), S, settings)
    mesh = mesh_one(job)
    assert mesh.ok and mesh.quality["volume_ratio"] == pytest.approx(1, abs=0.01)
    middle, length = edges(mesh)
    x = middle[:, 0] / S - 30
    tip, waist = length[np.abs(x) > 23].mean() / S, length[np.abs(x) < 5].mean() / S
    # Tip: κ = c/a² twice, 0.31 a voxel: h = 1.4, cut off at 2. Waist: 1/a and a/c², h = 5.5.
    # Edges of even meshes are 1.03 h long on average, with steps of voxels adding curvature.
    assert 1.6 < tip < 3.0
    assert 3.8 < waist < 6.0


def test_edges_follow_the_next_grain():
    settings = MeshSettings(size=6 * S, smallest_size=2 * S, sizing="contact")
    for job in voxel_jobs(two_balls(), S, settings):
        mesh = mesh_one(job)
        middle, length = edges(mesh)
        gap = np.abs(middle[:, 0] / S - 22)
        # Some of the edges that begin there lead to coarser ones, a sixth longer.
        assert length[gap < 2].mean() == pytest.approx(2.15 * S, rel=0.15)
        # 2 + 0.4 (gap - 2): 6 voxels from 12 on; edges that lead there from finer ones are shorter.
        assert 4.5 * S < length[gap > 13].mean() < 6.3 * S


def test_edges_inside_are_longer_where_asked():
    """The same surface, half the nodes inside, and no flatter elements than even meshes have."""
    inside = np.linalg.norm(positions((40, 40, 40)) - 20, axis=-1) < 16
    rows = []
    for inner in (1.0, 2.0):
        settings = MeshSettings(size=3.5 * S, inner_size=inner)
        (job,) = voxel_jobs(inside.astype(np.int32), S, settings)
        rows.append(mesh_one(job).quality)
    even, coarse = rows
    assert coarse["surface_nodes"] == even["surface_nodes"]
    # Edges inside grow from h to 2 h over the radius of 4.6 h: less than half the nodes are left.
    assert coarse["nodes"] - coarse["surface_nodes"] < (even["nodes"] - even["surface_nodes"]) / 2
    assert coarse["min_altitude_over_h"] > 0.25
    assert coarse["volume_ratio"] == pytest.approx(1, abs=1e-3)


def test_each_grain_takes_so_many_surface_nodes():
    points, cells = sphere(2.0, 0.4)
    ball = measure.compact(points, measure.boundary_triangles(cells))
    settings = MeshSettings(size=1.0, surface_nodes=150)
    (job,) = surface_jobs([(1, *ball)], settings)
    # Clusters come out as asked for; short edges that are collapsed cost a few.
    assert mesh_one(job).quality["surface_nodes"] == pytest.approx(150, rel=0.05)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"sizing": "fine"}, 'sizing = "fine", expected "uniform" or "curvature" or "contact"'),
        ({"smallest_size": 2.0}, "smallest_size = 2.0, expected a length in metres > 0 and <= "),
        ({"surface_nodes": 3}, "surface_nodes = 3, expected >= 20"),
        ({"min_angle": 60}, "min_angle = 60.0, expected 0 <= min_angle <= 35"),
    ],
)
def test_sizes_that_make_no_sense_are_refused(given, message):
    with pytest.raises(InputError, match=message):
        MeshSettings(size=1.0, **given)
