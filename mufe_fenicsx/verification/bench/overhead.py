"""Small scenes: what a step costs besides its kernels, and the rate of a few thousand tets."""

import statistics
import time

import numpy as np

from .launch import case_of, launch, row, seconds_each

#: Rate of the small scene [element-steps/s], and time of a step beside the kernels [s].
TARGET_RATE, TARGET_OVERHEAD = 10e6, 30e-6
#: Cubes along an edge of the lower block: of the small scene, and of one that is hardly there.
SMALL, LEAST = 6, 1


def small(comm, *, divisions=SMALL, steps=450, repeats=9):
    """Two J2 blocks pressed face to face on one rank. Collective.

    Args:
        divisions: Cubes along an edge of the lower one; the upper one has one more.
        steps, repeats: Steps of one measurement, evaluations of the time step among them, and
            measurements.

    Returns:
        dict: number of tets; median time of a step, and of that in the C kernels [s].
    """
    from .scenes import blocks

    simulation = blocks(comm, divisions=divisions)
    spent = []
    for _ in range(int(repeats)):
        spent.append(seconds_each(int(steps), lambda: simulation.step(everywhere=False)))
    contact = simulation.contact
    contact.bind()
    kernels = [
        _Timed(owner, "_call")
        for owner in (
            simulation.solid.kernel,
            contact.pairs.forces,
            contact.walls.pairs.forces,
        )
    ]
    # Those of contact until the next search, which makes others.
    for _ in range(int(steps)):
        simulation.step(everywhere=False)
    return {
        "num_cells": comm.allreduce(simulation.mesh.num_cells),
        "step": statistics.median(spent),
        "kernels": sum(np.median(kernel.seconds) for kernel in kernels),
    }


class _Timed:
    """A function that another object calls by name, with the time of each call."""

    def __init__(self, owner, name):
        self.seconds = []
        self._function = getattr(owner, name)
        setattr(owner, name, self)

    def __call__(self, *arguments):
        start = time.perf_counter()
        result = self._function(*arguments)
        self.seconds.append(time.perf_counter() - start)
        return result


def overhead(parameters):
    """A step of a few thousand tets with contact, and of a few dozen, on one rank.

    Parameters: ``steps``, ``repeats``.
    """
    many = launch("small", {"divisions": SMALL, **parameters}, 1)
    few = launch("small", {"divisions": LEAST, **parameters}, 1)
    rate = many["num_cells"] / many["step"]
    beside = few["step"] - few["kernels"]
    results = {
        "num_cells": {"computed": many["num_cells"]},
        "rate": row(rate, TARGET_RATE, rate >= TARGET_RATE),
        "step_s": {"computed": many["step"]},
        "kernels_s": {"computed": many["kernels"]},
        "num_cells_least": {"computed": few["num_cells"]},
        "step_s_least": {"computed": few["step"]},
        "beside_kernels_s_least": row(beside, TARGET_OVERHEAD, beside <= TARGET_OVERHEAD),
    }
    return case_of("overhead", parameters, results)
