"""Edges as long as the next grain or the user wants them."""

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.settings import MeshSettings
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
        ({"sizing": "fine"}, 'sizing = "fine", expected "uniform" or "contact"'),
        ({"smallest_size": 2.0}, "smallest_size = 2.0, expected a length in metres > 0 and <= "),
        ({"surface_nodes": 3}, "surface_nodes = 3, expected >= 20"),
        ({"min_angle": 60}, "min_angle = 60.0, expected 0 <= min_angle <= 35"),
    ],
)
def test_sizes_that_make_no_sense_are_refused(given, message):
    with pytest.raises(InputError, match=message):
        MeshSettings(size=1.0, **given)
