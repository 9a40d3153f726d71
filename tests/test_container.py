"""What holds a sample: its areas, volume and stresses, and what its walls do."""

import numpy as np
import pytest

from mufe_fenicsx.container import (
    BOX,
    CYLINDER,
    HOLLOW_CYLINDER,
    Bounds,
    container_of,
    container_of_history,
)

BOUNDS = Bounds(
    np.array([-1.0, -2.0, 0.5]), np.array([2.0, 2.0, 4.5]), np.array([0.5, 0.0]), 2.5, 1.5
)
ALL = (BOX, CYLINDER, HOLLOW_CYLINDER)


@pytest.mark.parametrize("container", ALL, ids=lambda each: each.shape)
def test_work_of_the_walls_is_stress_times_strain_times_volume(container):
    """Σ F·v of any forces and slow speeds of the walls is V Σ σj ε̇j along three directions."""
    rng = np.random.default_rng(3)
    surfaces = container.surfaces(BOUNDS)
    assert tuple(s.name for s in surfaces) == container.walls
    assert container_of(container.walls) is container
    lengths = container.lengths_within(BOUNDS)
    # The same pressure on the walls of an axis: what a mean stress means.
    pressure, speed = rng.uniform(1, 2, lengths.size), rng.uniform(1e-7, 2e-7, len(surfaces))
    forces = container.areas_of_walls(lengths)
    for a, walls in enumerate(container.walls_of_axis):
        forces[list(walls)] *= pressure[a]
    assert container.stresses(forces, lengths) == pytest.approx(pressure, rel=1e-14)
    is_round = np.array([s.radius != 0 for s in surfaces])
    normals = np.array([s.normal for s in surfaces]) * ~is_round[:, None]
    points = np.array([s.point for s in surfaces]) + speed[:, None] * normals
    radii = np.array([s.radius for s in surfaces]) - speed * is_round
    after = container.lengths(points, radii)
    assert lengths - after == pytest.approx(container.closing(speed), rel=1e-8)
    strain = container.three_strains((lengths - after) / lengths, after)
    stress = container.three_stresses(pressure, lengths)
    volumes = container.volume([lengths, after])
    # Small speeds: second order in them is left out.
    assert forces @ speed == pytest.approx(volumes[0] * (stress @ strain), rel=1e-6)
    assert volumes[1] == pytest.approx(volumes[0] * np.prod(1 - strain), rel=1e-12)
    # A load that is the same in all directions is that in each mean of several.
    even = container.three_stresses(np.ones(lengths.size), lengths)
    assert container.means(even) == pytest.approx(np.ones(len(container.compared)))


def test_areas_and_volumes():
    assert BOX.volume(BOX.lengths_within(BOUNDS)) == pytest.approx(3 * 4 * 4)
    assert BOX.areas(BOX.lengths_within(BOUNDS)).tolist() == pytest.approx([16, 12, 12])
    lengths = CYLINDER.lengths_within(BOUNDS)
    assert lengths.tolist() == [5.0, 4.0]
    assert CYLINDER.volume(lengths) == pytest.approx(np.pi * 2.5**2 * 4)
    assert CYLINDER.areas(lengths).tolist() == pytest.approx([np.pi * 5 * 4, np.pi * 2.5**2])


def test_means_of_a_hollow_cylinder():
    """σr, σθ, εr and εθ of Hight, Gens & Symes (1983), in radii; by hand."""
    lengths = HOLLOW_CYLINDER.lengths_within(BOUNDS)
    assert lengths.tolist() == [5.0, 3.0, 4.0]
    assert HOLLOW_CYLINDER.volume(lengths) == pytest.approx(np.pi * (2.5**2 - 1.5**2) * 4)
    assert HOLLOW_CYLINDER.shortest(lengths) == 1.0
    across, around, axial = HOLLOW_CYLINDER.three_stresses([8.0, 4.0, 7.0], lengths)
    assert across == pytest.approx((8 * 2.5 + 4 * 1.5) / (2.5 + 1.5))
    assert around == pytest.approx((8 * 2.5 - 4 * 1.5) / (2.5 - 1.5))
    # The outer wall has come in by 0.1, the inner one has come out by 0.2.
    now = np.array([4.8, 3.4, 4.0])
    strain = HOLLOW_CYLINDER.three_strains(1 - now / lengths, now)
    assert strain == pytest.approx([(0.1 + 0.2) / 1.0, (0.1 - 0.2) / 4.0, 0.0])
    assert axial == 7.0


def test_a_history_says_which_container_it_is_of():
    assert container_of_history({"force_side": 0, "force_z_max": 0}) is CYLINDER
    assert container_of_history({"force_side": 0, "force_inner": 0}) is HOLLOW_CYLINDER
    assert container_of_history({"force_x_min": 0}) is BOX
    assert container_of(["z_min", "z_max"]) is None
