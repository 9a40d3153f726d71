"""Grains in voxels become bodies of tetrahedra that are closed, keep their volume and lie apart."""

import itertools

import numpy as np
import pytest
import pyvista
import scipy.ndimage

from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.image.distance import voxel_distance
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.geometry.tets.jobs import voxel_jobs
from mufe_fenicsx.geometry.tets.mesher import mesh_grains, mesh_one
from mufe_fenicsx.geometry.tets.slivers import thickened
from mufe_fenicsx.kernels.contact.spline import spline_value_and_gradient
from tests.bodies import euler_characteristic
from tests.geometry.scenes import ball, positions, two_balls

S = 1e-5  # voxel size [m]
H = 3 * S


def meshes_of(labels, **settings):
    """A mesh a grain, made in this process."""
    return [mesh_one(job) for job in voxel_jobs(labels, S, MeshSettings(size=H, **settings))]


def surface(mesh):
    """Nodes and triangles of the boundary of a mesh."""
    return measure.compact(mesh.points, measure.boundary_triangles(mesh.cells))


def deepest_overlap(first, second):
    """Greatest depth of a surface node of one body within the other [m]."""
    depth = 0.0
    for a, b in ((first, second), (second, first)):
        body = pyvista.PolyData.from_regular_faces(*surface(b))
        nodes = pyvista.PolyData(surface(a)[0]).compute_implicit_distance(body)
        depth = max(depth, -nodes["implicit_distance"].min())
    return depth


def test_a_ball_of_voxels():
    voxels = ball((24, 24, 24), (12, 12, 12), 8)
    (mesh,) = meshes_of(voxels.astype(np.int32))
    volumes = measure.tet_volumes(mesh.points, mesh.cells)
    points, triangles = surface(mesh)
    assert volumes.min() > 0
    assert measure.surface_defect(points, triangles) == ""
    assert euler_characteristic(triangles) == 2
    # The volume is solved for, to 1e-4.
    assert volumes.sum() == pytest.approx(voxels.sum() * S**3, rel=2e-4)
    # Voxels know a surface to half a voxel; facets cut off, and nodes so stand out, by h²/8R.
    distance = np.linalg.norm(points / S - 12, axis=1)
    assert np.abs(distance - 8).max() < 0.5
    assert mesh.quality["min_altitude_over_h"] > 0.2
    assert mesh.quality["volume_ratio"] == pytest.approx(1, abs=2e-4)


def test_smoothing_takes_what_theory_says():
    """A Gaussian moves the level 1/2 of a ball inward by σ²/R: half its width times curvature."""
    voxels = ball((36, 36, 36), (18, 18, 18), 13)
    (mesh,) = meshes_of(voxels.astype(np.int32), keep_volume=False)
    distance = np.linalg.norm(surface(mesh)[0] / S - 18, axis=1)
    radius = np.cbrt(voxels.sum() * 3 / (4 * np.pi))
    # Staircases of voxels leave a scatter of 0.08 voxel, so 270 nodes a mean to 0.005.
    assert distance.mean() == pytest.approx(radius - 1 / radius, abs=0.015)


@pytest.mark.parametrize(("tolerance", "ok"), [(None, False), (0.9, True)])
def test_a_mesh_of_another_volume_is_refused_unless_told(tolerance, ok):
    """Smoothing takes 3σ²/R² of a ball, here of 3.2 voxels, and long facets cut off more."""
    voxels = ball((12, 12, 12), (6, 6, 6), 3.2).astype(np.int32)
    told = {} if tolerance is None else {"volume_tolerance": tolerance}
    (mesh,) = meshes_of(voxels, keep_volume=False, **told)
    assert mesh.ok == ok
    if ok:
        assert mesh.quality["volume_ratio"] < 0.8
    else:
        assert "expected within volume_tolerance = 0.2: take a smaller" in mesh.quality["reason"]


def test_touching_balls_do_not_overlap():
    first, second = meshes_of(two_balls())
    # Both surfaces lie on one level set there; what is left is the third order of the
    # interpolation that finds it.
    assert deepest_overlap(first, second) < 0.02 * H


def test_slanted_faces_do_not_overlap():
    """Two blocks parted by an oblique plane: the worst staircase for voxels."""
    shape = (26, 26, 26)
    inside = np.all((positions(shape) > 3) & (positions(shape) < 23), axis=-1)
    side = positions(shape) @ np.array([1.0, 2.0, 3.0]) < 78
    labels = np.where(inside, np.where(side, 1, 2), 0).astype(np.int32)
    first, second = meshes_of(labels)
    # Along the edges of the face, facets of edge h cut corners: a few per cent of h.
    assert deepest_overlap(first, second) < 0.05 * H


def test_a_grain_that_is_too_small_is_named(no_workers):
    labels = two_balls()
    labels[1:4, 1:4, 1:4] = 7
    meshes = mesh_grains(voxel_jobs(labels, S, MeshSettings(size=H)), processes=1)
    assert [mesh.label for mesh in meshes] == [1, 2, 7]
    assert [mesh.ok for mesh in meshes] == [True, True, False]
    assert meshes[2].quality["status"] == "failed"
    assert "too small" in meshes[2].quality["reason"]


def test_flat_tetrahedra_become_thicker_and_the_surface_stays():
    """A cube meshed evenly whose inner node was pushed against a face, and one edge node along."""
    points, cells = block()
    inner = np.flatnonzero(np.all(points == 1.0, axis=1))[0]
    points[inner] = (1.0, 1.0, 0.02)
    edge = np.flatnonzero(np.all(points == (1.0, 0.0, 0.0), axis=1))[0]
    points[edge] = (0.05, 0.0, 0.0)
    before = measure.smallest_altitudes(points, cells)
    assert before.min() < 0.05
    moved = thickened(points, cells, 1.0, tolerance=1e-6)
    assert measure.smallest_altitudes(moved, cells).min() > 0.35
    # A cube's faces and edges let nodes slide along them only: its volume stays to round-off.
    assert measure.tet_volumes(moved, cells).sum() == pytest.approx(8, rel=1e-6)
    held = thickened(points, cells, 1.0, tolerance=1e-6, fixed=[edge])
    assert np.array_equal(held[edge], points[edge])
    along = np.full((len(points), 2), -1)
    ends = [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    along[edge] = [np.flatnonzero(np.all(points == end, axis=1))[0] for end in ends]
    slid = thickened(points, cells, 1.0, tolerance=1e-6, along=along)
    assert slid[edge][0] > 0.3 and np.array_equal(slid[edge][1:], (0.0, 0.0))
    assert measure.smallest_altitudes(slid, cells).min() > 0.3


def block():
    """A cube of edge 2 in six tetrahedra a unit cube (Kuhn)."""
    grid = np.stack(np.meshgrid(*[np.arange(3.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    steps = [np.eye(3)[list(order)].cumsum(axis=0) for order in itertools.permutations(range(3))]
    corners = np.concatenate([np.zeros((6, 1, 3)), np.array(steps)], axis=1)
    low = np.array(list(itertools.product((0, 1), repeat=3)))
    at = (low[:, None, None] + corners).reshape(-1, 4, 3) @ (9, 3, 1)
    return grid, measure.positively_oriented(grid, at.astype(np.int64))


def test_distance_from_voxels():
    """A plate of voxels with one voxel on it: distances to its faces and edges, by hand."""
    inside = np.zeros((6, 9, 9), dtype=bool)
    inside[2:4, 1:8, 1:8] = True
    inside[4, 4, 4] = True
    at = np.array([(3, 4.5, 4.5), (4.3, 2.2, 2.2), (5.3, 5.4, 4.5), (4.2, 4.5, 5.1), (2.5, 8.3, 9)])
    expected = (1, 0.3, np.hypot(0.3, 0.4), 0.1, np.hypot(0.3, 1))
    assert voxel_distance(inside, at) == pytest.approx(expected, rel=1e-12)


def test_a_spline_and_its_gradient():
    """Against SciPy's spline and central differences, also on the border of the grid."""
    field = scipy.ndimage.gaussian_filter(np.random.default_rng(1).random((9, 8, 7)), 1.0)
    at = np.random.default_rng(2).random((50, 3)) * (np.array(field.shape) - 1)
    coefficients = scipy.ndimage.spline_filter(field, mode="nearest", output=float)
    value, gradient = np.empty(50), np.empty((50, 3))
    spline_value_and_gradient(value, gradient, coefficients, at)

    def spline(x):
        return scipy.ndimage.map_coordinates(coefficients, x.T, mode="nearest", prefilter=False)

    inner = np.all((at > 1) & (at < np.array(field.shape) - 2), axis=1)
    # Beyond the grid SciPy reflects and this one goes on evenly: the same inside, to round-off.
    assert value[inner] == pytest.approx(spline(at)[inner], rel=1e-12)
    for axis, d in enumerate(1e-5 * np.eye(3)):
        central = (spline(at + d) - spline(at - d)) / 2e-5
        assert gradient[inner, axis] == pytest.approx(central[inner], rel=1e-6, abs=1e-8)
