"""What a Hertz contact to a wanted error costs by time steps and by static increments."""

import numpy as np
from mpi4py import MPI

from ..theory import hertz
from .bench_launch import row
from .integrators import BALLS, NU, E, press
from .plastic_ball import RADIUS

#: Largest error of the force, and time steps over static increments in wall time.
ERROR, TARGET = 0.02, 10.0
#: Durations of the time steps over the ball's period, from the fastest on.
PERIODS = (1.5, 3.0, 6.0, 12.0, 24.0)


def hertz_cost(parameters):
    """Press one ball under a plane both ways on one mesh, each as fast as the error allows.

    Parameters: ``elements_per_radius``; ``repeats``, of which the median counts.
    """
    n = float(parameters.get("elements_per_radius", 5.0))
    repeats = int(parameters.get("repeats", 5))
    press(MPI.COMM_SELF, "hertz", 1.5, 1.0)  # compile
    press(MPI.COMM_SELF, "hertz", 1.5, 1.0, 2)
    static = [_run(n, 1.0, 2) for _ in range(repeats)]
    steps = [_run(n, periods) for periods in PERIODS]
    good = [one for one in steps if one["error"] <= ERROR]
    results = {"num_cells": {"computed": static[0]["num_cells"]}}
    for periods, one in zip(PERIODS, steps, strict=True):
        results[f"error_in_{periods:g}_periods"] = {"computed": one["error"]}
        results[f"seconds_in_{periods:g}_periods"] = {"computed": one["seconds"]}
    seconds = float(np.median([one["seconds"] for one in static]))
    results["error_static"] = row(static[0]["error"], ERROR, static[0]["error"] <= ERROR)
    results["seconds_static"] = {"computed": seconds}
    if good:
        ratio = good[0]["seconds"] / seconds
        results["time_steps_over_static"] = row(ratio, TARGET, ratio >= TARGET)
    return {
        "case": "hertz",
        "parameters": {"elements_per_radius": n, "repeats": repeats},
        "results": results,
        "passed": bool(good) and all(one.get("passed", True) for one in results.values()),
    }


def _run(elements_per_radius, periods, increments=None):
    """Seconds and largest error of the force over the last half of the approach."""
    course = press(MPI.COMM_SELF, "hertz", elements_per_radius, periods, increments)
    # The last record: there the contact has the elements that were asked for.
    approach = course.approach[-1]
    theory = hertz.hertz_force(approach, RADIUS, hertz.effective_modulus((E, NU)))
    assert approach > 0.99 * BALLS["hertz"][1] * RADIUS
    return {
        "seconds": course.seconds,
        "error": float(abs(course.force[-1] / theory - 1)),
        "num_cells": course.simulation.mesh.num_cells,
    }
