"""What a script gives to `build` and `drive` is refused in one line where it cannot be used."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import build, drive
from mufe_fenicsx.state import ForceTerm

UP = [0.0, 0.0, 1.0]
TET = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]), np.array([[0, 1, 2, 3]])


def one_tetrahedron(**changed):
    """A tetrahedron between six planes, with arguments of `build` changed."""
    options = {"low": [0, 0, 0], "high": [1, 1, 1]} | changed
    return build(MPI.COMM_SELF, [TET], Elastic(E=1e9, nu=0.2, rho=2000.0), **options)


def wall(**changed):
    """Build with a wall beside the six, with fields of it changed."""
    return one_tetrahedron(walls=[Wall(**{"name": "lid", "point": UP, "normal": UP} | changed)])


class Lost(ForceTerm):
    """A force that is not a number."""

    name = "lost"

    def add_forces(self, f, state, dt):
        """Add it."""
        f += np.nan


CASES = [
    (
        lambda: one_tetrahedron(wall_friction={"z_mim": 0.3}),
        'wall of wall_friction = "z_mim", expected z_min',
    ),
    (lambda: one_tetrahedron(axes="xw"), 'axes = "xw", expected letters of xyz'),
    (
        lambda: one_tetrahedron(low=[0, 0]),
        "low = [0, 0], expected finite numbers of shape (3,)",
    ),
    (lambda: one_tetrahedron(damping=-1.0), "damping = -1.0, expected 0 or more"),
    (lambda: one_tetrahedron(damping=np.nan), "damping = nan, expected a finite number"),
    (
        lambda: one_tetrahedron(velocity=lambda x, grain: np.zeros((2, 3))),
        "velocity = array of shape (2, 3), 0 of its numbers not finite, "
        "expected finite numbers of shape (4, 3)",
    ),
    (lambda: wall(name="z_min"), 'name of a wall = "z_min", expected one that no other has'),
    (
        lambda: wall(point=[0, 0]),
        "point of wall lid = [0, 0], expected finite numbers of shape (3,)",
    ),
    (
        lambda: wall(velocity="fast"),
        'velocity of wall lid = "fast", expected finite numbers of shape (3,)',
    ),
    (
        lambda: wall(target=1.0),
        "speed of wall lid = 0.0, expected > 0 m/s where it holds a force",
    ),
    (
        lambda: build(MPI.COMM_SELF, [TET], None, [0] * 3, [1] * 3),
        "material = None, expected an IsotropicSolid or a list",
    ),
    (
        lambda: Elastic(E="70 GPa", nu=0.2, rho=2500.0),
        'E = "70 GPa", expected a finite number',
    ),
    (
        lambda: drive(one_tetrahedron(), {"top": UP}, 1.0),
        'wall = "top", expected one of x_min, x_max, y_min, y_max, z_min, z_max',
    ),
    (
        lambda: one_tetrahedron().add_term(Lost()),
        "force term lost adds forces that are not finite",
    ),
]


@pytest.mark.parametrize(("attempt", "message"), CASES, ids=[message for _, message in CASES])
def test_what_cannot_be_used_is_named(attempt, message):
    with pytest.raises(InputError) as caught:
        attempt()
    assert str(caught.value) == message
