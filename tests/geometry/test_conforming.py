"""Grains that touch share their facets: no gap, no overlap, nothing left of the block they fill."""

import numpy as np
import pytest
from scenes import ball, positions

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.complexes import SOUND, grain_complex
from mufe_fenicsx.geometry.mesher import mesh_one, shared_jobs
from mufe_fenicsx.geometry.settings import MeshSettings

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


def test_patterns_of_cells_around_a_corner():
    # Two cells across an edge, two across the corner, and all but these touch themselves.
    edge, corner = 0b00001001, 0b10000001
    assert not SOUND[[edge, corner, 255 - edge, 255 - corner]].any()
    assert SOUND[[0, 1, 0b11, 0b1111, 0b10111, 254, 255]].all()


def test_conforming_takes_even_sizes_only():
    with pytest.raises(InputError, match="conforming = true, expected sizing = "):
        MeshSettings(size=1.0, conforming=True, sizing="curvature")
