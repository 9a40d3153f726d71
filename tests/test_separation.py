"""Overlaps are removed without strain."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.separation import TOLERANCE, separate
from mufe_fenicsx.materials.elastic import Elastic
from tests.bodies import RADIUS, packed_spheres, simulation_of


@pytest.mark.mpi
def test_overlapping_spheres_are_parted_and_release_no_energy():
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), gap=-0.06)
    done = separate(mesh, max_shift=0.3)
    # Poles on a line: an overlap of 0.06 R less what the facets cut off (h²/8R = 0.025 R each).
    assert 0 < done.max_depth <= 0.06 * RADIUS
    assert done.remaining_nodes == 0
    assert done.max_shift <= 0.06 * RADIUS
    # Two lenses of height 0.03 R a contact: 2 pi h² (R - h/3) of 3 spheres, at most.
    lens = np.pi * 0.03**2 * (1 - 0.01)
    assert -4 * lens / (3 * 4 / 3 * np.pi) * 2 < done.volume_change < 0

    sim = simulation_of(mesh, Elastic(1e9, 0.15, 2650.0), friction=0.3)
    for _ in range(50):
        sim.step()
    energies = sim.energies()
    # The reference is free of stress and nothing pushes: not one joule appears.
    scale = 1e9 * RADIUS**3 * TOLERANCE**2
    assert max(energies["kinetic"], energies["elastic"], energies["contact"]) < 1e-12 * scale


@pytest.mark.mpi
def test_overlap_that_stays_becomes_an_offset_and_releases_no_energy():
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), gap=-0.12)
    sim = simulation_of(mesh, Elastic(1e9, 0.15, 2650.0))
    adopted = MPI.COMM_WORLD.allreduce(sim.contact.num_adopted)
    assert adopted > 0
    for _ in range(50):
        sim.step()
    energies = sim.energies()
    # As above: forces start from the offset, so nothing moves.
    assert energies["kinetic"] == 0.0
    assert energies["elastic"] == 0.0
