"""The time step of single elements (`assembled = False`) bounds that of the assembled system."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx import Elastic, box, build
from mufe_fenicsx.kernels.bulk.element_step import element_steps

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


def test_step_of_an_element_is_that_of_its_four_altitudes():
    """Δt = 1/(c √Σ 1/h²), of uneven tetrahedra."""
    rng, speed = np.random.default_rng(3), 7.0
    for _ in range(5):
        x = rng.standard_normal((4, 3))
        gradients = np.linalg.inv(np.column_stack([np.ones(4), x]))[1:]  # |∇N| = 1/h
        expected = 1.0 / (speed * np.sqrt((gradients**2).sum()))
        found = element_steps(x, np.array([[0, 1, 2, 3]], np.int32), np.array([speed]))
        assert found[0] == pytest.approx(expected, rel=1e-12)


def test_step_of_tetrahedra_alone_is_that_of_the_dense_matrix():
    """Δt = 2/ω of a brick, whatever touches it."""
    points, cells = box((EDGE, 2 * EDGE, EDGE), (2, 2, 2))
    s = build(MPI.COMM_SELF, [(points, cells)], MATERIAL, np.zeros(3), np.zeros(3), axes="")
    size = s.state.x.size
    K = np.empty((size, size))
    for i, q in enumerate(np.eye(size)):
        y = np.zeros_like(s.state.x)
        s.solid.add_stiffness(y, q.reshape(-1, 3), s.state.x)
        K[i] = y.ravel()
    root = np.repeat(1.0 / np.sqrt(s.solid.mass), 3)
    expected = 2.0 / np.sqrt(np.linalg.eigvalsh(root[:, None] * K * root)[-1])
    # Lanczos stops at a residual of 2 % of the eigenvalue, which is added.
    assert 0.98 * expected < s.stable.of_tets() <= expected * (1 + 1e-9)
