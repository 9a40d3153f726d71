"""A ball in a hollow that is hardly wider."""

from functools import lru_cache

import numpy as np

from ...contact.surface.bulges import height
from ...geometry.bodies.half_ball import half_ball
from ...geometry.bodies.hollow import HEIGHT, hollow
from ...materials.elastic import Elastic
from ...theory.stability import conformity_for
from ..case import case, compare
from ..pressed import FRAME, Body, Pressed, turn
from .close_contacts import places
from .limits import NU, RHO, E

RADIUS = 1e-3
#: Contact radius of Hertz [m].
A = 0.2 * RADIUS
MATERIAL = Elastic(E, NU, RHO)
#: Radius of the gap over that of the ball.
CONFORMITIES = (10.0, 30.0, 100.0)
#: Elements per contact radius that resolve a contact.
FINE = 4.0


def radius_of_hollow(conformity):
    """Radius of the hollow [m] in which the gap of the ball has ``conformity`` of its radius."""
    return RADIUS / (1 - 1 / conformity)


@lru_cache(maxsize=8)
def meshes(conformity, n):
    """The block and the ball with ``n`` elements per contact radius."""
    h, growth = A / n, 0.2 * min(2.5 / n, n / 2.5)
    return (
        hollow(radius_of_hollow(conformity), h, growth, 1.5 * A),
        half_ball(RADIUS, h, growth, (0.0, 0.0, 1.0), A),
    )


def pressed(comm, conformity, n, place=0):
    """The ball above the hollow, rolled to one of the places of its mesh."""
    block, ball = meshes(conformity, n)
    along, aside = places(place + 1)[place] * A / n

    def roll(points):
        return points @ turn([aside / RADIUS, along / RADIUS, 0.0]).T

    low = Body(*block, HEIGHT * radius_of_hollow(conformity), MATERIAL, spin=1.3 * place)
    return Pressed(comm, [low, Body(*ball, RADIUS, MATERIAL, roll, 0.7 * place)])


def unevenness(both, conformity):
    """Standard deviation of the gap's curved surfaces from the true ones, over h²/R. Collective."""
    s = both.simulation
    own, mesh, x = s.contact.own, s.mesh, s.mesh.x
    facets = own.nodes[own.facets]
    middle = x[facets].mean(axis=1) @ FRAME
    off = height(s.contact.layers.smooth.bulge, np.full(3, 1 / 3))
    near = np.linalg.norm(middle, axis=1) < A
    of_ball = mesh.grains[mesh.grain_of_node[facets[:, 0]]] == 1
    square = 0.0
    for body, radius, sign in ((of_ball, RADIUS, 1), (~of_ball, radius_of_hollow(conformity), -1)):
        on = near & body
        if not on.any():  # it is another rank's
            continue
        distance = np.linalg.norm(middle[on] - [0, 0, radius], axis=1)
        edge2 = 4 / np.sqrt(3) * own.facet_area[on].mean()
        square += np.var((sign * (distance - radius) + off[on]) * RADIUS / edge2)
    return float(np.sqrt(both.comm.allreduce(square)))


@case("stability-conforming", num_bodies=2)
def conforming(comm, num_places=6, error=0.05):
    """A ball in a spherical hollow of nearly its radius: how well surfaces must be known.

    The more a hollow fits, the less approach makes a contact of the same size. What the curved
    surfaces miss of the true ones then makes forces scatter, as roughness does.

    Args:
        comm: MPI communicator.
        num_places: Of the meshes, over which errors are taken.
        error: Of the force, at the limit.
    """
    scatters, simulations, results = [], [], {}
    for conformity in CONFORMITIES:
        approach = A**2 / (conformity * RADIUS)
        fine = pressed(comm, conformity, FINE)
        fine.press(approach)
        force, off = fine.reaction(), []
        for k in range(num_places):
            coarse = pressed(comm, conformity, 1.0, k)
            coarse.press(approach)
            off.append(coarse.reaction() / force - 1)
        scatters.append(np.sqrt(np.mean(np.square(off))))
        simulations.append(coarse.simulation)
        results[f"error at n = 1, R'/R = {conformity:g}"] = compare(scatters[-1], 0.0, np.inf, 1.0)
    uneven = unevenness(coarse, conformity)
    results["what curved surfaces miss, over h²/R"] = compare(uneven, 0.0, np.inf, 1.0)
    predicted = conformity_for(error, uneven, 1.0)
    measured = np.exp(np.interp(np.log(error), np.log(scatters), np.log(CONFORMITIES)))
    # Scatter of six places is known to 1/√12 of itself.
    results["R'/R at the limit"] = compare(float(measured), predicted, 0.3)
    return results, simulations
