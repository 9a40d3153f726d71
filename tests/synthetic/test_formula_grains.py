"""Grains from formulas: normals and curvatures, and meshes that converge to the formula."""

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.measure import boundary_triangles, surface_volume
from mufe_fenicsx.synthetic.formula_grains import (
    Harmonics,
    Superquadric,
    curvatures,
    distances,
    level,
    mesh_formula,
    normals,
    surface_points,
    volume,
)

AXES = (1.2, 1.0, 0.8)
ELLIPSOID = Superquadric(AXES, 2.0)


def harmonic():
    """A ball with bumps of degrees 2 to 4."""
    c = np.zeros(25)
    c[0] = np.sqrt(4 * np.pi)
    c[4:] = 0.06 * np.random.default_rng(1).standard_normal(21)
    return Harmonics(c)


def test_normals_and_curvatures_of_an_ellipsoid():
    """κ₁ + κ₂ at the end of an axis c is c/a² + c/b²; normals are along x/a²."""
    a, b, c = AXES
    ends = np.diag(AXES)
    exact = [a / b**2 + a / c**2, b / a**2 + b / c**2, c / a**2 + c / b**2]
    # Central differences with steps of 1e-3 of the distance.
    assert curvatures(ELLIPSOID, ends) == pytest.approx(exact, rel=1e-5)
    v = np.random.default_rng(2).standard_normal((20, 3))
    x = surface_points(ELLIPSOID, v / np.linalg.norm(v, axis=1, keepdims=True))
    slope = x / np.square(AXES)
    slope /= np.linalg.norm(slope, axis=1, keepdims=True)
    assert normals(ELLIPSOID, x) == pytest.approx(slope, abs=1e-8)
    # A distance of 1e-4 is met up to its square times the curvature.
    assert distances(ELLIPSOID, x + 1e-4 * slope) == pytest.approx(1e-4, abs=3e-8)


def test_volumes_of_formulas():
    assert volume(ELLIPSOID) == pytest.approx(4 / 3 * np.pi * np.prod(AXES), rel=1e-5)
    # r = 1 + s Y has the volume 4π/3 + s² ∫Y² + s³/3 ∫Y³; of the polar Y of degree 1 ∫Y³ = 0.
    c = np.array([np.sqrt(4 * np.pi), 0.1, 0.0, 0.0])
    assert volume(Harmonics(c)) == pytest.approx(4 / 3 * np.pi + 0.1**2, rel=1e-6)


@pytest.mark.parametrize(
    "shape", [Superquadric(AXES, 3.5), harmonic()], ids=["superquadric", "harmonic"]
)
def test_meshes_converge_to_the_formula_at_second_order(shape):
    """Nodes lie on the surface, middles of facets within h²; so do volumes, bulged ones nearer."""
    lost, left, sag = [], [], []
    for h in (0.5, 0.25):
        points, cells = mesh_formula(shape, h, bulge=False)
        facets = boundary_triangles(cells)
        # Rounding alone.
        assert level(shape, points[np.unique(facets)]) == pytest.approx(1.0, abs=1e-12)
        sag.append(np.sqrt((distances(shape, points[facets].mean(axis=1)) ** 2).mean()))
        lost.append(1 - surface_volume(points, facets) / volume(shape))
        bulged, same = mesh_formula(shape, h)
        assert np.array_equal(same, cells)
        left.append(1 - surface_volume(bulged, facets) / volume(shape))
    # Halving h gives a quarter; clusters of the coarse mesh are irregular by some tens of per cent.
    assert 3.2 < lost[0] / lost[1] < 5
    assert 3 < sag[0] / sag[1] < 5.5
    # The bulge is first order in what is lost.
    assert np.all(np.abs(left) < 0.25 * np.array(lost))


def test_another_start_is_another_mesh_of_the_same_body():
    turn = np.array([[0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.8, 0.0, 0.6]])
    (one, cells), (other, more) = mesh_formula(ELLIPSOID, 0.4), mesh_formula(
        ELLIPSOID, 0.4, turn=turn
    )  # fmt: skip
    assert one.shape != other.shape or not np.allclose(one, other)
    volumes = [surface_volume(x, boundary_triangles(c)) for x, c in ((one, cells), (other, more))]
    assert volumes[1] == pytest.approx(volumes[0], rel=5e-3)  # a tenth of what facets cut off


def test_what_cannot_be_a_grain_is_refused():
    with pytest.raises(InputError, match=r"exponent = 1\.5, expected >= 2"):
        Superquadric(AXES, 1.5)
    with pytest.raises(InputError, match="three lengths > 0"):
        Superquadric((1.0, -1.0, 1.0), 2.0)
    with pytest.raises(InputError, match="coefficients: 3, expected a square number"):
        Harmonics(np.ones(3))
    with pytest.raises(InputError, match="element size = 0"):
        mesh_formula(ELLIPSOID, 0)
