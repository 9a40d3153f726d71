"""Grain meshes come back from disk as they were written, all or some of them."""

import meshio
import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box, tetrahedron
from mufe_fenicsx.geometry.grains import Grains, load_grains, read_grain_table, save_grains


@pytest.fixture
def grains():
    meshes = [
        box((1, 1, 1), (2, 1, 1), origin=(5, 0, 0)),
        tetrahedron(1.0),
        box((1, 2, 3), (1, 2, 3)),
    ]
    return Grains.from_list([30, 10, 20], meshes, 0.5, [[0, 0, 0], [6, 2, 3]])


def test_grains_are_sorted_by_label(grains):
    assert grains.labels.tolist() == [10, 20, 30]
    # Sums of a few dozen products: round-off.
    assert grains.volumes == pytest.approx([1 / np.sqrt(72), 6, 1], rel=1e-12)
    assert grains.centroids[1:] == pytest.approx(np.array([[0.5, 1, 1.5], [5.5, 0.5, 0.5]]))
    assert np.bincount(grains.cell_label)[[10, 20, 30]].tolist() == [1, 36, 12]


def test_round_trip(tmp_path, grains):
    save_grains(tmp_path / "g", grains)
    again = load_grains(tmp_path / "g")
    for name in ("points", "cells", "labels", "node_offset", "cell_offset", "box"):
        assert np.array_equal(getattr(again, name), getattr(grains, name)), name
    assert again.element_size == 0.5
    labels, num_cells, num_nodes, centroids = read_grain_table(tmp_path / "g" / "grains.h5")
    assert labels.tolist() == [10, 20, 30]
    assert num_cells.tolist() == [1, 36, 12] and num_nodes.tolist() == [4, 24, 12]
    assert np.array_equal(centroids, grains.centroids)


@pytest.mark.parametrize("which", [[0], [2], [0, 2], [2, 1], []])
def test_some_grains_are_what_all_grains_hold(tmp_path, grains, which):
    save_grains(tmp_path, grains)
    some = load_grains(tmp_path, which)
    assert some.labels.tolist() == grains.labels[which].tolist()
    assert some.node_offset[-1] == len(some.points) and some.cell_offset[-1] == len(some.cells)
    for i, g in enumerate(which):
        for part, whole in zip(some.grain(i), grains.grain(g), strict=True):
            assert np.array_equal(part, whole)


def test_paraview_can_read_them(tmp_path, grains):
    save_grains(tmp_path, grains)
    mesh = meshio.read(tmp_path / "grains.xdmf")
    assert np.array_equal(mesh.points, grains.points)
    assert np.array_equal(mesh.cells_dict["tetra"], grains.cells)
    assert np.array_equal(mesh.cell_data["label"][0], grains.cell_label)


def test_what_is_no_grain_is_refused(tmp_path, grains):
    points, cells = tetrahedron(1.0)
    with pytest.raises(InputError, match="grain 4: cell 0 has no positive volume"):
        Grains.from_list([4], [(points, cells[:, [0, 2, 1, 3]])], 1.0)
    with pytest.raises(InputError, match="2 labels and 1 meshes"):
        Grains.from_list([4, 5], [(points, cells)], 1.0)
    with pytest.raises(InputError, match="expected positive labels that differ"):
        Grains.from_list([4, 4], [(points, cells), (points, cells)], 1.0)
    with pytest.raises(InputError, match=r"no file .*nowhere"):
        load_grains(tmp_path / "nowhere")
    (tmp_path / "grains.h5").write_bytes(b"no HDF5")
    with pytest.raises(InputError, match="cannot be read as HDF5"):
        load_grains(tmp_path)
    save_grains(tmp_path, grains)
    with pytest.raises(InputError, match="grain index 3, expected 0 to 2"):
        load_grains(tmp_path, [0, 3])
