"""Void ratio away from walls, and its uncertainty."""

import numpy as np
import pytest

from mufe_fenicsx.analysis.voids import OCTANTS, inner_void_ratio
from mufe_fenicsx.kernels.geometry.voids import box_of_centres, solid_of_octants

ROUND_OFF = 1e-12


def points_as_cells(points):
    """Cells with all four corners in a point each."""
    return np.repeat(np.arange(len(points), dtype=np.int32)[:, None], 4, axis=1)


def test_the_box_is_that_of_the_centres_of_cells():
    x = np.array([[0, 0, 0], [4, 0, 0], [0, 8, 0], [0, 0, 12], [4, 4, 4]], float)
    low, high = box_of_centres(x, np.array([[0, 1, 2, 3], [4, 4, 4, 4]], dtype=np.int32))
    assert low.tolist() == [1, 2, 3] and high.tolist() == [4, 4, 4]


def test_an_even_packing_has_the_void_ratio_of_each_of_its_parts():
    """Points on a grid, each with half of its share of the volume: e = 1, and no scatter."""
    grid = np.stack(np.meshgrid(*3 * [np.arange(-9.5, 10)], indexing="ij"), axis=-1).reshape(-1, 3)
    volume, half = np.full(len(grid), 0.5), np.array([4.0, 6.0, 8.0])
    solids = solid_of_octants(grid, points_as_cells(grid), volume, np.zeros(3), half, False, 0.0)
    assert solids.tolist() == OCTANTS * [0.5 * half.prod()]
    e, error = inner_void_ratio(solids, 8 * half.prod())
    assert e == pytest.approx(1.0, rel=ROUND_OFF) and error == 0.0


def test_the_hole_of_a_round_sample_is_no_part_of_it():
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (200_000, 3))
    volume = np.full(len(points), 0.6 * 8 / len(points))  # solid fraction 0.6
    half, hole = np.array([0.8, 0.8, 0.7]), 0.3
    solids = solid_of_octants(
        points, points_as_cells(points), volume, np.zeros(3), half, True, hole
    )
    e, error = inner_void_ratio(solids, np.pi * (0.8**2 - hole**2) * 1.4)
    # Counts scatter as Poisson's: relative 1/sqrt of about 60 000 points, of e times 1/0.4.
    assert e == pytest.approx(1 / 0.6 - 1, abs=4 * error) and 1e-3 < error < 2e-2


@pytest.mark.parametrize(("sides", "exact"), [((1.0, 0.0), 0.5 / np.sqrt(7)), ((0.5, 0.5), 0.0)])
def test_error_is_the_scatter_of_octants(sides, exact):
    """Half of the octants full and half of them empty: fraction 1/2, deviation 1/2 √(8/7)."""
    solids = np.repeat(sides, OCTANTS // 2)
    e, error = inner_void_ratio(solids, OCTANTS)
    assert e == pytest.approx(1.0) and error * 0.25 == pytest.approx(exact, abs=1e-12)
    assert inner_void_ratio(0 * solids, OCTANTS) == (0.0, 0.0)
