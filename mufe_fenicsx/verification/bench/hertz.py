"""What a Hertz contact to a wanted error costs by time steps and by static increments."""

import numpy as np
from mpi4py import MPI

from ...errors import SolverError
from ...theory import hertz
from ..integrators import BALLS, NU, E, press
from ..plastic_ball import RADIUS
from .launch import case_of, row

#: Largest error of the force, and time steps over static increments in processor time.
ERROR, TARGET = 0.02, 10.0
#: Durations of the time steps over the ball's period, from the fastest on: with graded masses, and
#: with those of the material.
PERIODS = (1.5, 3.0, 6.0)
PLAIN_PERIODS = (0.25, 0.5, 0.75)
#: Residual of the increment and of its linear systems, from the fastest on.
RESIDUALS = ((3e-2, 1e-1), (1e-2, 3e-2), (1e-3, 1e-2))
#: Records on the way: each costs time steps an evaluation of the energies.
RECORDS = 20


def hertz_cost(parameters):
    """Press one ball under a plane both ways on one mesh, each as fast as the error allows.

    An elastic contact is found in one increment. Time steps have the masses of the material, or
    graded ones, which a case without inertia may have: their steps are some 20 times as long.

    Parameters: ``elements_per_radius``; ``repeats``, of which the median counts.
    """
    n = float(parameters.get("elements_per_radius", 5.0))
    repeats = int(parameters.get("repeats", 3))
    press(MPI.COMM_SELF, "hertz", 1.5, 1.0)  # compile
    press(MPI.COMM_SELF, "hertz", 1.5, 1.0, 1, **_inexact(*RESIDUALS[0]))
    for residuals in RESIDUALS:
        one = _run(n, 1.0, 1, **_inexact(*residuals))
        if one["error"] <= ERROR:
            break
    static = [one, *(_run(n, 1.0, 1, **_inexact(*residuals)) for _ in range(repeats - 1))]
    results = {"num_cells": {"computed": one["num_cells"]}}
    seconds = float(np.median([one["processor_s"] for one in static]))
    results["error_static"] = row(one["error"], ERROR, one["error"] <= ERROR)
    results["residual_static"] = {"computed": residuals[0]}
    results["processor_s_static"] = {"computed": seconds}
    for name, durations, options in (
        ("time_steps", PLAIN_PERIODS, {"added_mass": 0.0}),
        ("graded_masses", PERIODS, {}),
    ):
        for periods in durations:
            one = _run(n, periods, **options)
            results[f"{name}_error_in_{periods:g}_periods"] = {"computed": one["error"]}
            results[f"{name}_processor_s_in_{periods:g}_periods"] = {"computed": one["processor_s"]}
            if one["error"] <= ERROR:
                break
        ratio = one["processor_s"] / seconds if one["error"] <= ERROR else 0.0
        results[f"{name}_over_static"] = row(ratio, TARGET, ratio >= TARGET)
    return case_of("hertz", {"elements_per_radius": n, "repeats": repeats}, results)


def _inexact(tolerance, linear):
    """Options of an increment with these residuals; its masses are those of the material."""
    petsc = {"ksp_rtol": linear}
    return {
        "linear_solver": "products", "tolerance": tolerance, "petsc": petsc, "added_mass": 0.0
    }  # fmt: skip


def _run(elements_per_radius, periods, increments=None, **options):
    """Time of the processor and error of the force at the end of the approach."""
    course = press(
        MPI.COMM_SELF, "hertz", elements_per_radius, periods, increments, records=RECORDS, **options
    )
    # The last record: there the contact has nearly the elements that were asked for.
    approach = course.approach[-1]
    theory = hertz.hertz_force(approach, RADIUS, hertz.effective_modulus((E, NU)))
    wanted = (1 - 1.2 / RECORDS) * BALLS["hertz"][1] * RADIUS
    if not approach > wanted:
        raise SolverError(f"last record at an approach of {approach:g} m, expected {wanted:g} m")
    return {
        "processor_s": course.processor_s,
        "error": float(abs(course.force[-1] / theory - 1)),
        "num_cells": course.simulation.mesh.num_cells,
    }
