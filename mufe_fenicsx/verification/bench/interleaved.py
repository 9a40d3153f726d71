"""Simulations that take turns in one program, on one rank and on two: rates in the same minute.

The machines that benchmarks run on are shared, and faster or slower from one minute to the next.
Rates of programs that ran one after the other are off by a tenth against each other; here each goes
on for a part of a second before the next one does.
"""

import statistics
import time

import numpy as np
from mpi4py import MPI

from .scenes import prepare
from .search import share_of_contact

#: A rank that has nothing to do looks so often whether the others have done their part [s].
REST = 2e-3

#: One rank, two that share a simulation, and two programs at once that each have all of it:
#: the last over the first is what the machine leaves two ranks that never wait for each other.
COPIES = {
    "one": {"ranks": 1},
    "two": {"ranks": 2},
    "programs": {"ranks": 2, "apart": True},
}


def turns(comm, *, cases, repeats=5, parts=6):
    """Rates of simulations by turns. Collective.

    Args:
        cases: {name: {"ranks", how many of the first ones it is on; "steps" of one measurement;
            "apart", whether each of them has a simulation of its own; others: parameters of
            `bench_scenes.prepare`}}.
        repeats: Measurements, at least five.
        parts: Turns that each of them is taken apart into.

    Returns:
        dict: name to ``num_cells``, ``rates`` [element-steps/s] of the measurements; for those
        with contact also ``num_contacts`` and what `bench_search.share_of_contact` has.
    """
    repeats, parts = int(repeats), int(parts)
    ready = {name: _Case(comm, **case) for name, case in cases.items()}
    for case in ready.values():
        case.seconds_of(comm, 5)
    rates = {name: [] for name in ready}
    for _ in range(repeats):
        seconds = dict.fromkeys(ready, 0.0)
        steps = {name: max(1, round(case.steps / parts)) for name, case in ready.items()}
        for _ in range(parts):
            for name, case in ready.items():
                seconds[name] += case.seconds_of(comm, steps[name])
        for name, case in ready.items():
            rates[name].append(case.num_cells * steps[name] * parts / seconds[name])
    found = {name: case.finish(comm) for name, case in ready.items()}
    return {name: one | {"rates": rates[name]} for name, one in found.items()}


class _Case:
    """A simulation on the first ranks, and rest for the others. Collective over all."""

    def __init__(self, comm, *, ranks, steps, apart=False, **parameters):
        self.steps = int(steps)
        self.comm = comm.Split(0 if comm.rank < ranks else MPI.UNDEFINED, comm.rank)
        self.simulation, self.num_cells = None, 0
        if self.comm != MPI.COMM_NULL:
            members = self.comm.Split(self.comm.rank) if apart else self.comm
            self.simulation, _ = prepare(members, **parameters)
            self.num_cells = self.comm.allreduce(self.simulation.mesh.num_cells)
        meet(comm)
        self.num_cells = comm.bcast(self.num_cells)

    def seconds_of(self, comm, num_steps):
        """How long its ranks took for so many steps [s]."""
        seconds = 0.0
        if self.simulation is not None:
            self.comm.Barrier()
            start = time.perf_counter()
            for _ in range(num_steps):
                self.simulation.step(everywhere=False)
            self.comm.Barrier()
            seconds = time.perf_counter() - start
        meet(comm)
        return comm.bcast(seconds)

    def finish(self, comm):
        """What it is; its time steps come to their end."""
        found = {"num_cells": self.num_cells}
        if self.simulation is not None:
            self.simulation.energies()
            if contacts := self.simulation.num_contacts:
                found["num_contacts"] = contacts
                found |= share_of_contact(self.simulation, self.steps)
            yielded = np.count_nonzero(self.simulation.state.plastic_strain)
            found["yielded"] = self.comm.allreduce(yielded) / self.num_cells
        meet(comm)
        return comm.bcast(found)


def meet(comm):
    """All wait for all without keeping a core busy. Collective."""
    request = comm.Ibarrier()
    while not request.Test():
        time.sleep(REST)


def ratio(rates, others):
    """Median of one's rate over the other's, measurement by measurement."""
    return statistics.median(a / b for a, b in zip(rates, others, strict=True))
