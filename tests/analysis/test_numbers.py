"""Numbers of the analysis against exact cases."""

import numpy as np
import pytest

from mufe_fenicsx.analysis import (
    energy_check,
    grain_energy,
    grain_means,
    mesh_quality,
    quasi_static,
    rows,
    stress_strain,
)
from mufe_fenicsx.analysis.checkerboard import checkerboard
from tests.made_up_run import ball, fake_history

ROUND_OFF = 1e-12


def test_modulus_of_a_parabola():
    """A least-squares line over a symmetric window has the slope in its middle, exactly."""
    strain = np.linspace(0, 0.1, 101)
    stress = 1e7 * strain + 5e8 * strain**2
    found = stress_strain.tangent_modulus(strain, stress, 0.05, 0.02)
    assert found == pytest.approx(1e7 + 2 * 5e8 * 0.05, rel=ROUND_OFF)
    assert stress_strain.secant_modulus(strain, stress) == pytest.approx(6e7, rel=ROUND_OFF)
    assert np.isnan(stress_strain.tangent_modulus(strain, stress, 0.05, 1e-6))


def test_ratios_of_a_known_history():
    h = fake_history()
    loaded = rows.loaded_rows(h)
    assert h["strain"][loaded].min() > 0.05 and h["strain"][loaded].max() == 0.1
    # As made: kinetic 0.003 and internal 0.9 of the work; residual 1 - 0.9 - 0.085 - 0.01 - 0.003.
    # Round-off of the sums.
    assert quasi_static.kinetic_ratio(h)[loaded] == pytest.approx(0.003 / 0.9, rel=1e-9)
    assert energy_check.residual_ratio(h)[loaded] == pytest.approx(0.002, rel=1e-9)
    wiggle = 1 + 0.01 * np.sin(900 * h["strain"])
    exact = np.abs(wiggle - 1 / wiggle) / (0.5 * (wiggle + 1 / wiggle))
    assert quasi_static.force_difference(h) == pytest.approx(exact, rel=1e-9)


def test_ratios_without_load_are_not_known():
    h = {k: np.zeros(2) for k in ("kinetic", "elastic", "plastic", "force_z_max", "force_z_min")}
    assert np.isnan(quasi_static.kinetic_ratio(h)).all()
    assert np.isnan(quasi_static.force_difference(h)).all()


def test_quality_of_a_regular_and_a_corner_tetrahedron():
    regular = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    cells = np.array([[0, 2, 1, 3], [4, 5, 6, 7]])
    q = mesh_quality.mesh_quality(np.vstack([regular, corner]), cells)
    edge = np.sqrt(8)
    assert q.volume == pytest.approx([edge**3 / (6 * np.sqrt(2)), 1 / 6], rel=ROUND_OFF)
    assert q.altitude == pytest.approx([edge * np.sqrt(2 / 3), 1 / np.sqrt(3)], rel=ROUND_OFF)
    angle = [np.degrees(np.arccos(1 / 3)), np.degrees(np.arctan(np.sqrt(2)))]
    assert q.angle == pytest.approx(angle, rel=ROUND_OFF)


def test_mean_stress_equals_the_load_on_a_column():
    """A block of even stress fills half of the sample: the mean is half of it."""
    points, cells = ball(2, 1.0, np.random.default_rng(0))
    volume = mesh_quality.mesh_quality(points, cells).volume
    stress = np.tile([0, 0, -3e6, 0, 0, 0], (len(cells), 1))
    found = grain_means.sample_stress(stress, volume, 2 * volume.sum())
    assert found == pytest.approx([0, 0, -1.5e6, 0, 0, 0], rel=ROUND_OFF)
    assert grain_means.void_ratio(volume.sum(), 2 * volume.sum()) == pytest.approx(1)
    labels, means = grain_means.grain_means(
        np.array([1.0, 5.0, 2.0]), np.array([3.0, 1.0, 2.0]), np.array([7, 7, 4])
    )
    assert list(labels) == [4, 7] and means == pytest.approx([2, 2])


def test_energies_of_a_bar_under_even_stress():
    """Uniaxial stress: elastic energy σ²/2E; plastic work is the area under the table."""
    points, cells = ball(2, 1.0, np.random.default_rng(0))
    volume = mesh_quality.mesh_quality(points, cells).volume
    E, nu, sigma = 1e9, 0.3, -3e4
    stress = np.tile([0, 0, sigma, 0, 0, 0], (len(cells), 1))
    strain = np.full(len(cells), 0.06)
    velocity = np.tile([0.0, 3.0, 4.0], (len(points), 1))
    moved = points * (1 + sigma / E * np.array([-nu, -nu, 1]))
    V = volume.sum()
    for element in ("averaged", "p1", "composite"):
        found = grain_energy.grain_energy(
            points, moved, cells, np.full(len(cells), 5), stress, strain, velocity,
            E, nu, 2000.0, [[0.0, 1e7], [0.05, 1.1e8]], "flat", element, 6,
        )  # fmt: skip
        # Small strain, but for terms of the next order in σ/E.
        assert found.elastic == pytest.approx(sigma**2 / (2 * E) * V, rel=5 * abs(sigma) / E)
    assert found.labels == [5]
    assert found.plastic == pytest.approx((0.05 * 6e7 + 0.01 * 1.1e8) * V, rel=ROUND_OFF)
    assert found.kinetic == pytest.approx(0.5 * 2000 * 25 * V, rel=ROUND_OFF)
    x = np.array([0.0, 0.02, 0.05, 0.07])
    slope = grain_energy.plastic_work(x, [[0.0, 1e7], [0.05, 1.1e8]], "slope")
    assert slope == pytest.approx(1e7 * x + 1e9 * x**2, rel=ROUND_OFF)


def test_checkerboard_is_one_where_neighbours_alternate_and_small_where_smooth():
    """A chain of tetrahedra in a prism, each with the next one face: alternating, even, linear."""
    n = 40
    cells = np.array([[k, k + 1, k + 2, k + 3] for k in range(n)])
    volume, sign = np.ones(n), (-1.0) ** np.arange(n)
    assert checkerboard(cells, sign, volume) == pytest.approx(1, abs=1e-12)
    assert checkerboard(cells, np.ones(n), volume) == pytest.approx(0, abs=1e-12)
    # A linear course has its neighbours' mean but at both ends, where it is off by one step.
    assert checkerboard(cells, np.linspace(1, 2, n), volume) < 0.5 * np.sqrt(2 / n) / (n - 1)
    # Two in turn with one pressure: from pair to pair.
    pairs = np.repeat(sign[: n // 2], 2)
    assert checkerboard(cells, pairs, volume, family=2) == pytest.approx(1, abs=1e-12)
