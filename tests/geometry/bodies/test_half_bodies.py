"""Bodies cut by a plane through their middle, fine where they are touched."""

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.half_cylinder import half_cylinder
from mufe_fenicsx.geometry.bodies.half_ellipsoid import half_ellipsoid
from mufe_fenicsx.geometry.bodies.hollow import DEPTH, HALF_WIDTH, HEIGHT, hollow

H, GROWTH, FINE = 0.02, 0.3, 0.04


def volumes(points, cells):
    return np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) / 6


def edges_near(points, cells, pole):
    """Mean length of the edges of tetrahedra within the fine region."""
    near = cells[np.linalg.norm(points[cells].mean(axis=1) - pole, axis=1) < FINE]
    a, b = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]).T
    return np.linalg.norm(points[near[:, a]] - points[near[:, b]], axis=2).mean()


@pytest.mark.parametrize(
    "make, volume, distance",
    [
        (
            lambda: half_cylinder(1.0, 1.5, H, GROWTH, FINE),
            0.75 * np.pi,
            lambda x: np.hypot(x[:, 1], x[:, 2]) - 1,
        ),
        (
            lambda: half_ellipsoid((1.3, 0.8, 1.0), H, GROWTH, FINE),
            2 / 3 * np.pi * 1.3 * 0.8,
            lambda x: np.linalg.norm(x / [1.3, 0.8, 1.0], axis=1) - 1,
        ),
    ],
)
def test_half_body(make, volume, distance):
    points, cells = make()
    V = volumes(points, cells)
    assert V.min() > 0
    # The curved facets enclose the volume, but for the next order of h, up to R/3, and the rim.
    assert V.sum() == pytest.approx(volume, rel=0.01)
    upper = points[points[:, 2] > 0.5]
    pole = upper[np.argmin(np.hypot(upper[:, 0], upper[:, 1]))]
    assert np.hypot(pole[0], pole[1]) < 1e-12
    # As far outside as facets between nodes on the surface are inside, h²/16 (κ₁ + κ₂).
    assert 1.0 < pole[2] < 1.0 + H**2 / 4
    assert points[:, 2].min() == 0.0 and (points[:, 2] == 0.0).sum() > 10
    # h <= R/3, and the ellipsoid's least radius of curvature is 0.6.
    assert distance(points).max() < 0.04
    # Edges inside are longer than those of the surface by up to a third or so.
    assert H < edges_near(points, cells, pole) < 1.35 * H


def test_half_cylinder_that_is_fine_along_its_line():
    points, cells = half_cylinder(1.0, 0.3, H, GROWTH, FINE, line=True)
    assert volumes(points, cells).sum() == pytest.approx(0.15 * np.pi, rel=0.01)
    # At the ends as at the pole.
    for x in (-0.15, 0.0, 0.15):
        assert H < edges_near(points, cells, [x, 0.0, 1.0]) < 1.35 * H


def test_a_hollow_has_its_volume_and_its_lowest_point():
    points, cells = hollow(1.0, H, GROWTH, FINE)
    V = volumes(points, cells)
    cap = np.pi * DEPTH**2 * (1 - DEPTH / 3)
    assert V.min() > 0
    # The facets of the hollow enclose its volume, but for the next order of h, R/2 at the rim.
    assert V.sum() == pytest.approx(4 * HALF_WIDTH**2 * (HEIGHT + DEPTH) - cap, abs=0.02 * cap)
    assert points[:, 2].min() == 0.0
    near = np.abs(np.linalg.norm(points - [0, 0, HEIGHT + 1], axis=1) - 1) < H**2 / 2
    lowest = points[near & (np.hypot(points[:, 0], points[:, 1]) < FINE)]
    # Nodes lie behind the sphere, so that facets cut through it.
    outside = np.linalg.norm(lowest - [0, 0, HEIGHT + 1], axis=1) - 1
    assert len(lowest) > 10 and outside.min() > 0 and outside.max() < H**2 / 4
    assert H < edges_near(points, cells, [0, 0, HEIGHT]) < 1.35 * H


def test_bad_sizes_are_refused():
    with pytest.raises(InputError, match="radius of hollow = -1"):
        hollow(-1.0, H, GROWTH, FINE)
    with pytest.raises(InputError, match="length of half cylinder = 0"):
        half_cylinder(1.0, 0.0, H)
    with pytest.raises(InputError, match="semi-axis of half ellipsoid = -1"):
        half_ellipsoid((1.0, -1.0, 1.0), H)
