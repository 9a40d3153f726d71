"""Tetrahedra that are no body are refused before anything is computed on them."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.kernels.geometry.topology import body_defect
from mufe_fenicsx.mesh import create_grain_mesh


def brick(*holes):
    """Nodes and cells of 3 x 3 x 3 cubes without those at some places."""
    points, cells = map(np.asarray, box((3.0, 3.0, 3.0), (3, 3, 3)))
    cube = np.floor(points[cells].mean(axis=1)).astype(int)
    gone = [(cube == hole).all(axis=1) for hole in holes]
    return points, cells[~np.any(gone, axis=0)] if gone else cells


def two_bricks(num_shared):
    """Cells of two cubes that have the last nodes of the first one in common."""
    _, cells = box((1.0, 1.0, 1.0), (1, 1, 1))
    other = np.arange(8) + 8
    other[:num_shared] = np.arange(7, 7 - num_shared, -1)
    return np.concatenate([cells, other[cells]])


def with_extra(cell):
    return np.concatenate([brick()[1], [cell]])


FIRST = brick()[1][0]
DEFECTS = {
    "cells twice": (np.tile(FIRST, (2, 1)), "1 cells that are there twice"),
    "turned twice": (np.array([FIRST, FIRST[[1, 0, 2, 3]]]), "1 cells that are there twice"),
    "third cell": (np.array([[0, 1, 2, k] for k in (3, 4, 5)]), "a facet of more than two cells"),
    "node twice": (with_extra([0, 1, 1, 2]), "one node twice"),
    "node below": (with_extra([-1, 1, 2, 3]), "a cell with node -1, expected nodes from 0 to 63"),
    "node above": (with_extra([0, 1, 2, 64]), "a cell with node 64, expected"),
    "ball joint": (two_bricks(1), "2 parts that have only nodes or edges in common"),
    "hinge": (two_bricks(2), "2 parts that have only nodes or edges in common"),
    # A slit ring: its ends meet in an edge, and all cells hang together by facets.
    "closed ring": (brick((0, 0, 0), (1, 1, 0), (1, 1, 1), (1, 1, 2))[1], "touch"),
    "tunnels": (brick((0, 1, 1), (1, 1, 2))[1], "a surface that touches itself along an edge"),
    "voids": (brick((0, 0, 0), (1, 1, 1))[1], "a surface that touches itself at 1 nodes"),
}


@pytest.mark.parametrize("cells, said", DEFECTS.values(), ids=DEFECTS)
def test_what_is_no_body(cells, said):
    assert said in body_defect(cells, 64)


def test_bodies_with_holes_and_cavities():
    for holes in [(), ((1, 1, 1),), ((0, 1, 1), (1, 1, 1), (2, 1, 1)), ((0, 0, 0),)]:
        assert body_defect(brick(*holes)[1], 64) == ""


@pytest.mark.parametrize("seed", range(40))
def test_random_sets_of_cubes(seed):
    """Cubes at random: a body if and only if no corner of a cube pinches them or the void.

    The slow twin asks each corner of the grid whether the cubes around it, and the voids around
    it, hang together by faces there, and all cubes as a whole.
    """
    import scipy.ndimage

    full = np.random.default_rng(seed).random((3, 3, 3)) < (0.95 if seed % 2 else 0.8)
    holes = np.argwhere(~full)
    sound = scipy.ndimage.label(full)[1] == 1
    padded = np.pad(full, 1)
    for corner in np.ndindex(4, 4, 4):
        part = padded[tuple(slice(i, i + 2) for i in corner)]
        sound &= all(scipy.ndimage.label(side)[1] <= 1 for side in (part, ~part))
    assert (body_defect(brick(*holes)[1], 64) == "") == sound


@pytest.mark.parametrize("kind", ["cells twice", "third cell", "node above", "ball joint", "voids"])
def test_the_mesh_of_a_run_refuses_it(kind):
    """Before DOLFINx sees the cells."""
    cells, said = DEFECTS[kind]
    grain, one = np.zeros(len(cells), dtype=int), np.array([0])
    with pytest.raises(InputError, match=f"grain 1 has .*{said}"):
        create_grain_mesh(MPI.COMM_SELF, brick()[0], cells, grain, one + 1, one)
