"""Simulations that benchmarks let take turns."""

import statistics

import pytest
from mpi4py import MPI

from mufe_fenicsx.verification.bench.interleaved import ratio, turns


@pytest.mark.mpi
def test_ranks_without_a_part_rest_while_others_measure():
    """On one rank, on all, and on each, boxes of 1296 tets; nobody waits forever."""
    comm = MPI.COMM_WORLD
    box = {"kind": "box", "divisions": 6, "steps": 4}
    cases = {"one": {"ranks": 1, **box}, "all": {"ranks": comm.size, **box}}
    cases["each"] = {**cases["all"], "apart": True}
    found = turns(comm, cases=cases, repeats=2, parts=2)
    assert found["each"]["num_cells"] == 1296 * comm.size
    for name, one in found.items():
        assert name == "each" or one["num_cells"] == 1296
        assert len(one["rates"]) == 2 and min(one["rates"]) > 0
    assert found == comm.bcast(found)  # timed by the first rank
    # The box flows all through where it is computed.
    assert found["one"]["yielded"] == found["all"]["yielded"] == found["each"]["yielded"] == 1.0


def test_ratio_compares_measurements_of_the_same_minute():
    """A machine that slows to a half between measurements leaves the ratio as it is."""
    others = [40.0, 20.0, 40.0, 20.0, 40.0]
    assert ratio([0.7 * rate for rate in others], others) == pytest.approx(0.7)
    assert statistics.median(others) == 40.0
