"""Fabric of known sets of directions."""

import numpy as np
import pytest

from mufe_fenicsx.analysis.fabric import (
    anisotropy,
    deviatoric_fabric,
    fabric_tensor,
    rose,
)
from mufe_fenicsx.errors import InputError

ROUND_OFF = 1e-12


def quadrature(n=8):
    """Directions and weights that integrate polynomials of degree 2n - 1 over the sphere."""
    z, w = np.polynomial.legendre.leggauss(n)
    phi = 2 * np.pi * (np.arange(2 * n) + 0.3) / (2 * n)
    radius = np.sqrt(1 - z**2)
    normals = np.stack(
        [np.outer(radius, np.cos(phi)), np.outer(radius, np.sin(phi)), np.outer(z, np.ones(2 * n))],
        axis=-1,
    )
    return normals.reshape(-1, 3), np.repeat(w, 2 * n) * np.pi / n


def test_fabric_of_simple_sets():
    six = np.concatenate([np.eye(3), -np.eye(3)])
    assert fabric_tensor(six) == pytest.approx(np.eye(3) / 3, abs=ROUND_OFF)
    assert anisotropy(fabric_tensor(six)) == pytest.approx(0, abs=ROUND_OFF)
    # All along z: a = 15/2 (1 - 1/3) along z, -5/2 across it.
    column = fabric_tensor(np.array([[0, 0, 1], [0, 0, -1]]))
    assert deviatoric_fabric(column) == pytest.approx(np.diag([-2.5, -2.5, 5]), abs=ROUND_OFF)
    assert anisotropy(column) == pytest.approx(7.5, rel=ROUND_OFF)
    assert np.isnan(fabric_tensor(np.empty((0, 3)))).all()


def test_the_coefficients_of_a_known_spread_are_found():
    """Directions spread as (1 + nᵀ a n)/4π: the integral of degree 4 is exact."""
    a = np.array([[0.3, 0.1, -0.05], [0.1, -0.5, 0.2], [-0.05, 0.2, 0.2]])
    normals, weights = quadrature()
    spread = weights * (1 + np.einsum("ci,ij,cj->c", normals, a, normals)) / (4 * np.pi)
    found = deviatoric_fabric(fabric_tensor(normals, spread))
    assert found == pytest.approx(a, abs=ROUND_OFF)


def test_rose_is_a_density():
    angle = np.radians(np.arange(5, 180, 10))  # one in each bin of half a turn
    normals = np.column_stack([np.cos(angle), np.zeros(18), np.sin(angle)])
    even = rose(normals, "xz", 36)
    assert even.density == pytest.approx(1 / (2 * np.pi), rel=ROUND_OFF)
    one = rose(np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]]), "xz", 8)
    full = np.flatnonzero(one.density)
    assert full.tolist() == [1, 5]  # 53° and 233°
    assert one.density @ np.diff(one.edges) == pytest.approx(1, rel=ROUND_OFF)
    assert one.projected == 0.5  # the second one has no direction in the plane
    assert np.degrees(one.angle[1]) == pytest.approx(67.5)
    for plane, bins in (("xx", 36), ("xyz", 36), ("xz", 7)):
        with pytest.raises(InputError, match="of the rose"):
            rose(normals, plane, bins)
