"""Tetrahedra split into eight."""

import numpy as np

from mufe_fenicsx.geometry.measure import smallest_altitudes, tet_volumes
from mufe_fenicsx.geometry.tets.refine import split
from tests.bodies import sphere


def test_parts_are_eighths_that_fit_each_other():
    points, cells = sphere(1.0, 0.6)
    new_points, parts = split(points, cells)
    # Bey 1995: all eight parts have the same volume; rounding.
    eighths = tet_volumes(new_points, parts).reshape(-1, 8)
    np.testing.assert_allclose(eighths, tet_volumes(points, cells)[:, None] / 8 * np.ones(8))
    # Inner faces belong to two cells, faces of the surface become four.
    count = [_faces(c) for c in (cells, parts)]
    assert set(count[1]) == {1, 2} and (count[1] == 1).sum() == 4 * (count[0] == 1).sum()
    # No vertex twice, none unused: V - E + F - C = 1 for a ball.
    edges = np.unique(np.sort(cells[:, [0, 0, 0, 1, 1, 2, 1, 2, 3, 2, 3, 3]].reshape(-1, 2, 6)
                              .transpose(0, 2, 1).reshape(-1, 2), axis=1), axis=0)  # fmt: skip
    assert len(new_points) == len(points) + len(edges)
    np.testing.assert_array_equal(np.unique(parts), np.arange(len(new_points)))
    # The shortest diagonal keeps the parts from becoming flat.
    half = 0.5 * smallest_altitudes(points, cells)
    assert (smallest_altitudes(new_points, parts).reshape(-1, 8).min(axis=1) > 0.5 * half).all()


def _faces(cells):
    """How many cells share each face."""
    faces = np.sort(cells[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    return np.unique(faces, axis=0, return_counts=True)[1]
