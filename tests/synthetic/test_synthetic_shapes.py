"""Synthetic grains have the size, form and roundness that were asked for."""

import os
import subprocess
import sys

import numpy as np
import pytest

from mufe_fenicsx.bulk.mass_properties import mass_properties
from mufe_fenicsx.kernels.packing.radial import level, radius_and_slope, shape_place
from mufe_fenicsx.synthetic.shapes import (
    harmonics,
    make_grains,
    quadrature,
    radii,
    sizes,
    sizes_by_mass,
)
from mufe_fenicsx.synthetic.triangulated import icosphere


@pytest.fixture(scope="module")
def grains():
    rng = np.random.default_rng(3)
    form = np.linspace(0.5, 1.0, 6), np.linspace(0.95, 0.6, 6)
    return make_grains(rng, np.full(6, 300e-6), *form, 0.08, 1.6, 15)


def test_size_and_form_of_tetrahedra_are_as_asked(grains):
    """Volume and second moments of an independent mesh of the surface, a fan about the centre."""
    directions, triangles = icosphere(5)
    for g, x in enumerate(grains.surface(directions)):
        cells = np.column_stack([np.full(len(triangles), len(x)), triangles])
        points = np.vstack([x, x.mean(axis=0)])
        mass, centre, inertia = mass_properties(
            points, cells, np.array([0, len(cells)]), np.ones(1)
        )
        # Facets of edges 0.04 r cut off 0.04²/8 = 2e-4 of the radius of round parts.
        assert mass[0] == pytest.approx(np.pi / 6 * 300e-6**3, rel=2e-3, abs=0.0)
        assert np.abs(centre).max() < 1e-3 * 300e-6
        second = 0.5 * np.trace(inertia[0]) * np.eye(3) - inertia[0]
        # The principal axes are the grain's own axes, L first.
        assert np.abs(second - np.diag(np.diag(second))).max() < 2e-3 * second.max()
        length, width, thickness = np.sqrt(np.diag(second))
        assert width / length == pytest.approx(np.linspace(0.5, 1, 6)[g], rel=2e-3)
        assert thickness / width == pytest.approx(np.linspace(0.95, 0.6, 6)[g], rel=2e-3)


def test_without_roughness_a_grain_is_its_ellipsoid():
    grains = make_grains(np.random.default_rng(0), [2.0], [0.7], [0.8], 0.0, 1.7, 15)
    x = grains.surface(icosphere(3)[0])[0]
    # The table is exact for r = 1; the volume by quadrature to 1e-6.
    assert np.abs(((x / grains.semi_axes[0]) ** 2).sum(axis=1) - 1).max() < 1e-5


def test_harmonics_are_orthonormal_and_the_spectrum_is_as_asked():
    directions, weight = quadrature()
    assert weight.sum() == pytest.approx(4 * np.pi, rel=1e-6)
    values, degree = harmonics(directions, 8)
    gram = values.T @ (values * weight[:, None])
    # Two Gauss points in each of 24 intervals, against waves of at most 16 around the sphere.
    assert np.abs(gram - np.eye(len(gram))).max() < 1e-4

    grains = make_grains(np.random.default_rng(1), np.ones(200), np.ones(200), np.ones(200),
                         0.08, 1.5, 8)  # fmt: skip
    field = np.log([radii(table, directions) for table in grains.table])
    power = ((field * weight) @ values) ** 2 / (4 * np.pi)
    rms = [np.sqrt(power[:, degree == n].sum(axis=1).mean()) for n in range(3, 9)]
    wanted = np.arange(3, 9.0) ** -1.5
    wanted *= 0.08 / np.sqrt((wanted**2).sum())
    # 200 x (2n + 1) >= 1400 random numbers: a root mean square to 1/sqrt(2800) = 2 %, three times
    # that; a table of 24 intervals smooths degree 8 by (8 · 0.065)²/12 = 2 %.
    assert np.abs(np.array(rms) / wanted - 1).max() < 0.08


@pytest.mark.parametrize("n", [50, 1000, 20000])
@pytest.mark.parametrize("uniformity", [1.2, 1.4, 2.0, 2.5, 3.0])
def test_sizes_follow_the_distribution_by_mass(n, uniformity):
    """They had been cut by number, without the large ones: d50 was 214 µm at 3."""
    d50, found = sizes_by_mass(sizes(np.random.default_rng(1), n, 300e-6, uniformity))
    # Tails beyond 2.5 sigma are missing: 1.2 % of the mass, evenly on both sides.
    assert d50 == pytest.approx(300e-6, rel=0.002)
    assert found == pytest.approx(uniformity, rel=0.025)


def test_level_function_has_the_gradient_it_says(grains):
    """Central differences at points in all faces of the cube."""
    rng = np.random.default_rng(2)
    axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    centre = np.array([1e-4, 2e-4, -1e-4])
    inverse, offset, table = grains.inverse[0], grains.offset[0], grains.table[0]

    def f(x):
        v = shape_place.py_func(*x, centre, axes, inverse, offset)
        return np.array(level.py_func(*v, axes, inverse, table))

    h = 1e-9
    for x in centre + rng.uniform(-2e-4, 2e-4, (60, 3)):
        numeric = [(f(x + h * e)[0] - f(x - h * e)[0]) / (2 * h) for e in np.eye(3)]
        # Steps of 1e-5 of the size, rounding 1e-16/1e-5; a step across a line of the table is rare
        # and changes the slope by little.
        assert np.abs(numeric - f(x)[1:]).max() < 1e-3 * np.linalg.norm(f(x)[1:])


def test_radius_is_continuous_across_the_edges_of_the_cube(grains):
    table = grains.table[0]
    rng = np.random.default_rng(4)
    for a, b in rng.uniform(-1, 1, (40, 2)):
        for first, second in (((1, 1 - 1e-9, a), (1 - 1e-9, 1, a)), ((-1, b, 1), (-1, b, 1 + 1e-9)),
                              ((a, -1, 1), (a, -1 - 1e-9, 1))):  # fmt: skip
            r = [radius_and_slope.py_func(table, *map(float, v))[0] for v in (first, second)]
            assert r[0] == pytest.approx(r[1], abs=1e-7)


def test_grains_do_not_hang_on_threads_and_kernels_of_the_linear_algebra():
    """Sums in another order differ in their last bits, which rounding takes away."""
    code = """
import hashlib
import numpy as np
from mufe_fenicsx.synthetic.shapes import make_grains
ones = np.ones(40)
grains = make_grains(np.random.default_rng(1), 1e-4 * ones, 0.75 * ones, 0.8 * ones, 0.1, 1.7, 15)
points = grains.surface(np.random.default_rng(2).standard_normal((100, 3)))
print(*[hashlib.md5(a.tobytes()).hexdigest() for a in (*vars(grains).values(), points)])
"""
    found = set()
    # OpenBLAS takes the kernels of the processor that it is told; others pass it over.
    for threads, kernels in (("1", "Haswell"), ("3", "Nehalem")):
        more = {"OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads}
        environment = {**os.environ, **more, "OPENBLAS_CORETYPE": kernels}
        command = [sys.executable, "-c", code]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        found.add(done.stdout)
    assert len(found) == 1
