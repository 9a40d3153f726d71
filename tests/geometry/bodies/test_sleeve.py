"""Thin bodies: a sleeve and a hollow ball."""

import math

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.sleeve import sleeve
from mufe_fenicsx.geometry.bodies.spherical_shell import spherical_shell
from mufe_fenicsx.kernels.geometry.topology import body_defect


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


def test_rings_of_a_sleeve_are_near_each_other_at_its_ends():
    z = np.unique(np.round(sleeve(2.0, 0.2, 3.0, 0.4, at_ends=0.05)[0][:, 2], 12))
    distance = np.diff(z)
    # The first stands from 0 to one distance on the way, which grows by a fifth of it.
    assert distance[[0, -1]] == pytest.approx([0.055, 0.055], rel=0.1)
    np.testing.assert_allclose(distance, distance[::-1], rtol=1e-9)
    # e^(1/5) from one to the next; a ring more or less changes all by a few per cent.
    growth = distance[1 : len(z) // 2] / distance[: len(z) // 2 - 1]
    assert 1.1 < growth.min() and growth.max() < 1.3 and distance.max() < 0.42


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
