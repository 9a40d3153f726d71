"""Thin bodies: a sleeve and a hollow ball."""

import math

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.sleeve import sleeve
from mufe_fenicsx.geometry.bodies.spherical_shell import spherical_shell
from mufe_fenicsx.kernels.topology import body_defect


def volumes(points, cells):
    x = points[cells]
    return np.linalg.det(x[:, 1:] - x[:, :1]) / 6


@pytest.mark.parametrize("layers", [1, 2])
def test_a_sleeve_is_one_body_of_the_right_volume(layers):
    R, t, H = 2.0, 0.2, 3.0
    points, cells = sleeve(R, t, H, 0.4, layers)
    assert not body_defect(cells, len(points))
    volume = volumes(points, cells)
    assert volume.min() > 0
    # Polygons that enclose the areas of their circles.
    assert volume.sum() == pytest.approx(math.pi * ((R + t) ** 2 - R**2) * H, rel=1e-12)
    assert np.isclose(points[:, 2], 0.0).sum() == np.isclose(points[:, 2], H).sum() > 0
    # Mirror images side by side: the mesh is as well that of the mirrored sleeve.
    mirrored = points * [1.0, -1.0, 1.0]
    order, same = (np.lexsort(np.round(p, 9).T + 0.0) for p in (points, mirrored))
    number = np.empty(len(points), dtype=int)
    number[order] = same
    sides = [np.sort(which, axis=1) for which in (number[cells], cells)]
    assert {tuple(row) for row in sides[0]} == {tuple(row) for row in sides[1]}


def test_edges_that_are_too_long_are_named():
    with pytest.raises(InputError, match=r"element size of sleeve = 1 m, expected at most 0\.3"):
        sleeve(1.0, 0.1, 1.0, 1.0)


def test_a_hollow_ball_is_one_body():
    points, cells = spherical_shell(1.0, 0.1, 6, 2)
    assert not body_defect(cells, len(points))
    volume = volumes(points, cells)
    assert volume.min() > 0
    # Facets lie inside their sphere: a part of (h/R)²/4 or so of the volume.
    full = 4 / 3 * math.pi * (1.1**3 - 1)
    assert 0.95 * full < volume.sum() < full
