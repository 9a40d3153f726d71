"""How the iterations of the linear solver grow with the number of grains."""

import time

import numpy as np
from mpi4py import MPI

from ...contact.walls import Wall
from ...run.from_bodies import axis_planes, distribute, simulate
from ..packing import RADIUS, angular_grains
from .launch import case_of, row

#: Iterations of the most grains over those of the fewest, at most.
TARGET = 1.5
E, NU, RHO = 1e9, 0.2, 2650.0


def linear(parameters):
    """Iterations of a linear solver in a static increment of more and more grains.

    Grains with flat faces fill a box nearly; its platens press them by a strain in which the gaps
    of 1 % close and most grains touch all neighbours.

    Parameters: ``solver`` ("products"); ``element_size`` of `packing.angular_grains`; ``strain``;
    ``increments``.
    """
    from ...materials.elastic import Elastic

    solver = str(parameters.get("solver", "products"))
    element_size = float(parameters.get("element_size", 0.5))
    strain = float(parameters.get("strain", 0.01))
    increments = int(parameters.get("increments", 4))
    results, per_solve = {}, []
    for counts in ((2, 2, 3), (3, 3, 3), (4, 5, 5)):
        n = int(np.prod(counts))
        bodies = angular_grains(counts, element_size, gap=0.01)
        points = np.concatenate([p for p, _ in bodies])
        low, high = points.min(axis=0), points.max(axis=0)
        height = float(high[2] - low[2])
        planes = axis_planes(low, high, "xyz").items()
        sim = simulate(
            distribute(MPI.COMM_SELF, bodies), [Elastic(E, NU, RHO)] * n,
            [Wall(name, point, normal) for name, (point, normal) in planes],
            1.0 / increments, friction=0.2, linear_solver=solver, stabilisation=1e-4,
        )  # fmt: skip
        sim.walls.velocity[sim.walls.names.index("z_max"), 2] = -strain * height
        start = time.perf_counter()
        while (left := 1.0 - sim.state.t) > 1e-9:
            sim.dt = min(sim.dt, left)
            sim.step()
        newton = sum(r[2] for r in sim.report)
        count = sum(r[3] for r in sim.report)
        per_solve.append(count / newton)
        results |= {
            f"num_cells_{n}_grains": {"computed": sim.mesh.num_cells},
            f"newton_{n}_grains": {"computed": newton},
            f"linear_per_newton_{n}_grains": {"computed": per_solve[-1]},
            f"seconds_{n}_grains": {"computed": time.perf_counter() - start},
        }
    growth = per_solve[-1] / per_solve[0]
    results["growth"] = row(growth, TARGET, growth <= TARGET)
    given = {"solver": solver, "element_size": element_size, "strain": strain}
    return case_of("linear", given | {"increments": increments, "radius": RADIUS}, results)
