"""`python -m tests`: what its processes share."""

from types import SimpleNamespace

import pytest

from tests.__main__ import Sharing


def test_two_processes_run_each_test_once_and_meet(tmp_path):
    """One is twice as fast; neither asks the other."""
    tests = [SimpleNamespace(nodeid=f"test_a.py::test_b[{number}/x]") for number in range(7)]
    orders = [list(tests), list(tests)]
    workers = [Sharing(tmp_path, backwards) for backwards in (False, True)]
    for worker, order in zip(workers, orders, strict=True):
        worker.pytest_collection_modifyitems(order)
    run = [[], []]
    for turn in [0, 0, 1] * 7:
        if orders[turn]:
            test = orders[turn].pop(0)
            if workers[turn].pytest_runtest_protocol(test) is None:
                run[turn].append(test)
    assert run[0] + run[1][::-1] == tests
    assert (len(run[0]), len(run[1])) == (5, 2)


def test_small_numbers_are_compared_by_their_relative_tolerance():
    """What is zero is compared to 1e-12 still."""
    assert 1e-13 != pytest.approx(2e-13, rel=0.1) and [1e-13] != pytest.approx([2e-13], rel=0.1)
    assert 1e-13 == pytest.approx(0.0)
