"""Contacts that come back to where they were: what repeated and closed paths cost."""

import math

import numpy as np

from ..materials.elastic import Elastic
from ..materials.j2 import J2
from ..run.from_bodies import drive
from .case import case, compare
from .half_balls import ACROSS, ALONG, UP, HalfBalls, low_load

E, RHO = 100e9, 2650.0
RADIUS, CONTACT_RADIUS = 1.0, 0.1
#: Growth of the element size with the distance.
GROWTH = 0.35


def _halves(comm, material, elements_per_radius):
    """Two half balls by static increments, meshed for ``CONTACT_RADIUS``."""
    h = CONTACT_RADIUS / elements_per_radius
    balls = HalfBalls(RADIUS, 0.5 * RADIUS, CONTACT_RADIUS, h, GROWTH)
    options = {"increment": 1.0, "tolerance": 1e-9}
    return balls.simulation(comm, material, 0.0, added_mass=0.0, **options)


@case("pressed-again", num_bodies=2)
def pressed_again(
    comm, elements_per_radius=1.0, nu=0.3, ratio=1000.0, hardening=0.0, lift=0.3, cycles=6
):
    """Half balls that yield, pressed, lifted far, pressed again; then cycles of half the way.

    The second force is that of the first, and neither dents nor elements flow again. In cycles a
    perfectly plastic body yields on the way out too, on fine meshes as on coarse ones, and softens;
    with a little hardening it shakes down.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there.
        nu: Poisson's ratio.
        ratio: E/Y.
        hardening: Slope of the yield stress by the plastic strain over E.
        lift: Way out before they are pressed again [R].
        cycles: Unloadings by half of the way and loadings after that.
    """
    table = ((0.0, E / ratio), (1.0, E / ratio + hardening * E))
    s = _halves(comm, J2(E, nu, RHO, table), elements_per_radius)
    way = CONTACT_RADIUS**2 / RADIUS
    forces, energies = [], []

    def press(height, increments):
        drive(s, {"top": -height * UP}, increments)
        forces.append(float(low_load(s)[2]))
        energies.append(s.energies())

    press(way, 12.0)
    drive(s, {"top": lift * RADIUS * UP}, 6.0)
    press(lift * RADIUS, 24.0)
    for _ in range(cycles):
        drive(s, {"top": 0.5 * way * UP}, 6.0)
        press(0.5 * way, 8.0)
    first, again, *_ = energies
    results = {
        name: compare(again[key] / first[key], 1.0, 0.1)
        for name, key in (("work of dents", "plastic_dents"), ("all plastic work", "plastic"))
    }
    results["force"] = compare(forces[1] / forces[0], 1.0, 0.05)
    last, before = forces[-1] / forces[0], forces[-2] / forces[0]
    results["force after all cycles"] = compare(last, 1.0, math.inf)
    results["its change in the last cycle"] = compare(last - before, 0.0, math.inf, scale=1.0)
    return results, [s]


@case("closed-loop", num_bodies=2)
def closed_loop(comm, elements_per_radius=1.0, side=0.5, increments=10.0):
    """Elastic half balls without friction, drawn once round a hexagon, both ways.

    A force that is the gradient of an energy does no work in a loop. Here springs change where
    points pass to other facets: the same work is gained one way and lost the other, whatever the
    increments.

    Args:
        comm: MPI communicator.
        elements_per_radius: Contact radius over the length of edges there.
        side: Of the hexagon [edges].
        increments: For each side.
    """
    results, simulations, works = {}, [], []
    for name, turn in (("one way", 1.0), ("the other", -1.0)):
        s = _halves(comm, Elastic(E, 0.2, RHO), elements_per_radius)
        drive(s, {"top": -2.0 * CONTACT_RADIUS**2 / RADIUS * UP}, 10.0)
        start, place = s.energies(), np.zeros(3)
        angles = turn * np.arange(7) * math.pi / 3.0
        size = side * CONTACT_RADIUS / elements_per_radius
        corners = size * (np.outer(np.cos(angles), ALONG) + np.outer(np.sin(angles), ACROSS))
        for corner in [*corners, np.zeros(3)]:
            drive(s, {"top": corner - place}, increments)
            place = corner
        end = s.energies()
        stored = start["elastic"] + start["contact"]
        works.append((end["work"] - start["work"]) / stored)
        switched = (end["switching"] - start["switching"]) / stored
        results[f"{name}: work of the platen over the stored energy"] = compare(
            works[-1], 0.0, math.inf, scale=1.0
        )
        results[f"{name}: switching over it"] = compare(switched, 0.0, math.inf, scale=1.0)
        results[f"{name}: stored energy at the end over that of before"] = compare(
            (end["elastic"] + end["contact"]) / stored, 1.0, 1e-5
        )
        simulations.append(s)
    # A field of forces that hangs on the place alone.
    results["sum of both works"] = compare(sum(works), 0.0, 0.005, scale=1.0)
    return results, simulations
