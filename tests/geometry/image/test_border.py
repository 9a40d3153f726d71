"""Grains that the border of the image cuts: plane faces, sharp edges, all of their volume."""

import numpy as np
import pytest

from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.geometry.surface.creases import crease_chains
from mufe_fenicsx.geometry.surface.level_set import smoothed
from mufe_fenicsx.geometry.surface.surface import isosurface
from mufe_fenicsx.geometry.tets.jobs import voxel_jobs
from mufe_fenicsx.geometry.tets.mesher import mesh_one
from tests.geometry.scenes import ball, positions, two_balls
from tests.geometry.tets.test_meshing import H, S, deepest_overlap, meshes_of, surface


def normals(points, triangles):
    """Unit normals and areas of triangles."""
    x = points[triangles]
    area = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]) / 2
    size = np.linalg.norm(area, axis=1)
    return area / size[:, None], size


def test_half_a_ball_is_cut_flat_and_sharp():
    voxels = ball((12, 26, 26), (0, 13, 13), 9)
    (mesh,) = meshes_of(voxels.astype(np.int32))
    points, triangles = surface(mesh)
    cut = (points[triangles, 2] == 0).all(axis=1)
    normal, area = normals(points, triangles)
    assert points[:, 2].min() == 0
    assert (normal[cut, 2] == -1).all()
    # A ball stands upright on its cut; over the edge h of a facet it turns by 3 / 9 rad, of which
    # facets show half. An edge rounded or bevelled by one row of facets would show 0.7.
    assert normal[~cut, 2].min() > -0.25
    # The chords of its edge lose h² / 6 R² = 2 %.
    assert area[cut].sum() == pytest.approx(voxels[0].sum() * S**2, rel=0.025)
    assert mesh.quality["volume_ratio"] == pytest.approx(1, abs=1e-3)
    assert mesh.quality["min_altitude_over_h"] > 0.3


def test_a_corner_of_the_image_is_a_corner_of_the_grain():
    """Three faces meet in it, three edges of the image lead from it."""
    voxels = ball((14, 14, 14), (-1, 0.5, 1), 12)
    (mesh,) = meshes_of(voxels.astype(np.int32))
    points, triangles = surface(mesh)
    assert measure.surface_defect(points, triangles) == ""
    held = points == 0
    assert held.all(axis=1).sum() == 1
    _, area = normals(points, triangles)
    for axis in range(3):
        # The voxels' outline, some chords less, as above.
        cut = held[triangles, axis].all(axis=1)
        voxels_cut = voxels.take(0, axis=2 - axis).sum()
        assert area[cut].sum() == pytest.approx(voxels_cut * S**2, rel=0.025)
    # 12 voxels at 3 a node.
    assert (held.sum(axis=1) == 2).sum() in range(9, 14)
    assert mesh.quality["volume_ratio"] == pytest.approx(1, abs=2e-3)


def test_an_image_full_of_one_grain_is_a_box():
    (mesh,) = meshes_of(np.ones((9, 10, 11), dtype=np.int32))
    points, _ = surface(mesh)
    box = np.array([11, 10, 9]) * S
    assert ((points == 0) | (points == box)).any(axis=1).all()
    assert measure.tet_volumes(mesh.points, mesh.cells).sum() == pytest.approx(box.prod(), rel=1e-9)
    _, triangles, tags = isosurface(smoothed(np.ones((21,) * 3), 1, [-6] * 3, [9] * 3, 1.0))
    chains = crease_chains(triangles, tags)
    assert len(chains) == 12
    assert len({int(end) for chain in chains for end in chain[[0, -1]]}) == 8


@pytest.mark.parametrize("thickness", [1, 2, 3])
def test_a_slice_keeps_its_volume(thickness):
    """A cap of few voxels' height, which smoothing against void would take away."""
    radius = 14
    voxels = ball((8, 28, 28), (thickness - radius, 14, 14), radius)
    (mesh,) = meshes_of(voxels.astype(np.int32))
    assert mesh.ok
    assert mesh.quality["volume_ratio"] == pytest.approx(1, abs=0.01)
    # What smoothing takes from the thin rim makes the middle thicker; whole steps are a voxel.
    assert mesh.points[:, 2].max() < (thickness + 0.7) * S
    # A third of the thickness, 2 V / A of about two thirds of the height.
    assert mesh.quality["min_altitude_over_h"] > 0.2 * thickness * S / H


def test_cut_grains_that_touch_do_not_overlap():
    first, second = meshes_of(np.ascontiguousarray(two_balls()[14:]))
    # As for whole ones; the chords of the edges of their cuts bend by h² / 8 R = 0.04 H.
    assert deepest_overlap(first, second) < 0.04 * H
    for mesh in (first, second):
        assert mesh.quality["volume_ratio"] == pytest.approx(1, abs=2e-3)


def test_a_small_cut_face_stays_one():
    """A face of half an edge length squared, whose edge takes three nodes, does not close up."""
    shape, centre, axes = (13, 11, 11), (3.8, 7.8, 5.5), (4.3, 7.7, 4.4)
    inside = (((positions(shape) - centre) / axes) ** 2).sum(axis=-1) < 1
    settings = MeshSettings(size=3.7 * S)
    (job,) = voxel_jobs(inside.astype(np.int32), S, settings)
    mesh = mesh_one(job)
    assert mesh.quality["attempts"] == 1
    assert mesh.quality["volume_ratio"] == pytest.approx(1, abs=5e-3)
    points, triangles = surface(mesh)
    cut = (points[triangles, 1] == 0).all(axis=1)
    _, area = normals(points, triangles[cut])
    # Three nodes on a circle enclose 0.41 of it; smoothing and volume leave it about as large.
    assert 0.2 < area.sum() / (inside[:, 0].sum() * S**2) < 1
