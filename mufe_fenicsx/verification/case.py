"""What all cases share: the form of their answer, and on which ranks they run."""

import functools
import inspect
import math
import time


def compare(computed, theory, tolerance, scale=None):
    """One line of a case's answer.

    The error is relative to ``scale``, or to ``theory`` where that is None, unless it is zero; a
    scale of 1 leaves it as it is. A tolerance of inf is that of a number without a bound, which may
    be nan: it neither passes nor fails (None).
    """
    scale = (abs(theory) or 1.0) if scale is None else scale
    error = abs(computed - theory) / scale
    return {
        "computed": float(computed),
        "theory": float(theory),
        "error": float(error),
        "tolerance": float(tolerance),
        "passed": None if tolerance == math.inf else bool(error <= tolerance),
    }


def _verdict(passed):
    """Whether all rows with a bound pass; None: no row has one."""
    bounded = [row for row in passed if row is not None]
    return all(bounded) if bounded else None


def at_least(computed, least):
    """One line of a case's answer: what must not be less."""
    return compare(computed, max(computed, least), 0.0)


def case(name, num_bodies):
    """Make a case of a function ``f(comm, **parameters)`` that returns (results, simulations).

    A grain lives on one rank, so a case of few bodies runs on the first
    ``num_bodies`` ranks and the others receive its answer. Collective.
    """

    def decorate(function):
        signature = inspect.signature(function)

        @functools.wraps(function)
        def run(comm, **parameters):
            bound = signature.bind(comm, **parameters)
            bound.apply_defaults()
            values = {key: value for key, value in bound.arguments.items() if key != "comm"}
            start = time.perf_counter()
            answer = on_first_ranks(comm, num_bodies, lambda part: _answer(function, part, values))
            return {
                "case": name,
                "parameters": values,
                **answer,
                "wall_s": time.perf_counter() - start,
                "passed": _verdict([line["passed"] for line in answer["results"].values()]),
            }

        run.case_name = name
        return run

    return decorate


def by_name(*cases):
    """{name: case} of functions that :func:`case` made, in their order."""
    return {one.case_name: one for one in cases}


def _answer(function, comm, values):
    results, simulations = function(comm, **values)
    return {
        "results": results,
        "num_cells": int(comm.allreduce(sum(s.mesh.num_cells for s in simulations))),
        "num_steps": int(sum(s.state.num_steps for s in simulations)),
    }


def on_first_ranks(comm, count, function):
    """Result of ``function(part)`` on the first ``count`` ranks, on all ranks. Collective.

    What it raises on rank 0 is raised on all; ranks without a part sleep meanwhile. ``part`` is
    ``comm`` itself where all ranks have one, else it ends with the call.
    """
    part = comm if comm.size <= count else comm.Split(0 if comm.rank < count else 1, comm.rank)
    result = error = None
    if comm.rank < count:
        try:
            result = function(part)
        except Exception as raised:
            if comm.rank:
                raise
            error = raised
    arrived = comm.Ibarrier()
    while not arrived.Test():
        time.sleep(0.002)
    result, error = comm.bcast((result, error))
    if part is not comm:
        part.Free()
    if error is not None:
        raise error
    return result
