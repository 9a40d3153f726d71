"""What `[fracture]` costs: of a step before anything breaks, and of a growth of the mesh."""

import statistics
import time

import numpy as np

from .interleaved import ratio
from .launch import case_of, launch, row
from .scenes import blocks

#: Largest time of a step with cracks that have not begun over that without.
TARGET = 1.1
#: Strength over the first largest von Mises stress: far away, and so near that facets are looked
#: at.
FAR, NEAR = 100.0, 1.0


def whole_and_growing(comm, *, divisions=16, steps=60, repeats=9, growths=5):
    """Two pressed blocks without cracks, with strengths far away and near, by turns. One rank.

    The processor's time counts: other programs on the machine lengthen the clock's.

    Args:
        divisions: Cubes along an edge of the lower block.
        steps, repeats: Steps of one measurement, and measurements of each.
        growths: Facets around so many cells open afterwards, one cell after the other.

    Returns:
        dict: number of tets, and of cells that are near a strength; times of a step [s] by "off",
        "far" and "near"; those of growths [s].
    """
    from ...bulk.cracks.cracks import Cracks
    from ...bulk.solid import von_mises
    from ...materials.fracture import Fracture

    steps = int(steps)
    tests = {name: blocks(comm, divisions=divisions) for name in ("off", "far", "near")}
    state = tests["off"].state
    largest = float(von_mises(state.deviator).max())
    for name, over in (("far", FAR), ("near", NEAR)):
        s = tests[name]
        s.add_term(Cracks(s.specimen, Fracture(over * largest, 1e9, shear_ratio=1.0, friction=0.0)))
    spent = {name: [] for name in tests}
    for _ in range(int(repeats)):
        for name, s in tests.items():
            start = time.process_time()
            for _ in range(steps):
                s.step(everywhere=False)
            spent[name].append((time.process_time() - start) / steps)
    s = tests["off"]
    growing = []
    for cell in np.linspace(0, s.mesh.num_cells - 1, int(growths), dtype=int):
        _, across = s.mesh.inner_facets()
        beside = across[(across == cell).any(axis=1)]
        start = time.process_time()
        s.grow(beside)
        growing.append(time.process_time() - start)
        s.step()
    near = tests["near"].specimen.opening_terms[0].near
    return {
        "num_cells": s.mesh.num_cells,
        "near": float(np.count_nonzero(near) / near.size),
        "seconds": spent,
        "growing": growing,
    }


def cracks(parameters):
    """A step with `[fracture]` before anything breaks over one without, and a growth, on one rank.

    Parameters: ``divisions``, ``steps``, ``repeats``, ``growths``.
    """
    found = launch("whole_and_growing", parameters, 1)
    seconds = found["seconds"]
    far, near = (ratio(seconds[name], seconds["off"]) for name in ("far", "near"))
    step, growth = statistics.median(seconds["off"]), statistics.median(found["growing"])
    return case_of("cracks", parameters, {
        "num_cells": {"computed": found["num_cells"]},
        "step_s": {"computed": step},
        "far_over_off": row(far, TARGET, far <= TARGET),
        "near_over_off": {"computed": near},
        "part_of_cells_near": {"computed": found["near"]},
        "growth_s": {"computed": growth},
        "growth_in_steps": {"computed": growth / step},
    })  # fmt: skip
