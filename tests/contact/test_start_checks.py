"""Grains that start deep in each other are refused."""

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
import math

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import distribute
from tests.bodies import sphere

COMM = MPI.COMM_SELF
QUARTZ = Elastic(100e9, 0.15, 2650.0)


@pytest.mark.parametrize("depth", [0.6, 1.3])
def test_a_grain_that_starts_deeper_than_an_edge_is_refused(depth):
    """Two blocks face to face, their overlap known exactly in edges of their facets."""
    points, cells = box((1e-3,) * 3, (4, 4, 4))
    edge = math.sqrt(4 / math.sqrt(3) * 0.5 * 0.25e-3**2)
    upper = points + np.array([0.31e-4, 0.17e-4, 1e-3 - depth * edge])
    mesh = distribute(COMM, [(points, cells), (upper, cells)])
    if depth < 1:
        assert Simulation(mesh, [QUARTZ] * 2).contact.overlaps.num_accepted
        return
    with pytest.raises(InputError, match=r"grain \d starts .* deep in grain \d, 1\.\d* edges"):
        Simulation(mesh, [QUARTZ] * 2)


@pytest.mark.mpi
def test_a_grain_inside_another_is_refused():
    """No surface crosses another one: found by the winding number."""
    comm = MPI.COMM_WORLD
    bodies = [sphere(1e-3, 0.4e-3), sphere(1e-4, 0.4e-4), sphere(1e-3, 0.4e-3, (3e-3, 0, 0))]
    if comm.size > len(bodies):
        comm = COMM
    mesh = distribute(comm, bodies)
    with pytest.raises(InputError, match=r"grain [12] has its middle inside grain [12]"):
        Simulation(mesh, [QUARTZ] * mesh.num_grains)
