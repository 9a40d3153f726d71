"""The time step of single elements (`assembled = False`) bounds that of the assembled system."""

import numpy as np
from mpi4py import MPI

from mufe_fenicsx import Elastic, box, build

MATERIAL = Elastic(100e9, 0.15, 2650.0)
EDGE = 1e-3


def test_step_of_elements_counts_contact_and_is_the_shorter_one():
    """Two cubes pressed together: elements alone, their contact, and both assembled."""
    lower, cells = box((EDGE,) * 3, (3, 3, 3))
    steps = {}
    for assembled in (False, True):
        for gap in (-1e-3 * EDGE, EDGE):
            upper = np.add(lower, (0.0, 0.0, EDGE + gap))
            s = build(
                MPI.COMM_SELF, [(lower, cells), (upper, cells)], MATERIAL, np.zeros(3), np.zeros(3),
                axes="", assembled=assembled, velocity=lambda x, grain: 0.1 * (1.5 - grain[:, None])
                * [[0.0, 0.0, 1.0]],
            )  # fmt: skip
            s.step()
            s.check()
            steps[assembled, gap > 0] = s.dt
    # The highest frequency of the whole is at most that of a part (Irons & Treharne 1971), and
    # springs of contacts are added to it.
    for apart in (False, True):
        assert 0 < steps[False, apart] <= steps[True, apart]
    assert steps[False, False] < steps[False, True]
