"""What holds a sample: its areas, volume and stresses, and what its walls do."""

import numpy as np
import pytest

from mufe_fenicsx.container import BOX, CYLINDER, Bounds, container_of, container_of_history

BOUNDS = Bounds(np.array([-1.0, -2.0, 0.5]), np.array([2.0, 2.0, 4.5]), np.array([0.5, 0.0]), 2.5)


@pytest.mark.parametrize("container", [BOX, CYLINDER], ids=lambda each: each.shape)
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
    is_round = np.array([s.radius > 0 for s in surfaces])
    normals = np.array([s.normal for s in surfaces]) * ~is_round[:, None]
    points = np.array([s.point for s in surfaces]) + speed[:, None] * normals
    radii = np.array([s.radius for s in surfaces]) - speed * is_round
    after = container.lengths(points, radii)
    assert lengths - after == pytest.approx(container.closing(speed), rel=1e-8)
    strain = container.along_three((lengths - after) / lengths)
    stress = container.along_three(pressure)
    assert container.means(stress) == pytest.approx(pressure, rel=1e-14)
    volumes = container.volume([lengths, after])
    # Small speeds: second order in them is left out.
    assert forces @ speed == pytest.approx(volumes[0] * (stress @ strain), rel=1e-6)
    assert volumes[0] - volumes[1] == pytest.approx(volumes[0] * strain.sum(), rel=1e-6)


def test_areas_and_volumes():
    assert BOX.volume(BOX.lengths_within(BOUNDS)) == pytest.approx(3 * 4 * 4)
    assert BOX.areas(BOX.lengths_within(BOUNDS)).tolist() == pytest.approx([16, 12, 12])
    lengths = CYLINDER.lengths_within(BOUNDS)
    assert lengths.tolist() == [5.0, 4.0]
    assert CYLINDER.volume(lengths) == pytest.approx(np.pi * 2.5**2 * 4)
    assert CYLINDER.areas(lengths).tolist() == pytest.approx([np.pi * 5 * 4, np.pi * 2.5**2])


def test_a_history_says_which_container_it_is_of():
    assert container_of_history({"force_side": 0, "force_z_max": 0}) is CYLINDER
    assert container_of_history({"force_x_min": 0}) is BOX
    assert container_of(["z_min", "z_max"]) is None
