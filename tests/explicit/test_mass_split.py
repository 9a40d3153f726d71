"""The bound by shares of mass against dense eigenvalue problems."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.explicit.mass_split import MISSES, MassSplit
from mufe_fenicsx.solvers.highest_frequency import HighestFrequency

NUM = 14
#: Residual over eigenvalue of the iterations.
TOLERANCE = 1e-8


def positive(rng, nodes, stiff):
    """A matrix on some of ``NUM`` nodes that resists each by about ``stiff`` of them."""
    a = np.zeros((3 * NUM, 3 * NUM))
    rows = (3 * np.asarray(nodes)[:, None] + np.arange(3)).ravel()
    half = rng.standard_normal((rows.size, rows.size)) * np.sqrt(np.repeat(stiff, 3))[:, None]
    a[np.ix_(rows, rows)] = half @ half.T
    return a


def operator(matrix, nodes=None):
    """``add(y, q)`` between vectors of some nodes."""
    rows = np.arange(NUM) if nodes is None else np.asarray(nodes)
    rows = (3 * rows[:, None] + np.arange(3)).ravel()
    part = matrix[np.ix_(rows, rows)]

    def add(y, q):
        y += (part @ q.ravel()).reshape(-1, 3)

    return add


def shares(rng, tets, springs, at):
    """Masses shared between two matrices, the second on the nodes ``at``; the exact square."""
    mass, x = rng.uniform(1.0, 2.0, NUM), rng.random((NUM, 3))
    solid = SimpleNamespace(
        mass=mass, nodal_stiffness=lambda x: np.diag(tets).reshape(-1, 3).mean(axis=1)
    )
    listed = SimpleNamespace(
        at=np.asarray(at),
        add_compact=operator(springs, at),
        bounds=lambda num: np.where(
            np.isin(np.arange(num), at), np.abs(springs).sum(axis=1).reshape(-1, 3).max(axis=1), 0.0
        ),
    )
    one, other = (
        HighestFrequency(MPI.COMM_SELF, mass, x, operator(m), tolerance=TOLERANCE, max_sweeps=200)
        for m in (tets, springs)
    )
    shared = MassSplit(solid, np.asarray(at), one, other)
    root = np.repeat(1 / np.sqrt(mass), 3)
    exact = np.linalg.eigvalsh(root[:, None] * (tets + springs) * root)[-1]
    shared.choose(x, listed, other(listed.at, listed.add_compact))
    return shared, listed, exact, one() ** 2 + other(listed.at, listed.add_compact) ** 2


@pytest.mark.parametrize("seed", range(4))
def test_no_share_gives_less_than_there_is(seed):
    """Whatever is asked for, and whichever parts were chosen: for any motion it is a bound."""
    rng = np.random.default_rng(seed)
    at = [1, 4, 5, 9]
    tets, springs = positive(rng, range(NUM), np.ones(NUM)), positive(rng, at, np.full(4, 3.0))
    shared, listed, exact, _ = shares(rng, tets, springs, at)
    for factor in (0.3, 0.9, 1.0, 1.3, 3.0):
        # The iteration stops where its residual is that part of the eigenvalue.
        assert shared.bound(factor * exact, listed) > (1 - TOLERANCE) * exact
    shared.part = rng.uniform(0.05, 0.95, NUM)  # λ_t has to be found for these, too
    one = shared._of_tets
    one.set_mass(shared.part * shared.solid.mass)
    shared.square = one() ** 2
    assert shared.bound(exact, listed) > (1 - TOLERANCE) * exact


def test_stiff_elements_and_stiff_springs_apart_do_not_add_up():
    """Weyl's inequality adds both, wherever they are; there it is twice what shares give."""
    rng = np.random.default_rng(7)
    soft, stiff, at = np.full(NUM, 0.01), [0, 1, 2], [8, 9, 10, 11]
    tets = positive(rng, range(NUM), soft) + positive(rng, stiff, np.ones(3))
    springs = positive(rng, at, np.ones(4))
    springs *= np.linalg.eigvalsh(tets)[-1] / np.linalg.eigvalsh(springs)[-1]
    shared, listed, exact, weyl = shares(rng, tets, springs, at)
    assert weyl > 1.6 * exact
    # What soft elements around the springs ask for is a few hundredths of all.
    assert shared.bound(1.1 * exact, listed) == pytest.approx(1.1 * exact, rel=0.05)


def test_parts_that_are_of_no_use_are_left_or_chosen_anew():
    rng = np.random.default_rng(1)
    at = [1, 2]
    shared, *_ = shares(rng, positive(rng, range(NUM), np.ones(NUM)), positive(rng, at, [1, 1]), at)
    shared.judge(useful=True, chosen=True)
    for _ in range(MISSES):
        assert shared.part is not None
        shared.judge(useful=False, chosen=False)
    assert shared.part is None and not shared.rests()  # they were of use once
    # Choices that are of no use from the start become rarer, until one is.
    for left_out in (1, 3, 7):
        shared.judge(useful=False, chosen=True)
        assert shared.part is None
        assert [shared.rests() for _ in range(left_out + 1)] == [True] * left_out + [False]
    shared.judge(useful=True, chosen=True)
    shared.judge(useful=False, chosen=True)
    assert [shared.rests() for _ in range(2)] == [True, False]
