"""Strain between neighbouring grains: exact for affine motion, and a band is found where it is."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mufe_fenicsx.analysis.localisation import (
    delaunay_cells,
    grain_strain,
    rotation_vectors,
    voronoi_volumes,
)
from mufe_fenicsx.analysis.shear_band import ENOUGH, find_band, spread
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.measure import tet_volumes

D = 2e-4
R = Rotation.from_rotvec([0.2, -0.4, 0.1]).as_matrix()


def packing(counts=(6, 6, 10), jitter=0.25, seed=1):
    """Centres on a lattice of spacing D, each moved at random, and radii."""
    rng = np.random.default_rng(seed)
    places = D * (np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1) + 0.5)
    x = places.reshape(-1, 3) + jitter * D * rng.uniform(-1, 1, (np.prod(counts), 3))
    return x, np.full(len(x), 0.5 * D)


def test_affine_motion_gives_its_strain_at_every_grain():
    """x = R U X: -ln U, its rotation and ratio of volumes, to rounding; flat cells take part."""
    x, radius = packing()
    cells = delaunay_cells(x, radius)
    axes = Rotation.from_rotvec([0.5, 0.1, -0.3]).as_matrix()
    stretch = np.array([1.04, 1.02, 0.9])
    F = R @ axes @ np.diag(stretch) @ axes.T
    found = grain_strain(cells, x, x @ F.T + [1e-3, 0, 2e-3])
    exact = -axes @ np.diag(np.log(stretch)) @ axes.T
    assert found.num_cells.min() > 0
    assert np.abs(found.gradient - F).max() < 1e-12
    assert np.abs(found.strain - exact).max() < 1e-12
    assert np.abs(rotation_vectors(found.rotation) - [0.2, -0.4, 0.1]).max() < 1e-12
    assert found.strain_volume == pytest.approx(-np.log(stretch.prod()), abs=1e-12)
    e = -np.log(stretch) + np.log(stretch).mean()
    assert found.strain_deviator == pytest.approx(np.sqrt(2 / 3 * (e @ e)), rel=1e-12)


def test_measures_of_simple_states():
    """Triaxial compression: 2/3 of the difference; simple shear by γ: 2/√3 asinh(γ/2)."""
    x, radius = packing((4, 4, 4))
    cells = delaunay_cells(x, radius)
    found = grain_strain(cells, x, x * np.exp([0.01, 0.01, -0.05]))
    assert found.strain_deviator == pytest.approx(2 / 3 * 0.06, rel=1e-11)
    assert found.strain_volume == pytest.approx(0.03, rel=1e-11)
    assert found.strain[:, 2, 2] == pytest.approx(0.05, rel=1e-11)
    found = grain_strain(cells, x, x + np.outer(x[:, 2], [0.8, 0, 0]))
    assert found.strain_deviator == pytest.approx(2 / np.sqrt(3) * np.arcsinh(0.4), rel=1e-11)


def test_rigid_motion_strains_nothing():
    x, radius = packing((4, 4, 5))
    found = grain_strain(delaunay_cells(x, radius), x, x @ R.T - [0, 5e-3, 0])
    assert np.abs(found.strain).max() < 1e-12 and np.abs(found.strain_volume).max() < 1e-12
    # Grains that turn with their neighbours have no excess; one that stays turns back by it.
    excess = rotation_vectors(np.array([R, np.eye(3)]) @ np.swapaxes(found.rotation[:2], 1, 2))
    assert np.abs(excess - [[0, 0, 0], [-0.2, 0.4, -0.1]]).max() < 1e-12


def test_a_grain_among_others_does_not_move_its_own_mean():
    """Bagi: the mean over the cells round a grain follows from its neighbours alone."""
    x, radius = packing()
    cells = delaunay_cells(x, radius)
    grain = int(np.flatnonzero(cells.inside)[20])
    now = x.copy()
    now[grain] += [0.1 * D, -0.05 * D, 0.02 * D]
    found = grain_strain(cells, x, now)
    assert np.abs(found.strain[grain]).max() < 1e-12
    assert found.strain_deviator.max() > 1e-3


def test_the_hull_is_peeled_of_flat_and_long_cells():
    """A lump beside a far grain: no cell joins them; cells stay positive, and have no thin ones."""
    x, radius = packing((4, 4, 4), 0.1)
    far = np.append(x, [[4 * D * 3, 2 * D, 2 * D]], axis=0)
    alone = delaunay_cells(far, np.append(radius, radius[0]))
    assert not (alone.corners == len(x)).any() and not alone.inside[-1]
    assert (tet_volumes(far, alone.corners) > 0).all()
    assert np.isnan(grain_strain(alone, far, far).strain_deviator[-1])
    cells = delaunay_cells(x, radius)
    assert np.array_equal(cells.inside, alone.inside[:-1])
    middle = np.abs(x / D - 2).max(axis=1) < 1
    assert cells.inside[middle].all() and not cells.inside[~middle].all()
    # The lattice's cube is filled but for what is flat at its faces.
    assert 0.9 * (3 * D) ** 3 < cells.volume.sum() < 1.1 * (3 * D) ** 3


def test_void_ratio_of_lattices():
    """Balls in contact: simple cubic e = 6/π - 1, body-centred e = 8/(√3 π) - 1; then squeezed."""
    n, solid = np.arange(6), np.pi / 6 * D**3
    simple = D * np.stack(np.meshgrid(n, n, n, indexing="ij"), -1).reshape(-1, 3)
    side = 2 / np.sqrt(3)
    centred = side * np.concatenate([simple, simple + 0.5 * D])
    for x, ratio in ((simple, 6 / np.pi - 1), (centred, 8 / (np.sqrt(3) * np.pi) - 1)):
        inside = delaunay_cells(x, np.full(len(x), 0.5 * D)).inside
        assert inside.sum() > 60
        for squeezed in (1.0, 0.9):
            volume = voronoi_volumes(x * [1, 1, squeezed], inside)
            middle = np.abs(x - x.mean(axis=0)).max(axis=1) < 1.5 * D  # with all their neighbours
            e = volume[inside & middle] / solid - 1
            assert e == pytest.approx(squeezed * (1 + ratio) - 1, rel=1e-9)
            assert np.isnan(volume[~inside]).all()


def band_motion(x, normal, place, width, shear):
    """Simple shear within a slab, none beside it."""
    along = np.array([normal[2], 0, -normal[0]])
    s = np.clip((x - place) @ normal, -0.5 * width, 0.5 * width)
    return x + shear * np.outer(s, along)


@pytest.mark.parametrize("degrees", [0.0, 55.0])
def test_a_band_is_found_with_its_place_and_width(degrees):
    x, radius = packing((8, 8, 16), seed=3)
    angle = np.radians(degrees)
    normal, place = np.array([np.sin(angle), 0, np.cos(angle)]), D * np.array([4, 4, 8.0])
    width = 3 * D
    cells = delaunay_cells(x, radius)
    rng = np.random.default_rng(5)
    now = band_motion(x, normal, place, width, 0.4) + 0.005 * D * rng.normal(size=x.shape)
    found = grain_strain(cells, x, now)
    band = find_band(x, found.strain_deviator, found.volume[0], D)
    assert band.share > ENOUGH
    assert np.degrees(np.arccos(abs(band.normal @ normal))) < 5
    # The place is a mean over hundreds of grains. A grain's cells reach to its neighbours, so that
    # edges blur, and of three grains across the outer ones share their strain with those beside.
    assert abs((band.middle - place) @ normal) < 0.1 * D
    assert band.width == pytest.approx(width, abs=D)
    assert band.inclination == pytest.approx(degrees, abs=5)
    peak = 2 / np.sqrt(3) * np.arcsinh(0.2)
    assert 0.7 * peak < band.strain[0] < 0.9 * peak and band.strain[1] < 0.1 * peak
    assert spread(found.strain_deviator, found.volume[0]) > 1


@pytest.mark.parametrize(("counts", "most"), [((4, 4, 4), 0.45), ((6, 6, 10), 0.15)])
@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_no_band_in_even_strain_with_random_motion(counts, most, noise):
    """Even compression with motion at random: a slab explains little. Without it: no slab does."""
    rng = np.random.default_rng(6)
    for seed in range(3):
        x, radius = packing(counts, seed=seed)
        cells = delaunay_cells(x, radius)
        now = x * [1.01, 1.01, 0.95]
        found = grain_strain(cells, x, now + noise * D * rng.normal(size=x.shape))
        band = find_band(x, found.strain_deviator, found.volume[0], D)
        assert band.share < most < ENOUGH
        # Motion at random of a tenth of a diameter is twice the strain: measured 0.52 and 0.24.
        assert spread(found.strain_deviator, found.volume[0]) < (0.3 if noise < 0.1 else 0.6)
    even = grain_strain(cells, x, now)
    assert find_band(x, even.strain_deviator, even.volume[0], D) is None


@pytest.mark.parametrize(
    "x", [np.zeros((3, 3)), np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])]
)
def test_too_few_grains_are_refused(x):
    with pytest.raises(InputError, match="span no cell"):
        delaunay_cells(x, np.ones(len(x)))
