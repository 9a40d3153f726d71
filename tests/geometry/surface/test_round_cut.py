"""Grains that a cylinder cuts: faces on it to rounding, sharp edges, all of their volume."""

import numpy as np
import pytest

from mufe_fenicsx.contact.curved_walls import ON_WALL
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.grains import load_grains
from mufe_fenicsx.geometry.image.cylinder import Cylinder
from mufe_fenicsx.geometry.image.label_files import write_labels
from mufe_fenicsx.geometry.image.round_sample import cut_labels
from mufe_fenicsx.geometry.mesh import mesh_labels
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.geometry.tets.jobs import voxel_jobs
from mufe_fenicsx.geometry.tets.mesher import mesh_one
from tests.geometry.scenes import ball

S = 1e-5
CYLINDER = Cylinder(50.0, 48.0, 40.3)
SHAPE = (30, 100, 100)
RADIUS = 11.0


def cut_ball(middle, size=3.0):
    """Mesh of a ball that the cylinder cuts."""
    labels, _ = cut_labels(ball(SHAPE, middle, RADIUS).astype(np.int32), CYLINDER)
    (job,) = voxel_jobs(labels, S, MeshSettings(size=size * S), CYLINDER)
    return mesh_one(job)


def volume_and_area(middle, steps=400):
    """Of a ball within the cylinder and z > 0, and of the cylinder within the ball [voxels]."""
    z, j, i = middle
    angle = (np.arange(4 * steps) + 0.5) * 2 * np.pi / (4 * steps)
    x, y = (
        CYLINDER.x + CYLINDER.radius * np.cos(angle),
        CYLINDER.y + CYLINDER.radius * np.sin(angle),
    )
    chord = np.sqrt(np.maximum(RADIUS**2 - (x - i) ** 2 - (y - j) ** 2, 0))
    height = np.minimum(z + chord, SHAPE[0]) - np.maximum(z - chord, 0)
    area = CYLINDER.radius * np.where(chord > 0, np.maximum(height, 0), 0).mean() * 2 * np.pi
    at = (np.arange(steps) + 0.5) / steps * 2 * RADIUS - RADIUS
    x, y = np.meshgrid(i + at, j + at)
    chord = np.sqrt(np.maximum(RADIUS**2 - (x - i) ** 2 - (y - j) ** 2, 0))
    height = np.minimum(z + chord, SHAPE[0]) - np.maximum(z - chord, 0)
    inside = (np.hypot(x - CYLINDER.x, y - CYLINDER.y) < CYLINDER.radius) & (chord > 0)
    return (np.maximum(height, 0) * inside).sum() * (2 * RADIUS / steps) ** 2, area


def off_axis(z, away):
    """Place at the distance ``away`` from the axis of the cylinder."""
    return z, CYLINDER.y + away * np.sin(0.6), CYLINDER.x + away * np.cos(0.6)


@pytest.mark.parametrize("inward", [-5.5, 0.0, 5.5])
def test_the_face_is_as_large_as_the_cylinder_in_the_ball(inward):
    """Whether the ball narrows towards the rim, whose slope goes on to it, or widens."""
    middle = off_axis(15.0, CYLINDER.radius - inward)
    mesh = cut_ball(middle)
    area = measure.area_on_cylinder(
        mesh.points, mesh.cells, (CYLINDER.x * S, CYLINDER.y * S, CYLINDER.radius * S)
    )
    # The last voxels lie 0.7 voxels within, where the section of a slope of 0.6 is 8 % another. Of
    # second order there remain σ²/R² of the filter, 1 %, h²/12R² of chords, 1 %, and as much of the
    # fit; by how the ball lies in the voxels it varies by 1.5 %.
    assert area / S**2 == pytest.approx(volume_and_area(middle)[1], rel=0.05)


@pytest.mark.parametrize("z", [15.0, 4.0])
def test_a_cut_ball_has_a_round_face(z):
    """At z = 4 the image's lower face cuts it too."""
    middle = off_axis(z, 38.0)
    mesh = cut_ball(middle)
    volume, area = volume_and_area(middle)
    axis = np.array([CYLINDER.x, CYLINDER.y]) * S
    off = np.linalg.norm(mesh.points[:, :2] - axis, axis=1) / (CYLINDER.radius * S) - 1
    on = np.abs(off) < 1e-12
    # On the cylinder, or a twentieth of a voxel and more within.
    assert np.count_nonzero(on) > 40 and off[~on].max() < -1e-4
    triangles = measure.boundary_triangles(mesh.cells)
    cut = on[triangles].all(axis=1)
    found = measure.surface_area(mesh.points, triangles[cut]) / S**2
    assert found == pytest.approx(
        measure.area_on_cylinder(mesh.points, mesh.cells, (*axis, CYLINDER.radius * S)) / S**2
    )
    # As in the test before; the image's face goes on as the last voxels are.
    assert found == pytest.approx(area, rel=0.05)
    assert mesh.quality["volume_ratio"] == pytest.approx(1, abs=2e-3)
    assert mesh.quality["voxel_volume_m3"] / S**3 == pytest.approx(volume, rel=0.01)
    assert mesh.quality["min_altitude_over_h"] > 0.3
    # The wall takes its facets for parts of it.
    wall = Wall("side", [*axis, 0], [0, 0, 1], radius=CYLINDER.radius * S)
    assert np.abs(wall.gap(mesh.points[on])).max() < ON_WALL * 3 * S / 100
    # The edge is sharp: facets on either side of it are about at right angles, none is between.
    x = mesh.points[triangles]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    out = x.mean(axis=1)[:, :2] - axis
    outward = np.einsum("ij,ij->i", normal[:, :2], out / np.linalg.norm(out, axis=1)[:, None])
    assert outward[cut].min() > 0.99
    assert outward[~cut].max() < 0.5


def test_both_sides_of_a_cut_fill_the_cylinder():
    """Two grains that fill a disc meet the rim together: no wedge is left between them."""
    labels = np.zeros((12, 60, 60), dtype=np.int32)
    cylinder = Cylinder(30.0, 30.0, 24.5)
    # Grains of a pie in eight: each is narrower than the cylinder.
    y, x = np.mgrid[:60, :60] - 29.5
    labels[:] = 1 + ((np.arctan2(y, x) + np.pi) / (2 * np.pi) * 8).astype(int) % 8
    labels, _ = cut_labels(labels, cylinder)
    jobs = [job for job in voxel_jobs(labels, S, MeshSettings(size=3.5 * S), cylinder)][:2]
    meshes = [mesh_one(job) for job in jobs]
    area = sum(
        measure.area_on_cylinder(m.points, m.cells, (30 * S, 30 * S, 24.5 * S)) for m in meshes
    )
    # Chords of h = 3.5 lose h²/24R² of the arc, 0.1 %.
    assert area / S**2 == pytest.approx(2 * np.pi * 24.5 * 12 / 4, rel=0.01)


def test_a_cylinder_is_cut_out_of_any_labels(tmp_path, no_workers):
    labels = ball(SHAPE, off_axis(15.0, 38.0), RADIUS) + 2 * ball(SHAPE, (15.0, 48.0, 40.0), 8.0)
    labels = labels.astype(np.int32)
    labels[ball(SHAPE, (12.0, 8.0, 10.0), 7.0)] = 3  # beyond it altogether
    write_labels(tmp_path / "labels.tif", labels, S)
    settings = MeshSettings(size=4 * S, cylinder_middle=(50 * S, 48 * S),
                            cylinder_radius=40.3 * S, processes=1)  # fmt: skip
    made = mesh_labels(tmp_path / "labels.tif", settings, tmp_path / "grains")
    grains = load_grains(tmp_path / "grains")
    assert grains.labels.tolist() == [1, 2]
    assert grains.cylinder == pytest.approx([50 * S, 48 * S, 40.3 * S], rel=1e-12)
    assert 0 < made["round_faces_share"] < 0.1
    far = np.linalg.norm(grains.points[:, :2] - grains.cylinder[:2], axis=1)
    assert far.max() <= 40.3 * S * (1 + 1e-14)
    for more, words in (
        ({"cylinder_radius": 51 * S}, "expected > 0 and at most"),
        ({"cylinder_radius": 40 * S, "conforming": True}, "conforming = true with a cylinder"),
    ):
        with pytest.raises(InputError, match=words):
            mesh_labels(tmp_path / "labels.tif", MeshSettings(size=4 * S, **more), tmp_path / "no")
    assert not (tmp_path / "no").exists()


def test_a_grain_as_wide_as_the_cylinder_is_refused():
    labels = np.ones((8, 30, 30), dtype=np.int32)
    cylinder = Cylinder(15.0, 15.0, 12.0)
    labels, _ = cut_labels(labels, cylinder)
    (job,) = voxel_jobs(labels, S, MeshSettings(size=3 * S), cylinder)
    assert "grain is too wide for the cylinder" in mesh_one(job).quality["reason"]
