"""A ball that is pressed on a block beside one of its edges, or on the edge itself."""

import numpy as np

from ...geometry.bodies.block import block
from ...geometry.bodies.half_ball import half_ball
from ...materials.elastic import Elastic
from ...theory.stability import force_by_edge, from_edge_for
from ..case import case, compare
from ..pressed import Body, Pressed, turn
from .close_contacts import APPROACH, RADIUS, A, places
from .limits import NU, RHO, E

MATERIAL = Elastic(E, NU, RHO)
LENGTH = 20 * A
#: Distance at which the block is a half-space, over the contact radius of Hertz.
WITHIN = 10.0
#: Elements per contact radius that resolve a contact.
FINE = 4.0
#: Of coarse meshes, that scatter.
SCATTERS = (0.5, 0.6, 0.7, 1.0)


def forces(comm, from_edge, elements_per_radius, num_places=1):
    """Forces [N] at places of both meshes, ``from_edge`` contact radii from the edge.

    Returns:
        Array of shape (num_places,), last simulation.
    """
    n, found = elements_per_radius, []
    h, growth = A / n, 0.4 * min(2.5 / n, n / 2.5)
    bodies = block(LENGTH, from_edge * A, h, growth, 1.5 * A)
    ball = half_ball(RADIUS, h, growth, (0.0, 0.0, 1.0), A)
    for k, (along, aside) in enumerate(places(num_places) * h):

        def slide(points, along=along):
            return points + np.array([0.0, along, 0.0])

        def roll(points, along=along, aside=aside):
            return points @ turn([aside / RADIUS, along / RADIUS, 0.0]).T

        low = Body(*bodies, LENGTH, MATERIAL, slide)
        both = Pressed(comm, [low, Body(*ball, RADIUS, MATERIAL, roll, 0.7 * k)])
        both.press(APPROACH)
        found.append(both.reaction())
    return np.array(found), both.simulation


def coarsest(scatter, error):
    """Elements per radius at which the ``scatter`` at :data:`SCATTERS` falls to ``error``."""
    rising = np.maximum.accumulate(scatter[::-1])  # from fine to coarse
    return float(np.interp(error, rising, SCATTERS[::-1]))


@case("stability-edge", num_bodies=2)
def edge(comm, num_places=6, error=0.05):
    """A ball beside the right-angled edge of a block, and with its middle on it.

    A block yields more beside its edge, as if the side were a mirror with a second ball behind it,
    up to the pressure that both leave on the side. On the edge half of the contact is missing, and
    sharp vertices carry beside flat facets. Coarse meshes are compared there and far within.

    Args:
        comm: MPI communicator.
        num_places: Of the meshes, over which errors are taken.
        error: Of the force, at the limits.
    """
    distances, simulations = np.array([2.0, 3.0, 4.5]), []
    whole, s = forces(comm, WITHIN, FINE)
    simulations.append(s)
    beside = np.array([forces(comm, x, FINE)[0][0] for x in distances]) / whole[0]
    predicted = from_edge_for(error)
    # What is missing falls as the distance grows.
    measured = np.exp(np.interp(np.log(error), np.log(1 - beside[::-1]), np.log(distances[::-1])))
    results = {
        f"x/a where {error:.0%} of the force is missing": compare(measured, predicted, 0.3),
        "force at x = 2 a over that within": compare(beside[0], force_by_edge(2.0), 0.03),
    }
    limits = {}
    for name, x in (("within", WITHIN), ("on the edge", 0.0)):
        fine = whole[0] if x == WITHIN else forces(comm, x, FINE)[0][0]
        scatter = []
        for n in SCATTERS:
            coarse, s = forces(comm, x, n, num_places)
            scatter.append(np.sqrt(np.mean((coarse / fine - 1) ** 2)))
            simulations.append(s)
        limits[name] = coarsest(np.array(scatter), error)
        # With one element per radius, of half a contact too.
        results[f"{name}: error at n = 1"] = compare(scatter[-1], 0.0, 0.03, 1.0)
    # Scatter of six places is known to 1/√12 of itself.
    results["n on the edge at the limit"] = compare(limits["on the edge"], limits["within"], 0.3)
    return results, simulations
