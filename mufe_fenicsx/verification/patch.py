"""Two blocks with faces that do not match, pressed on each other."""

import math
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from ..geometry.bodies.shapes import box
from ..materials.elastic import Elastic
from ..run.from_bodies import build, drive, settle, sum_over_nodes
from .case import case, compare

E, RHO, SIZE = 100e9, 2650.0, 1e-3


@dataclass(frozen=True)
class Blocks:
    """Two blocks at rest between platens, and what is measured there."""

    simulation: object
    forces: tuple  #: on the lower and the upper platen [N]
    unbalanced: float  #: largest sum of all nodal and platen forces, over the platen forces
    largest: float  #: deviation of the axial stress from its mean, over it: of an element
    mean: float  #: root mean square by volume of that deviation
    modulus: float  #: mean stress over mean strain between the platens, over Young's modulus


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
    found = press_blocks(comm, divisions, other_divisions, strain)
    bottom, top = found.forces
    results = {
        # Each contact force is added to a node and taken from a facet: round-off of the sums.
        "unbalanced contact force": compare(found.unbalanced, 0.0, 1e-12, scale=1.0),
        # At rest to 1e-14 in energies, so about 1e-7 in forces.
        "top against bottom force": compare(top, bottom, 1e-6),
        # Traction acts on each facet at its centroid: of a facet that two others share, each
        # may get a part that is not its own. Measured for 4 and 5 divisions: 0.7 % and 0.3 %.
        "largest deviation of the stress": compare(found.largest, 0.0, 0.02, scale=1.0),
        "mean deviation of the stress": compare(found.mean, 0.0, 0.01, scale=1.0),
    }
    return results, [found.simulation]


def press_blocks(comm, divisions, other_divisions, strain=1e-4, at_rest=1e-14, **options):
    """Press two blocks of other meshes on each other between platens. Collective.

    Args:
        comm: MPI communicator of at most two ranks.
        divisions, other_divisions, strain: As of the case.
        at_rest: Kinetic over stored energy at which to stop.
        options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`.

    Returns:
        :class:`Blocks`.
    """
    half = 0.5 * SIZE
    lower, upper = (
        box((SIZE, SIZE, half), (n, n, max(n // 2, 1)), (0, 0, z))
        for n, z in ((divisions, 0.0), (other_divisions, half))
    )
    material = Elastic(E, 0.0, RHO)
    s = build(
        comm, [lower, upper], material, (0, 0, 0), (SIZE, SIZE, SIZE), axes="z",
        damping=math.pi * material.wave_speed / SIZE, **options,
    )  # fmt: skip
    drive(s, {"z_max": (0, 0, -strain * SIZE)}, 8 * SIZE / material.wave_speed)
    worst = _unbalanced(s)
    settle(s, at_rest)
    bottom, top = s.wall_forces()

    stress = -s.solid.stress(s.state)[:, 2]
    deviation = stress / (top / SIZE**2) - 1
    volume = s.solid.volume0
    squares, total = comm.allreduce(np.array([volume @ deviation**2, volume.sum()]))
    return Blocks(
        simulation=s,
        forces=(bottom, top),
        unbalanced=max(worst, _unbalanced(s)),
        largest=comm.allreduce(np.abs(deviation).max(initial=0.0), op=MPI.MAX),
        mean=math.sqrt(squares / total),
        modulus=top / SIZE**2 / (strain * E),
    )


def _unbalanced(s):
    """Sum of all nodal forces and of those on the walls, over the wall forces."""
    total = sum_over_nodes(s, s.specimen.f) + sum_over_nodes(s, s.walls.force)
    return np.linalg.norm(total) / np.abs(s.wall_forces()).sum()
