"""What a plan reads from meshes: the edges at their contacts."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx import half_ball
from mufe_fenicsx.contact.results.patches import find_patches
from mufe_fenicsx.geometry.grains import Grains, save_grains
from mufe_fenicsx.materials.sand import SAND
from mufe_fenicsx.planning.errors import sample_errors
from mufe_fenicsx.planning.present import present_state
from mufe_fenicsx.planning.sample import read_sample
from mufe_fenicsx.run.from_bodies import distribute
from tests.bodies import simulation_of
from tests.planning.samples import scene

R, A = 1e-3, 0.3e-3  # radii of balls and of their contact [m]


def pressed(fine):
    """Two half balls that touch, the edges at their contact a part of those elsewhere."""
    coarse = 0.25 * R
    points, cells = half_ball(
        R, h_contact=fine * coarse, growth=0.5, direction=(0, 0, 1.0), contact_radius=A
    )
    points = points - points[:, 2].max() * np.array([0, 0, 1.0])
    down = np.array([0.0, 0.0, A**2 / (2 * R)])
    return [(points + down, cells), (points * [1, -1, -1] - down, cells)], coarse


@pytest.mark.parametrize("fine", [1.0, 0.25])
def test_a_plan_has_the_edges_at_contacts_that_a_report_has(fine, tmp_path, table):
    """However coarse grains are elsewhere: within 15 %, as facets within an edge count."""
    bodies, coarse = pressed(fine)
    save_grains(tmp_path, Grains.from_list([1, 2], bodies, coarse))
    found = read_sample(tmp_path)
    apart = [(bodies[0][0] - [0.0, 0.0, 0.1 * R], bodies[0][1]), bodies[1]]
    s = simulation_of(distribute(MPI.COMM_SELF, apart), SAND)
    x = s.mesh.x + 0.1 * R * (s.mesh.x[:, 2:] < -0.05 * R) * np.array([0.0, 0.0, 1.0])
    s.contact.begin_step(x)
    s.contact.add_forces(np.zeros_like(x), x)
    (edge,) = find_patches(s.contact, s.mesh, x).edge
    assert found.size == pytest.approx(edge, rel=0.15) and found.inner == coarse
    elements = present_state(scene(), found, table).elements
    assert elements == pytest.approx(0.1 * found.diameter / edge, rel=0.15)
    h, inner, tets = found.mesh_for(4 * elements, 0.1, sample_errors(table))
    assert h == pytest.approx(found.size / 4) and inner in (h, coarse) and tets > found.tets
