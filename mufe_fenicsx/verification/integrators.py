"""Static increments against time steps: the same bodies, meshes and contact."""

import math

import numpy as np

from ..materials.elastic import Elastic
from ..materials.j2 import J2
from .case import case, compare
from .mindlin import shear_balls
from .plastic_ball import RADIUS, press_ball
from .torsion import twist_balls

E, NU, RHO = 100e9, 0.15, 2650.0
#: Materials of a ball under a plane, its approach over the radius, and the contact radius at the
#: end over √(R δ): elastic; E/Y = 1000 without hardening; the paper's.
BALLS = {
    "hertz": (Elastic(E, NU, RHO), 4e-4, 1.0),
    "plastic-sphere": (J2(E, NU, RHO, ((0.0, 1e-3 * E),)), 2e-3, math.sqrt(2.0)),
    "paper-sphere": (J2(E, NU, RHO, ((0.0, 10e6), (0.05, 110e6))), 4e-3, math.sqrt(2.0)),
}
#: Parts of the approach at which forces are compared.
PARTS = np.linspace(0.3, 1.0, 8)


def press(comm, name, elements_per_radius, periods, increments=None, **options):
    """Press one of ``BALLS``; the course of `plastic_ball.press_ball`. Collective, one rank."""
    material, approach, wider = BALLS[name]
    a = wider * RADIUS * math.sqrt(approach)
    return press_ball(
        comm, material, approach * RADIUS, a, elements_per_radius, periods=periods,
        increments=increments, **options,
    )  # fmt: skip


@case("integrators", num_bodies=1)
def integrators(comm, elements_per_radius=2.5, periods=320.0, increments=160):
    """Balls under a plane, sheared and twisted balls: static increments against time steps.

    The largest difference of force all along the course, over the force there; sheared and twisted,
    over the range. Both use one function for forces, so that what differs is inertia and damping,
    and the length of increments, over which radial return is of the first order: each by itself
    is 2 to 3 % for the paper's ball in 40 periods or 40 increments.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there, at the end.
        periods: Duration of time steps for the ball.
        increments: Static increments.
    """
    results, simulations = {}, []
    for name in BALLS:
        explicit, static = (
            press(comm, name, elements_per_radius, periods, n) for n in (None, increments)
        )
        simulations += [explicit.simulation, static.simulation]
        at = PARTS * explicit.approach[-1]
        forces = [np.interp(at, c.approach, c.force) for c in (explicit, static)]
        worst = float(np.abs(forces[1] / forces[0] - 1).max())
        results[f"{name}: force, static against time steps"] = compare(worst, 0.0, 0.01, 1.0)
    for name, run, parameters in (
        ("mindlin", shear_balls, (2.5, 0.015, 0.3, 0.3, 0.8, 0.3, 24.0)),
        ("torsion", twist_balls, (2.5, 0.015, 0.15, 0.3, 0.75, 0.3, 32.0)),
    ):
        pair = [run(comm, *parameters, integrator) for integrator in ("explicit", "static")]
        simulations += [one.simulation for one in pair]
        # At the turns of the path, where both have records.
        values = [_at_turns(one) for one in pair]
        worst = float(np.abs(values[1] - values[0]).max() / np.abs(values[0]).max())
        results[f"{name}: at the turns, over the range"] = compare(worst, 0.0, 0.01, 1.0)
    return results, simulations


def _at_turns(course):
    """Tangential force or moment at the turns of the path of `mindlin` or `torsion`."""
    values = course.force if hasattr(course, "force") else course.moment
    return np.asarray(values)[course.turns[1:]]
