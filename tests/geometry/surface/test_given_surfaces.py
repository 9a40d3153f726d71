"""Surfaces from elsewhere are read, repaired or refused."""

import meshio
import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.mesh import mesh_labels
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.geometry.surface.given_surfaces import read_bodies
from mufe_fenicsx.geometry.tets.jobs import surface_jobs
from mufe_fenicsx.geometry.tets.mesher import mesh_one
from tests.bodies import sphere


@pytest.fixture
def ball():
    """Points and triangles of a sphere of radius 2."""
    points, cells = sphere(2.0, 0.5)
    return measure.compact(points, measure.boundary_triangles(cells))


def test_files_of_one_body_each(tmp_path, ball):
    points, triangles = ball
    for name in ("grain10.stl", "grain2.ply", "grain3.obj"):
        meshio.write_points_cells(tmp_path / name, points, [("triangle", triangles)])
    origins = []
    bodies = read_bodies(tmp_path, scale=1e-3, origins=origins)
    assert [label for label, _, _ in bodies] == [1, 2, 3]
    assert origins == [(1, "grain2.ply", 1), (2, "grain3.obj", 1), (3, "grain10.stl", 1)]
    for _, body_points, body_triangles in bodies:
        assert len(body_points) == len(points)  # STL repeats points
        volume = measure.surface_volume(body_points, body_triangles)
        # Files hold single precision.
        assert volume == pytest.approx(measure.surface_volume(points, triangles) * 1e-9, rel=1e-5)


@pytest.mark.parametrize("name", ["all.stl", "all.vtk", "all.msh"])
def test_one_file_of_many_bodies(tmp_path, ball, name):
    points, triangles = ball
    n = len(points)
    both = (
        np.concatenate([points, points + 6.0]),
        np.concatenate([triangles + n, triangles]) % (2 * n),
    )
    meshio.write_points_cells(tmp_path / name, both[0], [("triangle", both[1])])
    origins = []
    bodies = read_bodies(tmp_path / name, origins=origins)
    assert origins == [(1, name, 1), (2, name, 2)]
    assert [label for label, _, _ in bodies] == [1, 2]
    assert [len(p) for _, p, _ in bodies] == [n, n]
    # In the order of their first triangles: the shifted one comes first.
    assert bodies[0][1].min() > 3.0 > bodies[1][1].max()


def test_the_file_of_each_grain_is_kept_with_its_mesh(tmp_path, ball, no_workers):
    points, triangles = ball
    (tmp_path / "sand").mkdir()
    meshio.write_points_cells(tmp_path / "sand" / "quartz.stl", points, [("triangle", triangles)])
    mesh_labels(tmp_path / "sand", MeshSettings(size=1.5, processes=1), tmp_path / "grains")
    table = (tmp_path / "grains" / "labels.csv").read_text().split()
    assert table == ["label,file,body", "1,quartz.stl,1"]


def test_orientation_is_repaired(tmp_path, ball):
    points, triangles = ball
    mixed = triangles.copy()
    mixed[::3] = mixed[::3, ::-1]
    np.savez(
        tmp_path / "bodies.npz",
        vertices=np.concatenate([points, points + 10]),
        faces=np.concatenate([triangles[:, ::-1], mixed + len(points)]),
        grain_of_face=np.repeat([4, 9], len(triangles)),
    )
    notices = []
    bodies = read_bodies(tmp_path / "bodies.npz", notices=notices)
    n, some = len(triangles), len(triangles[::3])
    assert [notice.partition(": grain ")[2] for notice in notices] == [
        f"4 (bodies.npz): {n} triangles turned",
        f"9 (bodies.npz): {some} triangles turned",
    ]
    assert [label for label, _, _ in bodies] == [4, 9]
    for _, body_points, body_triangles in bodies:
        assert measure.surface_defect(body_points, body_triangles) == ""


def test_open_surfaces_are_refused(tmp_path, ball):
    points, triangles = ball
    # A cap of a third of the ball is gone: more than a hole.
    cut = triangles[points[triangles][:, :, 2].mean(axis=1) < 0.7]
    meshio.write_points_cells(tmp_path / "open.ply", points, [("triangle", cut)])
    with pytest.raises(InputError, match=r"open.ply.*surface has open edges \(\d+\), expected"):
        read_bodies(tmp_path)


def test_small_holes_are_closed(tmp_path, ball):
    points, triangles = ball
    gone = (triangles == triangles[0, 0]).any(axis=1)  # all around one vertex
    meshio.write_points_cells(tmp_path / "hole.ply", points, [("triangle", triangles[~gone])])
    notices = []
    ((_, found, faces),) = read_bodies(tmp_path, notices=notices)
    assert measure.surface_defect(found, faces) == ""
    # A ring of k edges takes k - 2 triangles.
    assert notices[0].endswith(f"holes closed by {np.count_nonzero(gone) - 2} triangles")


def test_surfaces_that_cross_themselves_are_refused(tmp_path, ball):
    points, triangles = ball
    dented = points.copy()
    dented[np.argmax(points[:, 2]), 2] = -2.5  # the top node pulled out through the bottom
    meshio.write_points_cells(tmp_path / "crossed.ply", dented, [("triangle", triangles)])
    with pytest.raises(InputError, match=r"crossed.ply.*crosses itself at \d+ pairs.*near"):
        read_bodies(tmp_path)


@pytest.mark.parametrize("name", ["broken.stl", "broken.ply", "broken.obj"])
def test_broken_files_are_refused(tmp_path, name):
    (tmp_path / name).write_bytes(b"\x00\x01 no surface")
    with pytest.raises(InputError, match=name):
        read_bodies(tmp_path)


def test_hidden_files_are_no_surfaces(tmp_path, ball):
    points, triangles = ball
    meshio.write_points_cells(tmp_path / "a.stl", points, [("triangle", triangles)])
    (tmp_path / "._a.stl").write_bytes(b"\0\5\x16\7")
    assert len(read_bodies(tmp_path)) == 1


def test_a_body_is_meshed_anew(ball):
    points, triangles = ball
    (job,) = surface_jobs([(1, points, triangles)], MeshSettings(size=0.7))
    mesh = mesh_one(job)
    assert mesh.ok
    # The remeshed body is scaled to the volume that it was given.
    assert mesh.quality["volume_ratio"] == pytest.approx(1, abs=1e-6)
    assert np.linalg.norm(mesh.points, axis=1).max() < 2 * 1.03
