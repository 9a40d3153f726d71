"""Boxes around points, facets and groups, against NumPy on whole arrays."""

import numpy as np

from mufe_fenicsx.kernels.geometry.boxes import (
    box_around,
    boxes_of_facets,
    boxes_of_groups,
    mean_extent,
    touch_box,
    with_marked_vertex,
)

RNG = np.random.default_rng(7)
X = RNG.normal(size=(60, 3))
FACETS = RNG.integers(0, 60, size=(200, 3)).astype(np.int32)


def test_boxes_of_facets_and_of_points_are_the_least_and_largest_places():
    low, high = boxes_of_facets(X, FACETS)
    assert np.array_equal(low, X[FACETS].min(axis=1))
    assert np.array_equal(high, X[FACETS].max(axis=1))
    assert np.array_equal(box_around(X), [X.min(axis=0), X.max(axis=0)])
    # The order of the sum differs.
    assert np.isclose(mean_extent(X, FACETS), (high - low).mean(), rtol=1e-13)


def test_a_box_around_nothing_touches_nothing():
    low, high = box_around(X[:0])
    assert (low == np.inf).all() and (high == -np.inf).all()
    assert not touch_box(*boxes_of_facets(X, FACETS), low, high).any()


def test_boxes_touch_where_they_overlap_along_all_axes_and_where_faces_meet():
    low, high = boxes_of_facets(X, FACETS)
    corner, opposite = np.array([-0.2, -0.3, 0.6]), np.array([0.1, 0.0, 0.7])
    found = touch_box(low, high, corner, opposite)
    assert np.array_equal(found, ((low <= opposite) & (high >= corner)).all(axis=1))
    assert found.any() and not found.all()
    assert touch_box(low, high, high[3], high[3] + 1.0)[3]
    assert not touch_box(low, high, np.nextafter(high[3], 9.0), high[3] + 1.0)[3]


def test_groups_have_the_boxes_of_their_own_points():
    node, group = RNG.integers(0, 60, size=(2, 40))
    group %= 3
    low, high = boxes_of_groups(X, node, group, 4)
    for g in range(3):
        near = X[node[group == g]]
        assert np.array_equal(low[g], near.min(axis=0))
        assert np.array_equal(high[g], near.max(axis=0))
    assert (low[3] == np.inf).all() and (high[3] == -np.inf).all()


def test_facets_with_a_marked_vertex():
    marked = RNG.random(60) < 0.2
    assert np.array_equal(with_marked_vertex(FACETS, marked), marked[FACETS].any(axis=1))
