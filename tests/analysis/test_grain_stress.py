"""Stress and yield in grains: made-up fields with known answers."""

import numpy as np
import pytest

from mufe_fenicsx.analysis.grain_stress import first_yield, grain_stress, unstressed
from mufe_fenicsx.analysis.yield_place import closest_on_triangles, yield_place
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.measure import boundary_triangles

ROUND_OFF = 1e-12


def test_means_peaks_and_percentiles_by_volume():
    """Grain 3: von Mises 1 to 10 in cells of volume 1; grain 8: one large, one small cell."""
    grain = np.array([8, *[3] * 10, 8])
    mises = np.array([5.0, *np.random.default_rng(0).permutation(np.arange(1.0, 11.0)), 90.0])
    volume = np.array([9.7, *[1.0] * 10, 0.3])
    stress = np.outer(mises, [1, 2, 3, 4, 5, 6])
    plastic = np.where(mises > 8, 1e-3, 0.0)
    found = grain_stress(stress, mises, plastic, volume, grain)
    assert found.labels.tolist() == [3, 8] and found.volume.tolist() == [10, 10]
    mean = np.array([5.5, 0.97 * 5 + 0.03 * 90])
    assert found.mean == pytest.approx(mean, rel=ROUND_OFF)
    assert found.stress == pytest.approx(np.outer(mean, [1, 2, 3, 4, 5, 6]), rel=ROUND_OFF)
    assert found.peak.tolist() == [10, 90]
    assert found.percentile.tolist() == [10, 5]  # 95 %: the bad element does not show
    assert grain_stress(stress, mises, plastic, volume, grain, 50).percentile.tolist() == [5, 5]
    assert grain_stress(stress, mises, plastic, volume, grain, 100).percentile.tolist() == [10, 90]
    assert found.plastic_fraction == pytest.approx([0.2, 0.03], rel=ROUND_OFF)


def test_unstressed_grains_are_below_a_part_of_the_mean():
    mean, volume = np.array([10.0, 0.04, 0.06]), np.array([1.0, 1.0, 2.0])
    # The sample's mean is 2.54: a hundredth of it is 0.0254, a fiftieth 0.0508.
    assert unstressed(mean, volume).tolist() == [False, False, False]
    assert unstressed(mean, volume, 0.02).tolist() == [False, True, False]


def test_first_yield_is_that_of_the_first_state_that_shows_it():
    grain = np.array([1, 1, 2, 2, 5, 6])
    plastic = np.array([[0, 0, 0, 0, 0, 0], [0, 0, 0, 1, 1, 0], [2, 0, 0, 2, 3, 0]]) * 1e-4
    order = np.array([5, 3, 1, 0, 2, 4])  # cells of the last state come in another order
    states = [(plastic[0], grain), (plastic[1], grain), (plastic[2][order], grain[order])]
    found = first_yield(states)
    assert found.labels.tolist() == [1, 2, 5, 6]
    assert found.state.tolist() == [2, 1, 1, -1]
    assert found.rank.tolist() == [2, 1, 1, 0]


def test_closest_points_of_a_triangle_in_all_regions():
    a, b, c = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0]], float)
    places = {
        (0.5, 0.5, 3): (0.5, 0.5, 0),  # above the inside
        (-1, -1, 1): (0, 0, 0),
        (5, -1, 1): (2, 0, 0),
        (-1, 5, 1): (0, 2, 0),
        (1, -2, 1): (1, 0, 0),
        (-3, 1, 1): (0, 1, 0),
        (2, 2, 1): (1, 1, 0),
    }
    for place, closest in places.items():
        for corners in ((a, b, c), (b, c, a), (c, b, a)):  # and inside out
            found = closest_on_triangles(np.array(place, float), np.array([corners]))
            assert found[0] == pytest.approx(closest, abs=ROUND_OFF)


def pressed_block(n=8):
    """A cube of unit edge whose top is pressed within |x|, |y| <= 1/4, and its cells' middles."""
    points, cells = box((1.0, 1.0, 1.0), (n, n, n), (-0.5, -0.5, -1.0))
    top = points[:, 2] == 0
    pressure = np.where(top & (np.abs(points[:, :2]).max(axis=1) <= 0.25 + 1e-12), 1.0, 0.0)
    return points, cells, pressure, points[cells].mean(axis=1)


@pytest.mark.parametrize(
    ("place", "under", "edge"),
    [((0, 0, -0.2), True, 0.25), ((0.2, 0, -0.05), True, 0.05), ((0.38, 0, -0.04), False, 0.13)],
)
def test_place_of_yield_in_a_pressed_block(place, under, edge):
    points, cells, pressure, middle = pressed_block()
    plastic = 1e-3 * np.exp(-np.linalg.norm(middle - place, axis=1) / 0.1)
    found = yield_place(points, cells, plastic, pressure)
    assert found.cell == int(np.argmax(plastic))
    x, y, z = found.position
    assert np.linalg.norm(found.position - place) < 1 / 8  # the nearest middle of a cell
    # Of that middle all is known exactly.
    assert found.depth == pytest.approx(-z, rel=ROUND_OFF)
    assert found.under_contact == under
    assert found.edge_distance == pytest.approx(abs(0.25 - max(abs(x), abs(y))), rel=1e-9)
    assert abs(found.edge_distance - edge) < 1 / 8
    assert np.pi * found.contact_radius**2 == pytest.approx(0.25, rel=1e-9)


def test_yield_away_from_contacts_and_none():
    points, cells, pressure, middle = pressed_block(4)
    plastic = (middle[:, 2] < -0.9) * 1e-3
    found = yield_place(points, cells, plastic, 0 * pressure)
    assert not found.under_contact and np.isnan(found.edge_distance)
    # The first cell with a face on the base: its middle is a quarter of its height above.
    assert (
        found.depth == pytest.approx(1 / 16, rel=ROUND_OFF)
        and len(boundary_triangles(cells)) == 6 * 2 * 16
    )
    assert yield_place(points, cells, 0 * plastic, pressure) is None
