"""The distributed mesh of whole grains."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.mesh import partition_grains
from tests.bodies import RADIUS, packed_spheres

COMM = MPI.COMM_WORLD


@pytest.fixture(scope="module")
def mesh():
    return packed_spheres(COMM, (3, 2, 1), gap=0.1, h=0.6 * RADIUS)


@pytest.mark.mpi
def test_every_grain_is_whole_on_one_rank(mesh):
    np.testing.assert_array_equal(mesh.rank_of_grain[mesh.grains], COMM.rank)
    everywhere = np.concatenate(COMM.allgather(mesh.grains))
    np.testing.assert_array_equal(np.sort(everywhere), np.arange(6))
    # All balls have the same mesh, so as many cells and nodes.
    cells, nodes = np.diff(mesh.cell_offset), np.diff(mesh.node_offset)
    assert len(set(np.concatenate(COMM.allgather(cells)))) == 1
    assert len(set(np.concatenate(COMM.allgather(nodes)))) == 1
    for g in range(mesh.num_grains):
        rows = mesh.cells[mesh.cell_offset[g] : mesh.cell_offset[g + 1]]
        own = mesh.nodes[mesh.node_offset[g] : mesh.node_offset[g + 1]]
        np.testing.assert_array_equal(np.unique(rows), np.sort(own))


@pytest.mark.mpi
def test_notebooks_show_counts_of_this_rank(mesh):
    html = mesh._repr_html_()
    for number in (mesh.num_grains, mesh.num_cells, mesh.num_nodes, len(mesh.facets)):
        assert f">{number}" in html
    assert ("of 6, on this rank" in html) == (COMM.size > 1)


@pytest.mark.mpi
def test_no_ghosts(mesh):
    assert mesh.mesh.topology.index_map(3).num_ghosts == 0
    assert mesh.V.dofmap.index_map.num_ghosts == 0
    assert mesh.num_cells == mesh.mesh.topology.index_map(3).size_local


@pytest.mark.mpi
def test_tags_are_labels_and_cells_keep_their_grain(mesh):
    labels = mesh.labels[mesh.grains[mesh.grain_of_cell]]
    tag_of_cell = np.empty(mesh.num_cells, dtype=int)
    tag_of_cell[mesh.cell_tags.indices] = mesh.cell_tags.values
    np.testing.assert_array_equal(tag_of_cell[mesh.cell_order], labels)
    # A ball's cells lie around its centre.
    centre = mesh.x[mesh.cells].mean(axis=1)
    for g in range(mesh.num_grains):
        ball = centre[mesh.grain_of_cell == g]
        assert np.linalg.norm(ball - ball.mean(axis=0), axis=1).max() < RADIUS


@pytest.mark.mpi
def test_cells_and_facets_are_oriented(mesh):
    edges = mesh.x[mesh.cells[:, 1:]] - mesh.x[mesh.cells[:, :1]]
    volume = np.linalg.det(edges) / 6
    assert volume.min() > 0
    # Divergence theorem for each grain: 1/3 ∮ x·n dA is its volume, if facets look outward.
    a, b, c = (mesh.x[mesh.facets[:, i]] for i in range(3))
    flux = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    enclosed = np.bincount(mesh.grain_of_facet, flux, mesh.num_grains)
    filled = np.bincount(mesh.grain_of_cell, volume, mesh.num_grains)
    np.testing.assert_allclose(enclosed, filled, rtol=1e-11)


@pytest.mark.parametrize("num_ranks", [1, 2, 3, 7])
def test_partition_is_balanced(num_ranks):
    rng = np.random.default_rng(0)
    weights, centroids = rng.uniform(1, 3, 200), rng.random((200, 3))
    load = np.bincount(partition_grains(weights, centroids, num_ranks), weights, num_ranks)
    # Each of the log2(num_ranks) cuts misses by half of a grain at most.
    assert np.ptp(load) <= 3 * np.ceil(np.log2(num_ranks))


def test_every_rank_gets_a_grain_even_of_very_uneven_ones():
    weights = np.array([1000.0, 1, 1, 1])
    ranks = partition_grains(weights, np.arange(12.0).reshape(4, 3), 4)
    np.testing.assert_array_equal(np.sort(ranks), np.arange(4))


def test_more_ranks_than_grains():
    with pytest.raises(ValueError, match=r"number of ranks = 3, expected at most .* 2"):
        partition_grains(np.ones(2), np.zeros((2, 3)), 3)
    assert issubclass(InputError, ValueError)
