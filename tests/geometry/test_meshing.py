"""Grains in voxels become bodies of tetrahedra that are closed, keep their volume and lie apart."""

import os

import numpy as np
import pytest
import pyvista
from scenes import ball, positions, two_balls

from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.mesher import mesh_grains, mesh_one, voxel_jobs
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.geometry.workers import run_jobs

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
    assert measure.euler_characteristic(triangles) == 2
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


def test_faces_on_the_border_of_the_image_are_flat():
    shape = (22, 22, 22)
    labels = ball(shape, (4, 11, 11), 9).astype(np.int32)
    (mesh,) = meshes_of(labels)
    points, _ = surface(mesh)
    z = points[:, 2] / S
    assert z.min() == 0
    # The cut is a disc of radius sqrt(81 - 16) = 8.1 voxels: 205 h² / 9 / 0.87 nodes.
    assert np.count_nonzero(z == 0) > 15
    assert mesh.quality["volume_ratio"] == pytest.approx(1, abs=0.01)


def test_a_grain_that_is_too_small_is_named():
    labels = two_balls()
    labels[1:4, 1:4, 1:4] = 7
    meshes = mesh_grains(voxel_jobs(labels, S, MeshSettings(size=H)), processes=1)
    assert [mesh.label for mesh in meshes] == [1, 2, 7]
    assert [mesh.ok for mesh in meshes] == [True, True, False]
    assert meshes[2].quality["status"] == "failed"
    assert "too small" in meshes[2].quality["reason"]


def half_or_die(number):
    """A job of which one kills its process."""
    if number == 3:
        os._exit(1)
    return number / 2


def test_a_worker_that_dies_costs_only_its_own_job():
    seen = []
    results = run_jobs(half_or_die, range(1, 7), processes=2, progress=seen.append)
    assert results == [0.5, 1.0, None, 2.0, 2.5, 3.0]
    assert seen[-1] == 6
