"""Grains that touch share their facets: no gap, no overlap, nothing left of the block they fill."""

import numpy as np
import pytest
import pyvista

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.image.coarse_labels import SOUND
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.geometry.surface.shared_edges import evened, opened
from mufe_fenicsx.geometry.surface.shared_surface import grain_complex, raw_complex
from mufe_fenicsx.geometry.tets.jobs import shared_jobs
from mufe_fenicsx.geometry.tets.joint_quality import parted
from mufe_fenicsx.geometry.tets.mesher import make_thicker_together, mesh_one
from tests.bodies import euler_characteristic
from tests.geometry.scenes import ball, positions

S = 1e-5  # voxel size [m]


def facets(mesh):
    """The outer facets of a mesh as sets of exact positions."""
    corners = mesh.points[measure.boundary_triangles(mesh.cells)]
    return {frozenset(map(tuple, facet)) for facet in corners.tolist()}


@pytest.fixture(scope="module")
def block():
    """A block of three grains that meet along a line, all of the image but a ball of void."""
    at = positions((20, 24, 24))
    labels = np.where(at[..., 2] + 0.3 * at[..., 1] > 14, 1, np.where(at[..., 1] > 13, 2, 3))
    labels[ball(labels.shape, (10, 12, 12), 5)] = 0
    settings = MeshSettings(size=3 * S, conforming=True)
    return labels, [mesh_one(job) for job in shared_jobs(labels.astype(np.int32), S, settings)]


def test_grains_that_fill_a_block_fill_it_without_gap_or_overlap(block):
    labels, meshes = block
    assert all(mesh.ok for mesh in meshes)
    outer = [facets(mesh) for mesh in meshes]
    every = set().union(*outer)
    # A facet shared by two is in both to the last digit; what is in one only bounds the solid.
    once = {f for f in every if sum(f in own for own in outer) == 1}
    twice = every - once
    assert len(twice) > 150 and sum(map(len, outer)) == len(once) + 2 * len(twice)
    # The bodies together have the volume within the facets that are there once: no overlap.
    corners = [np.array([mesh.points[t] for t in measure.boundary_triangles(mesh.cells)])
               for mesh in meshes]  # fmt: skip
    kept = np.concatenate(
        [c[[frozenset(map(tuple, f)) in once for f in c.tolist()]] for c in corners]
    )
    inside = np.einsum("ij,ij->", kept[:, 0], np.cross(kept[:, 1], kept[:, 2])) / 6
    total = sum(measure.tet_volumes(mesh.points, mesh.cells).sum() for mesh in meshes)
    assert total == pytest.approx(inside, rel=1e-12)
    # Everything but the void's ball: its volume is solved for, to the second order of a step.
    assert total == pytest.approx(np.count_nonzero(labels) * S**3, rel=2e-3)


def test_a_shared_face_is_where_the_labels_meet(block):
    _, meshes = block
    shared = set.intersection(facets(meshes[1]), facets(meshes[2]))
    y = np.array([p[1] / S for f in shared for p in f])
    # Grains 2 and 3 meet at y = 13 for voxels: the smooth indicators are equal there.
    assert np.abs(y - 13).max() < 0.3


def test_every_grain_of_a_packing_is_bounded_by_one_surface():
    """Coarse cells that touch at edges and corners only are told apart."""
    rng = np.random.default_rng(4)
    at, seeds = positions((30, 30, 30)), rng.random((25, 3)) * 30
    labels = 1 + np.argmin(np.linalg.norm(at[..., None, :] - seeds, axis=-1), axis=-1)
    labels[rng.random((15, 15, 15)).repeat(2, 0).repeat(2, 1).repeat(2, 2) < 0.1] = 0
    surface = grain_complex(labels.astype(np.int32), 2.5, 0.8)
    found = np.unique(surface.sides[surface.sides > 0])
    for label in found:
        nodes, triangles, _ = surface.grain(label)
        points = surface.x[nodes]
        assert measure.surface_defect(points, triangles) in ("", "inside out")
    assert len(found) >= 20


def bits(surface):
    return surface.held[surface.facets].all(axis=1) @ np.array([1, 2, 4])


def test_coarser_triangles_keep_what_they_bound():
    """Nodes go only along the faces and lines they lie on: what fills a box still fills it."""
    at, seeds = positions((24, 24, 24)), np.random.default_rng(1).random((6, 3)) * 24
    labels = 1 + np.argmin(np.linalg.norm(at[..., None, :] - seeds, axis=-1), axis=-1)
    fine, _ = raw_complex(labels.astype(np.int32), 1.5, 1.0)
    x, facets, sides, _ = evened(fine.x, fine.facets, fine.sides, bits(fine), 4.0)
    assert len(facets) < 0.7 * len(fine.facets)
    total = 0.0
    for label in range(1, 7):
        before = fine.grain(label)[1]
        mine = (sides == label).any(axis=1)
        after = np.where((sides[mine, 0] == label)[:, None], facets[mine], facets[mine, ::-1])
        assert measure.surface_defect(x, after) in ("", "inside out")
        assert euler_characteristic(after) == euler_characteristic(before)
        total += abs(measure.surface_volume(x, after))
    assert total == pytest.approx(24**3, rel=1e-12)


def test_grains_that_touch_along_an_edge_only_share_no_node():
    labels = np.zeros((12, 12, 12), dtype=np.int32)
    labels[2:10, 2:6, 2:6], labels[2:10, 6:10, 6:10] = 1, 2
    fine, _ = raw_complex(labels, 2.0, 0.3)
    shared = set.intersection(*(set(fine.grain(label)[0].tolist()) for label in (1, 2)))
    assert len(shared) >= 3
    _, facets, sides, _ = opened(fine.x, fine.facets, fine.sides, bits(fine), 0.0)
    own = [set(facets[(sides == label).any(axis=1)].ravel().tolist()) for label in (1, 2)]
    assert not set.intersection(*own) and len(own[0]) == len(fine.grain(1)[0])


def inside(point, corners):
    """Whether a closed surface winds around a point: solid angles of its triangles add up to 4 pi.

    Source: A. van Oosterom, J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125-126.
    """
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    rest = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return 2 * np.arctan2(volume, rest).sum() > 2 * np.pi


def test_touching_grains_are_meshed_well_and_apart():
    """Around a contact the void is a wedge that ends in nothing: there meshes are thin."""
    rng, at, size = np.random.default_rng(3), positions((26, 26, 26)), 3.2 * S
    centres, radii = rng.random((9, 3)) * 26, rng.uniform(5.5, 8, 9)
    depth = np.linalg.norm(at[..., None, :] - centres, axis=-1) - radii
    labels = np.where(depth.min(axis=-1) < 0, 1 + depth.argmin(axis=-1), 0)
    kept = [label for label in range(1, 10) if np.count_nonzero(labels == label) > 400]
    labels = np.searchsorted([0, *kept], np.where(np.isin(labels, kept), labels, 0))
    settings = MeshSettings(size=size, conforming=True)
    meshes = [mesh_one(job) for job in shared_jobs(labels.astype(np.int32), S, settings)]
    assert all(mesh.ok for mesh in meshes)
    make_thicker_together(meshes, size, np.array([[0, 0, 0], [26 * S] * 3]))
    altitudes = [measure.smallest_altitudes(mesh.points, mesh.cells) / size for mesh in meshes]
    # What is asked of them: the flattest set the stable time step.
    assert min(a.min() for a in altitudes) > 0.15
    assert np.mean(np.concatenate(altitudes) < 0.25) < 1e-3
    # Kept within 3e-3 of each grain, and to what the last moves out of neighbours change.
    assert max(abs(mesh.quality["volume_ratio"] - 1) for mesh in meshes) < 5e-3
    corners = [mesh.points[measure.boundary_triangles(mesh.cells)] for mesh in meshes]
    num_shared = 0
    for i, mesh in enumerate(meshes):
        own = np.unique(measure.boundary_triangles(mesh.cells))
        for j, others in enumerate(corners):
            if i == j:
                continue
            known = {tuple(p) for p in others.reshape(-1, 3).tolist()}
            free = [k for k in own if tuple(mesh.points[k].tolist()) not in known]
            num_shared += len(own) - len(free)
            away = [np.linalg.norm(others.mean(1) - mesh.points[k], axis=1).min() for k in free]
            near = [k for k, d in zip(free, away, strict=True) if d < 1.5 * size]
            assert not any(inside(mesh.points[k], others) for k in near)
    assert num_shared > 20


def test_nodes_inside_a_neighbour_move_out_by_half_each():
    """Two boxes that overlap by a tenth of an edge: their faces end half-way."""
    grid = pyvista.ImageData(dimensions=(5, 5, 5)).extract_surface(algorithm="dataset_surface")
    box = grid.triangulate().clean()
    x, triangles = np.array(box.points, dtype=float), np.array(box.regular_faces, dtype=np.int64)
    if measure.surface_volume(x, triangles) < 0:
        triangles = triangles[:, ::-1]
    other = x * [1, 0.9, 0.9] + [3.9, 0.2, 0.2]
    both = np.concatenate([x, other])
    facets = np.concatenate([triangles, triangles + len(x)])
    owner, n, first = np.repeat([0, 1], len(triangles)), len(x), both.copy()

    def num_inside():
        mine = sum(inside(p, both[n:][triangles]) for p in both[:n])
        return mine + sum(inside(p, both[:n][triangles]) for p in both[n:])

    assert num_inside() >= 25
    assert parted(both, facets, owner, 1.0, lambda new, step: np.ones(len(new))) == 0
    assert num_inside() == 0
    # In the middle of the faces both give way alike; nothing moves beyond the overlap or elsewhere.
    middle = np.linalg.norm(both[n:] - [3.95, 2, 2], axis=1) < 1
    assert both[n:][middle, 0] == pytest.approx(3.95, abs=0.01) and middle.sum() >= 5
    assert np.abs(both - first).max() < 0.11
    assert np.array_equal(both[first[:, 0] < 3.9], first[first[:, 0] < 3.9])


def test_patterns_of_cells_around_a_corner():
    # Two cells across an edge, two across the corner, and all but these touch themselves.
    edge, corner = 0b00001001, 0b10000001
    assert not SOUND[[edge, corner, 255 - edge, 255 - corner]].any()
    assert SOUND[[0, 1, 0b11, 0b1111, 0b10111, 254, 255]].all()


def test_conforming_takes_even_sizes_only():
    with pytest.raises(InputError, match="conforming = true, expected sizing = "):
        MeshSettings(size=1.0, conforming=True, sizing="contact")
