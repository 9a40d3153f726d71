"""Two blocks with faces that do not match, pressed on each other."""

import math

import numpy as np
from mpi4py import MPI

from ..geometry.shapes import box
from ..materials.elastic import Elastic
from .build import build, drive, settle, sum_over_nodes
from .case import case, compare

E, RHO, SIZE = 100e9, 2650.0, 1e-3


@case("patch", num_bodies=2)
def patch(comm, divisions=4, other_divisions=5, strain=1e-4):
    """Two blocks with non-matching faces between platens: momentum, and how even the pressure is.

    Poisson's ratio is zero and the faces cover each other, so the exact answer is one
    uniform axial stress. (A face that stood out, even by 1 % of its edge, would make it
    uneven by itself.)

    Args:
        comm: MPI communicator.
        divisions, other_divisions: Bricks along the edge of the lower and the upper block.
        strain: Axial strain between the platens.
    """
    half = 0.5 * SIZE
    lower = box(
        (SIZE, SIZE, half),
        (divisions, divisions, max(divisions // 2, 1)),
    )
    upper = box(
        (SIZE, SIZE, half),
        (other_divisions, other_divisions, max(other_divisions // 2, 1)),
        (0, 0, half),
    )
    material = Elastic(E, 0.0, RHO)
    s = build(
        comm, [lower, upper], material, (0, 0, 0), (SIZE, SIZE, SIZE), axes="z",
        damping=math.pi * material.wave_speed / SIZE,
    )  # fmt: skip
    drive(s, {"z_max": (0, 0, -strain * SIZE)}, 8 * SIZE / material.wave_speed)
    worst = _unbalanced(s)
    settle(s, 1e-14)
    bottom, top = s.wall_forces()
    worst = max(worst, _unbalanced(s))

    stress = -s.solid.stress(s.state)[:, 2]
    deviation = stress / (top / SIZE**2) - 1
    volume = s.solid.volume0
    largest = comm.allreduce(np.abs(deviation).max(initial=0.0), op=MPI.MAX)
    squares, total = comm.allreduce(np.array([volume @ deviation**2, volume.sum()]))
    results = {
        # Each contact force is added to a node and taken from a facet: round-off of the sums.
        "unbalanced contact force": compare(worst, 0.0, 1e-12, scale=1.0),
        # At rest to 1e-14 in energies, so about 1e-7 in forces.
        "top against bottom force": compare(top, bottom, 1e-6),
        # Traction acts on each facet at its centroid: of a facet that two others share, each
        # may get a part that is not its own. Measured for 4 and 5 divisions: 0.7 % and 0.3 %.
        "largest deviation of the stress": compare(largest, 0.0, 0.02, scale=1.0),
        "mean deviation of the stress": compare(math.sqrt(squares / total), 0.0, 0.01, scale=1.0),
    }
    return results, [s]


def _unbalanced(s):
    """Sum of all nodal forces and of those on the walls, over the wall forces."""
    total = sum_over_nodes(s, s.force.x.array.reshape(-1, 3)) + sum_over_nodes(s, s.walls.force)
    return np.linalg.norm(total) / np.abs(s.wall_forces()).sum()
