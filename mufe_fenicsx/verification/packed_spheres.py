"""Packings of spheres by the rigid solver of `mufe pack`, against the known limits."""

import math

import numpy as np

from ..synthetic.rigid_packing.assembly import Assembly
from ..synthetic.rigid_packing.container import BOX, PERIODIC
from ..synthetic.rigid_packing.measures import measured
from ..synthetic.rigid_packing.shapes import ball
from ..synthetic.rigid_packing.start import column, loose
from ..synthetic.rigid_packing.ways import compress, settle
from ..synthetic.triangulated import icosphere
from .case import case, compare

#: Random close packing, and contacts of a sphere that holds it without friction.
CLOSE, ISOSTATIC = 0.64, 6.0


@case("packed-spheres", num_bodies=1)
def packed_spheres(comm, number=1000, friction=0.5, seed=1, heap=200):
    """Equal spheres packed at random: solid fraction and coordination, and a heap at rest.

    Compression is of a periodic cell: walls order the spheres beside them, up to some diameters
    deep, and with 1000 spheres no place is far from all of six walls. Coordination is that of
    spheres that bear. Without friction it is isostatic, 6, but for what the pressure adds; with
    friction between 4 and 5 at 0.5 (L. E. Silbert, Soft Matter 6, 2010, 2918-2924; with 0.3 it is
    4.5 at a solid fraction of 0.593: I. Agnolin & J.-N. Roux, Phys. Rev. E 76, 2007, 061302).

    Args:
        comm: MPI communicator.
        number: Spheres of the cell.
        friction: Coefficient of the second packing.
        seed: Of the random numbers.
        heap: Spheres that settle in a box under gravity.
    """
    close, loose_one = (_periodic(number, mu, seed) for mu in (0.0, friction))
    lines = {
        "solid fraction without friction": compare(close["solid_fraction"], CLOSE, 0.005, 1.0),
        "coordination without friction": compare(
            close["bearing_coordination_number"], ISOSTATIC, 0.2, 1.0
        ),
        "solid fraction with friction": compare(loose_one["solid_fraction"], 0.58, 0.03, 1.0),
        "coordination with friction": compare(
            loose_one["bearing_coordination_number"], 4.5, 0.5, 1.0
        ),
        "rattlers without friction": compare(close["rattlers"], 0.0, math.inf),
        "rattlers with friction": compare(loose_one["rattlers"], 0.0, math.inf),
        "fabric anisotropy without friction": compare(close["fabric_anisotropy"], 0.0, math.inf),
        "mean overlap over diameter": compare(close["mean_overlap"], 0.0, 1e-3, 1.0),
    }
    return lines | _heap(heap, friction, seed), []


def _periodic(number, friction, seed):
    """Numbers of a packing in a periodic cell."""
    shapes, rng = _spheres(), np.random.default_rng(seed)
    shape, size = np.zeros(number, dtype=np.int64), np.ones(number)
    bodies, cell = loose(shapes, shape, size, rng, PERIODIC, np.ones(3))
    assembly = Assembly(bodies, cell, friction, friction)
    compress(assembly)
    return measured(assembly)


def _heap(number, friction, seed):
    """Lines of spheres that settled in a box with a base of five diameters."""
    shapes, rng = _spheres(), np.random.default_rng(seed)
    shape, size = np.zeros(number, dtype=np.int64), np.ones(number)
    bodies, box = column(shapes, shape, size, rng, BOX, np.array([5.0, 5.0]))
    assembly = Assembly(bodies, box, friction, 0.0)
    settle(assembly)
    floor = assembly.contacts.wall_push[:, box.names.index("z_min")].sum()
    weight = assembly.gravity * bodies.mass.sum()
    energy = bodies.kinetic_energy / (weight / number)
    return {
        "heap: force on the floor over the weight": compare(floor / weight, 1.0, 1e-3),
        "heap: kinetic energy over the weight of a sphere times its diameter": compare(
            energy, 0.0, 1e-4, 1.0
        ),
        "heap: unbalanced force over those of contacts": compare(
            assembly.unbalanced, 0.0, 1e-3, 1.0
        ),
    }


def _spheres():
    points, triangles = icosphere(1)
    return ball((0.5 * points, triangles))
