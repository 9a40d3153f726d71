"""Walls that a servo presses."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.materials.elastic import Elastic
from tests.bodies import RADIUS, packed_spheres, simulation_of


@pytest.mark.mpi
def test_servo_holds_its_force_and_its_work_is_in_the_balance():
    """Three balls side by side under a servo come to rest at the target force."""
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), gap=0.2)
    # Enough for several facets of each ball: on a single one it would roll.
    target = 20.0
    up = np.array([0.0, 0.0, 1.0])
    walls = [
        Wall("z_min", np.zeros(3), up),
        Wall("z_max", np.array([0.0, 0.0, 2.2 * RADIUS]), -up, target=target, speed=0.5),
    ]
    material = Elastic(1e9, 0.15, 2650.0)
    # A tenth of the frequency of a ball on its contacts: it settles in some periods.
    sim = simulation_of(mesh, material, walls, damping=2e4)
    for _ in range(9000):
        sim.step()
    bottom, top = sim.wall_forces()
    # The servo slows down in proportion to what is missing: it approaches exponentially.
    assert top == pytest.approx(target, rel=0.01)
    assert bottom == pytest.approx(target, rel=0.01)
    energies = sim.energies()
    assert abs(energies["residual"]) < 1e-3 * energies["work"]
