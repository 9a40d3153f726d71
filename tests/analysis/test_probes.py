"""Probes in a homogeneous field."""

import numpy as np
import pytest

from mufe_fenicsx.analysis.probes import at_places, find_cells, of_grains
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box

ROUND_OFF = 1e-12
F = np.array([[0.01, 0.02, 0.0], [-0.01, 0.0, 0.03], [0.0, 0.01, -0.02]])


def two_blocks():
    x, tets = box((1.0, 1.0, 1.0), (3, 3, 3))
    points = np.concatenate([x, 2 * x + np.array([3.0, 0, 0])])
    return points, np.concatenate([tets, tets + len(x)]), np.repeat([5, 11], len(tets))


def test_a_linear_displacement_is_exact_at_any_place():
    points, cells, grain = two_blocks()
    rng = np.random.default_rng(0)
    # Inside, on nodes, on faces between cells, on the surface.
    places = np.concatenate([rng.random((40, 3)), 3 + rng.random((5, 1)) * [[1, 0, 0]] - [0, 3, 3]])
    places = np.concatenate([places, points[::7], [[0.5, 0.5, 0.5], [1.0, 0.2, 0.3]]])
    places[40:45, 1:] = 0.5
    cell, weights = find_cells(points, cells, places)
    assert np.einsum("pa,pai->pi", weights, points[cells[cell]]) == pytest.approx(places, abs=1e-9)
    stress = np.arange(6.0 * len(cells)).reshape(-1, 6)
    found = at_places(cells, cell, weights, {"u": points @ F.T}, {"s": stress, "grain": grain})
    assert np.abs(found["u"] - places @ F.T).max() < ROUND_OFF
    assert np.array_equal(found["s"], stress[cell])
    assert np.array_equal(found["grain"], np.where(places[:, 0] < 2, 5, 11))
    for outside in ([[2.0, 0.5, 0.5]], [[0.5, 0.5, 0.5], [0.5, 0.5, 1.0001]]):
        with pytest.raises(InputError, match="in no grain"):
            find_cells(points, cells, outside)


def test_means_of_grains():
    points, cells, grain = two_blocks()
    stress = np.where(grain[:, None] == 5, 1.0, 2.0) * np.arange(1.0, 7)
    found = of_grains(points, cells, grain, [11, 5], {"u": points @ F.T}, {"s": stress})
    middle = np.array([[4.0, 1.0, 1.0], [0.5, 0.5, 0.5]])
    assert np.abs(found["u"] - middle @ F.T).max() < ROUND_OFF
    assert found["s"] == pytest.approx(np.outer([2, 1], np.arange(1.0, 7)), rel=ROUND_OFF)
    with pytest.raises(InputError, match="grain 6 is not in the run"):
        of_grains(points, cells, grain, [5, 6], {}, {})
