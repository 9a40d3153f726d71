"""The law of the grains on random paths of strain, element by element."""

from types import SimpleNamespace

import numpy as np
from mpi4py import MPI

from ..materials.j2 import J2
from ..materials.sand import SAND
from .case import case, compare
from .strain_paths import MaterialPoints, RandomPaths, Tets

MODULI = {"E": 100e9, "rho": 2650.0}
#: By turns: the grains of the paper, a perfectly plastic one of high yield stress (elastic
#: strains of 1 %), and a table with steep and shallow parts a few yield strains long.
MATERIALS = (
    SAND,
    J2(**MODULI, nu=0.3, yield_stress=((0.0, 1e9),)),
    J2(
        **MODULI,
        nu=0.4,
        yield_stress=((0.0, 50e6), (1e-3, 55e6), (2e-3, 90e6), (3e-3, 90e6), (4e-3, 120e6)),
    ),
)


@case("material-point", num_bodies=3)
def material_point(
    comm, paths=1000, legs=3, reach=2.5, turn=0.5, steps_per_leg=400, subdivisions=3, seed=1
):
    """Radial return of the compiled kernel on random paths of strain with rotation.

    Each path is that of one tetrahedron: straight lines of logarithmic strain between random
    points, loading and unloading, while it turns. The kernel is compared

    - with the same law written in NumPy, at the same steps: what remains is round-off;
    - with that law at ``subdivisions`` times as many steps along the same path: the error
      of the steps, which is of first order. So the reference keeps 1/subdivisions of it, and
      the difference is divided by 1 - 1/subdivisions.

    Radial return is exact where the strain goes straight outward; where it turns the error
    is about 0.1 of the strain of a step over the yield strain, all along the path: 1e-3 needs
    steps of a hundredth of the yield strain.

    Args:
        comm: MPI communicator.
        paths: Number of paths.
        legs: Straight parts of each.
        reach: Longest part over the yield strain Y/E.
        turn: Largest rotation on one part [rad].
        steps_per_leg: Steps of the kernel on each part; with the defaults a step strains by
            up to 0.0063 yield strains.
        subdivisions: Steps of the reference for one of the kernel.
        seed: Of the random numbers.
    """
    materials = [MATERIALS[k % len(MATERIALS)] for k in range(paths)]
    tets = Tets(comm, materials, seed=seed)
    mine = tets.materials
    first_yield = np.array([m.yield_stress[0][1] for m in mine])
    course = RandomPaths(
        tets.number, first_yield / np.array([m.E for m in mine]), legs, reach, turn, seed
    )
    twin, fine = MaterialPoints(mine), MaterialPoints(mine)
    error, twin_error, force_error = 0.0, 0.0, 0.0
    for leg in range(legs):
        for k in range(steps_per_leg):
            F = course.at(leg, (k + 1) / steps_per_leg)
            tets.step(F)
            twin.step(F)
            for j in range(subdivisions):
                fine.step(course.at(leg, (k + (j + 1) / subdivisions) / steps_per_leg))
            if k % 10 == 9 or k == steps_per_leg - 1:
                stress = tets.stress()
                error = max(error, _distance(stress, fine.stress(), first_yield))
                twin_error = max(twin_error, _distance(stress, twin.stress(), first_yield))
                force_error = max(force_error, tets.force_error())
    yielded = comm.allreduce(int((tets.state.plastic_strain > 0).sum()))
    work = tets.state.plastic_work / tets.solid.volume0
    scale = max(fine.plastic_work.max(), 1e-300)
    largest = [error, twin_error, force_error, tets.outside,
               np.abs(work - fine.plastic_work).max() / scale]  # fmt: skip
    error, twin_error, force_error, outside, work_error = (
        comm.allreduce(float(v), op=MPI.MAX) for v in largest
    )
    whole = 1 / (1 - 1 / subdivisions)
    coarse = max(reach / steps_per_leg / 0.01, 1.0)
    results = {
        # The target, for steps of up to 0.01 yield strains; the error is of first order.
        "stress against fine steps, over the yield stress": compare(
            whole * error, 0.0, 1e-3 * coarse, scale=1.0
        ),
        # Positions are rounded to eps, strains of a step are 1e-6 at least: 2e-10 of the
        # increments, which are 1/100 of the yield stress, as a random walk over the steps.
        "stress against NumPy, over the yield stress": compare(twin_error, 0.0, 1e-9, scale=1.0),
        "distance from the yield surface, over the yield stress": compare(
            outside, 0.0, 1e-10, scale=1.0
        ),
        "plastic work against fine steps, over the largest": compare(
            whole * work_error, 0.0, 1e-3 * coarse, scale=1.0
        ),
        # Round-off of differences of positions 100 times the size of an element.
        "nodal forces against stress": compare(force_error, 0.0, 1e-11, scale=1.0),
        "part of the paths that yield": compare(yielded / paths, 1.0, 0.1),
    }
    return results, [SimpleNamespace(mesh=tets.mesh, state=tets.state)]


def _distance(stress, reference, scale):
    """Largest difference of a component over ``scale``."""
    return float((np.abs(stress - reference).max(axis=(1, 2)) / scale).max(initial=0.0))
