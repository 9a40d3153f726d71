"""What contact cannot work with is said in one line, on all ranks."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.mesh import create_grain_mesh
from tests.bodies import RADIUS, packed_spheres, simulation_of

COMM = MPI.COMM_WORLD
QUARTZ = Elastic(100e9, 0.15, 2650.0)


def wall(height):
    return Wall("z_min", np.array([0.0, 0.0, height]), np.array([0.0, 0.0, 1.0]))


@pytest.mark.parametrize(
    "walls, options, expected",
    [
        ([], {"friction": -0.1}, r"friction = -0.1, expected >= 0"),
        ([], {"friction": np.nan}, r"friction = nan, expected a finite number"),
        ([], {"compliance": 0.0}, r"compliance = 0.0, expected > 0"),
        ([wall(RADIUS)], {}, r"wall z_min is 0.001 m inside the sample"),
    ],
)
def test_bad_values(walls, options, expected):
    mesh = packed_spheres(COMM, (3, 1, 1))
    with pytest.raises(InputError, match=expected) as error:
        simulation_of(mesh, QUARTZ, walls, **options)
    assert "\n" not in str(error.value)


def test_a_little_overlap_with_a_wall_is_no_error():
    """It becomes the offset of its pairs, and moves nothing; a mean facet edge is 0.45 R here."""
    mesh = packed_spheres(COMM, (3, 1, 1))
    s = simulation_of(mesh, QUARTZ, [wall(0.1 * RADIUS)])
    for _ in range(3):
        s.step()
    # The pole is as deep as that but for what facets cut off, h²/8R = 0.025 R.
    deepest = COMM.allreduce(s.walls.pairs.offset.min(initial=0.0), op=MPI.MIN)
    assert -0.1 * RADIUS <= deepest < -0.075 * RADIUS
    assert not s.wall_forces().any() and not s.state.v.any()


def test_grain_without_stiffness():
    class Soft(Elastic):
        contact_modulus = 0.0

    mesh = packed_spheres(COMM, (3, 1, 1))
    with pytest.raises(InputError, match=r"grain 1 = 0.0 Pa, expected > 0: its pairs have no"):
        simulation_of(mesh, Soft(100e9, 0.15, 2650.0))


@pytest.mark.mpi
def test_grain_without_a_surface_of_its_own():
    """A label without cells, and two grains that share the nodes between them."""
    points, cells = box((1.0, 1.0, 1.0), (2, 1, 1), (0.0, 2.0 * COMM.rank, 0.0))
    half = (points[cells].mean(axis=1)[:, 0] > 0.5).astype(int)
    ranks, labels = np.arange(COMM.size + 1) % COMM.size, np.arange(1, COMM.size + 2)
    mesh = create_grain_mesh(COMM, points, cells, np.full(len(cells), COMM.rank), labels, ranks)
    with pytest.raises(InputError, match=rf"grain {COMM.size + 1} has 0 surface nodes"):
        simulation_of(mesh, QUARTZ)

    ranks, labels = np.arange(2 * COMM.size) // 2, np.arange(1, 2 * COMM.size + 1)
    with pytest.raises(InputError, match=r"grain 2 has a node of grain 1, expected nodes of its"):
        create_grain_mesh(COMM, points, cells, 2 * COMM.rank + half, labels, ranks)
