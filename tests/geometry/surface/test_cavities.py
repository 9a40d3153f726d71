"""Cavities, necks and several bodies in one surface: meshed as they are, cut, or said."""

import meshio
import numpy as np
import pytest
import scipy.ndimage

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.image.labels import fill_cavities, largest_piece
from mufe_fenicsx.geometry.mesh import warnings_of
from mufe_fenicsx.geometry.pieces import piece_of_cell
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.geometry.surface.given_surfaces import read_bodies
from mufe_fenicsx.geometry.tets.jobs import shared_jobs, surface_jobs, voxel_jobs
from mufe_fenicsx.geometry.tets.mesher import mesh_one
from mufe_fenicsx.kernels.geometry.topology import body_defect
from tests.bodies import euler_characteristic, sphere
from tests.geometry.scenes import ball

N, MIDDLE = (25, 25, 25), (12, 12, 12)


def hollow(void, inner=None):
    """A ball of radius 10 voxels with a void, and another ball in it."""
    labels = ball(N, MIDDLE, 10).astype(np.int32)
    labels[ball(N, MIDDLE, void)] = 0
    if inner:
        labels[ball(N, MIDDLE, inner)] = 2
    return labels


@pytest.mark.parametrize("make", [voxel_jobs, shared_jobs])
def test_a_hollow_ball_stays_hollow(make):
    """Both its surfaces lie where the voxels are; a ball inside does not touch it."""
    first, second = (mesh_one(job) for job in make(hollow(7, 4), 1.0, MeshSettings(size=2.5)))
    # The volume is solved for, to 1e-4; of grains that share facets to 3e-3.
    assert first.quality["volume_ratio"] == pytest.approx(1, abs=3e-3)
    triangles = measure.boundary_triangles(first.cells)
    assert piece_of_cell(triangles).max() == 1
    assert euler_characteristic(triangles) == 4
    distance = np.linalg.norm(first.points[np.unique(triangles)] - 12, axis=1)
    # Voxels know a surface to half a voxel; nodes stand out by h²/8R beside that.
    assert np.minimum(np.abs(distance - 10), np.abs(distance - 7)).max() < 0.7
    assert np.linalg.norm(second.points - 12, axis=1).max() < 5


def test_which_voids_are_filled():
    labels = np.zeros((14, 14, 30), dtype=np.int32)
    labels[1:13, 1:13, 1:13] = 1
    labels[1:13, 1:13, 16:30] = 2
    labels[3, 3, 3] = labels[5, 5, 5:8] = 0  # of 1 and 3 voxels
    labels[7:10, 7:10, 7:10] = 0
    labels[8, 8, 8] = 2  # a void with another grain in it is none of this
    labels[4, 4, 29] = labels[8, 8, 20:23] = 0  # open at the border; and 3 voxels
    labels[11, 11, 11] = labels[12, 12, 12] = 0  # open by a corner
    given = labels.copy()
    assert fill_cavities(labels, 2) == {1: (1, 1)}
    labels = given.copy()
    assert fill_cavities(labels) == {1: (2, 4), 2: (1, 3)}
    assert np.count_nonzero(labels != given) == 7
    # A ball of the least cavity takes the fewest nodes of the least size, to rounding.
    settings = MeshSettings(size=2.0)
    r = (3 * settings.least_cavity / (4 * np.pi)) ** (1 / 3)
    assert 4 * np.pi * r**2 * 2 / np.sqrt(3) / settings.least_size**2 == pytest.approx(20)


@pytest.mark.parametrize("seed", range(3))
def test_necks_become_necks_or_are_cut(seed):
    """Two balls of voxels on a thin neck: one body without a joint, or said."""
    rng = np.random.default_rng(seed)
    gap, width = [(1, 1), (2, 2), (6, 1)][seed]
    labels = np.zeros((17, 17, 30 + gap), dtype=np.int32)
    for middle in (7, 22 + gap):
        labels[ball(labels.shape, (8, 8, middle), 6.6)] = 1
    y = rng.integers(6, 10)
    labels[y : y + width, 8 : 8 + width, 7 : 22 + gap] = 1
    mesh = mesh_one(next(iter(voxel_jobs(labels, 1.0, MeshSettings(size=2.5)))))
    if mesh.ok:
        assert body_defect(mesh.cells, len(mesh.points)) == ""
        volume = measure.tet_volumes(mesh.points, mesh.cells).sum()
        assert mesh.quality["volume_ratio"] == pytest.approx(volume / np.count_nonzero(labels))
        # A ball whose neck broke does not grow to the volume of both; voxels know half a voxel.
        assert mesh.quality["distance_95_m"] < 0.7
    else:
        assert "of the volume of the grain" in mesh.quality["reason"]


@pytest.mark.parametrize("seed", [3, 5])
def test_sponges_are_bodies(seed):
    """The largest piece of smooth noise has handles, necks and cavities of all sizes."""
    noise = np.random.default_rng(seed).normal(size=(18, 18, 18))
    field = scipy.ndimage.gaussian_filter(noise, 1.6)
    labels = np.pad(largest_piece(field > -0.3 * field.std()), 3).astype(np.int32)
    settings = MeshSettings(size=2.0)
    fill_cavities(labels, settings.least_cavity)
    mesh = mesh_one(next(iter(voxel_jobs(labels, 1.0, settings))))
    assert body_defect(mesh.cells, len(mesh.points)) == ""
    # Solved for to 1e-4 before facets and nodes are evened out: a tenth of what is warned of.
    assert mesh.quality["volume_ratio"] == pytest.approx(1, abs=2e-3)


def shell(radius, middle=(0, 0, 0), h=0.7):
    points, cells = sphere(radius, h)
    points, triangles = measure.compact(points, measure.boundary_triangles(cells))
    return points + np.array(middle), triangles


def joined(*parts):
    first = np.cumsum([0] + [len(points) for points, _ in parts])
    triangles = [t + n for (_, t), n in zip(parts, first, strict=False)]
    return np.concatenate([p for p, _ in parts]), np.concatenate(triangles)


def turned(part):
    return part[0], part[1][:, ::-1]


def cone(side):
    """A pyramid of four sides with its tip in the origin."""
    base = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    points = np.vstack([np.zeros(3), np.column_stack([base, np.full(4, side)])])
    sides = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [1, 4, 3], [1, 3, 2]]
    return points, np.array(sides)[:, :: -1 if side > 0 else 1]


def volumes(bodies):
    return [measure.surface_volume(points, triangles) for _, points, triangles in bodies]


@pytest.mark.parametrize("inside", [shell(1.5), turned(shell(1.5))])
def test_a_surface_inside_another_is_its_cavity(tmp_path, inside):
    """However it is turned; a body in the cavity is one of its own."""
    outer, core = shell(3), shell(0.8, h=0.4)
    parts = [outer, inside, core, shell(1.0, (9, 0, 0))]
    points, triangles = joined(*parts)
    meshio.write_points_cells(tmp_path / "a.ply", points, [("triangle", triangles)])
    notices = []
    bodies = read_bodies(tmp_path / "a.ply", notices=notices)
    volume = [abs(measure.surface_volume(*part)) for part in parts]
    # Files hold double precision, nodes are rounded to 1e-7 of the extent.
    wanted = [volume[0] - volume[1], volume[2], volume[3]]
    assert volumes(bodies) == pytest.approx(wanted, rel=1e-5)
    mesh = mesh_one(next(iter(surface_jobs(bodies, MeshSettings(size=0.8)))))
    assert mesh.quality["volume_ratio"] == pytest.approx(1, abs=1e-6)
    assert piece_of_cell(measure.boundary_triangles(mesh.cells)).max() == 1
    bodies = read_bodies(tmp_path / "a.ply", notices=notices, least_cavity=20.0)
    assert volumes(bodies)[0] == pytest.approx(volume[0], rel=1e-5)
    assert notices[-1].endswith("1 cavities filled, 0.13 of its volume")


def test_several_bodies_in_a_file_of_a_folder(tmp_path):
    for name, part in {
        "a1.stl": shell(1.0),
        "a2.stl": joined(shell(1.0), shell(1.5, (5, 0, 0)), shell(0.5, (0, 5, 0), 0.3)),
        "a3.stl": joined(cone(1.0), cone(-1.0)),
    }.items():
        meshio.write_points_cells(tmp_path / name, part[0], [("triangle", part[1])])
    notices = []
    bodies = read_bodies(tmp_path, notices=notices)
    assert [label for label, _, _ in bodies] == [1, 2, 3, 4, 5, 6]
    assert notices == [
        "a2.stl: 3 bodies, grains 2 to 4",
        "a3.stl: cut at 1 nodes where parts only touched",
        "a3.stl: 2 bodies, grains 5 to 6",
    ]
    # A pyramid of base 4 and height 1.
    assert volumes(bodies)[-2:] == pytest.approx([4 / 3, 4 / 3], rel=1e-6)
    points, triangles = joined(shell(1.0), shell(1.0, (5, 0, 0)))
    np.savez(tmp_path / "b.npz", vertices=points, faces=triangles,
             grain_of_face=np.full(len(triangles), 7))  # fmt: skip
    with pytest.raises(InputError, match="grain 7 has 2 bodies, expected one body a grain"):
        read_bodies(tmp_path / "b.npz")
    np.savez(tmp_path / "c.npz", vertices=points, faces=triangles,
             grain_of_face=np.linspace(3.2, 3.9, len(triangles)))  # fmt: skip
    with pytest.raises(InputError, match="whole from 1"):
        read_bodies(tmp_path / "c.npz")


def test_surfaces_of_other_cells(tmp_path):
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    meshio.write_points_cells(tmp_path / "a.obj", corners, [("quad", np.array(quads))])
    notices = []
    assert volumes(read_bodies(tmp_path / "a.obj", notices=notices)) == pytest.approx([1.0])
    assert notices == ["a.obj: 6 quadrangles cut into triangles"]
    points, cells = sphere(1.0, 0.5)
    both = [("tetra", cells), ("triangle", measure.boundary_triangles(cells))]
    meshio.write_points_cells(tmp_path / "b.vtu", points, both)
    with pytest.raises(InputError, match=rf"holds {len(cells)} tetra, .*`mufe import` takes"):
        read_bodies(tmp_path / "b.vtu")
    twice = [("triangle", np.tile(measure.boundary_triangles(cells), (2, 1)))]
    meshio.write_points_cells(tmp_path / "d.stl", points, twice)
    with pytest.raises(InputError, match=r"d.stl: .* triangles are there twice"):
        read_bodies(tmp_path / "d.stl")
    faces = [("triangle", np.array([[0, 1, 9], [0, 1, 2], [0, 2, 3], [1, 2, 3]]))]
    meshio.write_points_cells(tmp_path / "c.vtu", corners, faces)
    with pytest.raises(InputError, match="has point 9, counted from 0, expected up to 7"):
        read_bodies(tmp_path / "c.vtu")


def test_lost_volume_is_a_warning_that_names_the_grain():
    """An octahedron loses its edges at coarse sizes, more than is given back."""
    corners = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1.0]])
    faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    bodies = [(1, *shell(2.0)), (2, corners, np.array(faces))]
    meshes = [
        mesh_one(job) for job in surface_jobs(bodies, MeshSettings(size=0.9, volume_tolerance=0.9))
    ]
    ratio = meshes[1].quality["volume_ratio"]
    assert ratio < 0.98
    assert warnings_of(meshes) == [
        f"grain 2: the mesh has {ratio:.3f} of the volume that was given, expected within 2%: take "
        "a smaller size, or part it at thin necks"
    ]
