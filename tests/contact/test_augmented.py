"""Exact gaps of static increments: depths go, and the force is that of the rigid limit."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import InputError, SolverError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import distribute, simulate
from tests.contact.test_mirror import APPROACH, FRAME, quarter
from tests.implicit.test_implicit import STEEL, UP, stacked, static

GLASS = Elastic(100e9, 0.15, 2650.0)


def pressed(increments=1, **options):
    """A quarter of a half ball on mirrors, pressed by a plane in so many increments."""
    points, cells = quarter()
    top = float(points[:, 2].max())
    x, y, z = FRAME.T
    walls = [Wall("plane", top * z, -z)]
    walls += [Wall(str(k), np.zeros(3), n, mirror=True) for k, n in enumerate((x, -y, z))]
    mesh = distribute(MPI.COMM_SELF, [(points @ FRAME.T, cells)])
    s = simulate(mesh, [GLASS], walls, 1.0, stabilisation=0.0, tolerance=1e-8, **options)
    s.walls.velocity[0] = -APPROACH / increments * z
    for _ in range(increments):
        s.step()
    assert s.num_failed == 0
    return s


def test_depths_go_and_the_force_is_that_of_stiff_layers():
    """Layers 1e4 times as stiff are the rigid limit to about 1e-4 of what the usual ones yield.

    A depth of 1e-6 edges is 2e-5 of the approach.
    """
    rigid, soft = pressed(compliance=2.5e-5), pressed()
    exact, again = (pressed(n, gap_tolerance=1e-6) for n in (1, 3))
    force = [s.wall_forces()[0] for s in (rigid, soft, exact, again)]
    # The usual layers take a quarter of this force: recorded.
    assert force[1] == pytest.approx(0.77 * force[0], rel=0.01)
    assert force[2] == pytest.approx(force[0], rel=3e-4)
    # Multipliers go on from increment to increment.
    assert force[3] == pytest.approx(force[2], rel=3e-4)
    # About a factor of three for each.
    assert 3 < exact.augmentations[0][0] < 20
    for s in (exact, again):
        p = s.walls.pairs
        depth = np.abs(p.gap - p.offset)[p.closed].max()
        assert depth == s.augmentations[-1][1] < 1e-6 * s.contact.edge
        # Nothing of it is left in offsets, and no energy in springs that are not pressed.
        assert np.abs(p.offset).max() == 0.0
        e = s.energies()
        assert e["contact"] < 1e-6 * e["elastic"]
    p = soft.walls.pairs
    assert (-p.gap[p.closed]).max() > 1e-3 * soft.contact.edge


def test_flat_blocks_on_each_other_become_one():
    """ν = 0, facets on facets: F = E A ε without the layer's part, in friction too.

    Tolerance: terms of the order of the strain, and depths of 1e-5 edges over the height.
    """
    material = Elastic(1e9, 0.0, 2650.0)
    shapes = [box((1, 1, 1), (2, 2, 2)), box((1, 1, 1), (3, 3, 3), (0, 0, 1.0))]
    mesh = distribute(MPI.COMM_SELF, shapes)
    walls = [Wall("low", np.zeros(3), UP), Wall("top", 2 * UP, -UP)]
    s = static(mesh, material, walls, friction=0.3, gap_tolerance=1e-5, stabilisation=1e-6)
    s.walls.velocity[1] = -0.002 * UP
    s.step()
    assert s.wall_forces()[1] == pytest.approx(1e9 * 0.001, rel=2e-3)


def test_what_is_not_reached_is_said_and_leaves_the_last_state():
    walls = [Wall("low", np.zeros(3), UP), Wall("top", 2 * UP, -UP)]
    s = static(stacked(), STEEL, walls, gap_tolerance=1e-9, max_augmentations=1, smallest_step=1.0)
    s.walls.velocity[1] = -0.01 * UP
    x, offset = s.state.x.copy(), s.walls.pairs.offset.copy()
    with pytest.raises(SolverError, match=r"1 augmentations, .* from the exact gap"):
        s.step()
    np.testing.assert_array_equal(s.state.x, x)
    np.testing.assert_array_equal(s.walls.pairs.offset, offset)


def test_dynamics_are_refused():
    with pytest.raises(InputError, match=r"gap_tolerance = 0\.001, expected none for dynamics"):
        static(stacked(), STEEL, gap_tolerance=1e-3, spectral_radius=0.8)


def test_a_wall_that_is_held_at_a_force():
    """A block in plane strain, pressed along z, its side held at a stress: Hooke's law, both ways.

    Tolerances: force of the servo 1e-3; strains are of the order of 1e-3.
    """
    E, nu, p, strain = 1e9, 0.3, 2e5, 1e-3
    points, cells = box((1, 1, 1), (3, 3, 3))
    mesh = distribute(MPI.COMM_SELF, [(points, cells)])
    planes = [(sign * n, (0.5 - 0.5 * sign) * n) for n in np.eye(3) for sign in (1, -1)]
    walls = [Wall(str(k), at, n) for k, (n, at) in enumerate(planes)]
    walls[1].target, walls[1].speed = p, 0.01
    s = static(mesh, Elastic(E, nu, 2650.0), walls, gap_tolerance=1e-6, stabilisation=1e-6)
    s.walls.velocity[5] = [0.0, 0.0, -0.5 * strain]
    for _ in range(2):
        s.dt = 1.0
        s.step()
    force = s.wall_forces()
    assert force[1] == pytest.approx(p, rel=1.1e-3)
    stress = (strain * E + nu * (1 + nu) * p) / (1 - nu**2)
    assert force[5] == pytest.approx(stress, rel=5e-3)
    side = (nu * (1 + nu) * stress - (1 - nu**2) * p) / E
    assert s.walls.point[1, 0] - 1 == pytest.approx(side, rel=5e-3)
