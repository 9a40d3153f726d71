"""The balance of energy by central differences, which is exact in a linear system."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.run.from_bodies import simulate
from tests.bodies import packed_spheres


@pytest.mark.mpi
@pytest.mark.parametrize("law", [Elastic, Rigid])
@pytest.mark.parametrize("thrown", [False, True], ids=["rest", "thrown"])
@pytest.mark.parametrize("damping", [0.0, 1e5], ids=["", "damped"])
def test_nothing_is_left_from_the_first_step_on(law, thrown, damping):
    """Balls that do not touch under gravity; the step and then the damping change on the way.

    To rounding, and to what the elastic law is nonlinear by: that of a ball that falls is none.
    """
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), gap=0.1)
    velocity = np.zeros_like(mesh.x)
    velocity[:] = [0.3, 0.0, 0.1] if thrown else 0.0
    s = simulate(
        mesh, [law(5e7, 0.2, 2500.0)] * mesh.num_grains, [], gravity=np.array([0, 0, -2e4]),
        velocity=velocity, damping=damping,
    )  # fmt: skip
    put_in = 0.0
    for change in range(3):
        for _ in range(5):
            s.step()
            e = s.energies()
            put_in = max(put_in, e["kinetic"] + e["damping"])
            assert abs(e["residual"]) < 1e-11 * put_in
        if change == 0:
            s.dt *= 0.5
        else:
            s.damping = 0.3 * damping + 1e3
