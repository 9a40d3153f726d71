"""Balls of four sizes between platens: the strengths that they are given come back."""

from dataclasses import replace

import numpy as np

from ..calibration.weibull import fit_weibull
from ..materials.fracture import Fracture
from .ball_crushing import flattened_ball
from .brazilian_disc import STRENGTH, E, between_platens
from .case import case, compare

SMALLEST = 0.25e-3
#: β and μ; of all motion, in passes of a wave through a ball.
SHEAR_RATIO, FRICTION, DAMPING = 3.0, 1.0, 0.2
#: Steps from one look at the force to the next; a ball is broken where it has fallen to this part
#: of the largest; passes of a wave after which it has to be.
EVERY, FALLEN, LATEST = 10, 0.8, 200.0


@case("crushing-strengths", num_bodies=1)
def crushing_strengths(
    comm, number=30, sizes=4, modulus=5.0, edges=4, flat=25.0, zone=0.2, speed=0.4, seed=1
):  # fmt: skip
    """Balls whose strengths scatter by Weibull's law, each size twice as large as the one before.

    All have the same coarse mesh. Forces over d² scatter as the strengths drawn; their mean falls
    as d^(-3/m), as volumes have it. That is the limit of a short cohesive zone: the longer it is,
    the more the fracture energy decides, which does not scatter.

    Args:
        comm: MPI communicator.
        number: Balls of a size.
        sizes: How many.
        modulus: m.
        edges: Along a diameter.
        flat: Half of the angle of each flat [degrees].
        zone: E G/σ² over the diameter of the smallest, whose volume has σ.
        speed: Of the platens towards each other, over c σ/E.
        seed: Of the first ball; each has the next one.

    Source: G. R. McDowell, M. D. Bolton, Géotechnique 48, 1998, 667-679.
    """
    points, cells = flattened_ball(2.0 / edges, np.radians(flat), 0.0)
    law = Fracture(
        STRENGTH, zone * SMALLEST * STRENGTH**2 / E, SHEAR_RATIO, FRICTION, modulus,
        np.pi / 6.0 * SMALLEST**3, "grain",
    )  # fmt: skip
    diameters = SMALLEST * 2.0 ** np.arange(sizes)
    found, simulations = np.empty((sizes, number, 2)), []
    for k, i in np.ndindex(sizes, number):
        own = replace(law, seed=seed + number * k + i)
        body = 0.5 * diameters[k] * points, cells
        *found[k, i], s = crush(comm, body, diameters[k], own, speed)
        simulations.append(s)
    strengths, drawn = np.moveaxis(found, 2, 0)
    same = np.ones(number)
    m, given = (
        np.mean([fit_weibull(some, same).modulus for some in of]) for of in (strengths, drawn)
    )
    slope = np.polyfit(np.log(diameters), np.log(strengths).mean(axis=1), 1)[0]
    over = strengths / drawn
    results = {
        "m of forces over that of the strengths drawn": compare(m / given, 1.0, 0.1),
        # Of 120 strengths m is known to 0.78/√120 = 7 %: of that of seeds the first line is free.
        "m of forces over that put in": compare(m / modulus, 1.0, np.inf),
        "exponent of the size over -3/m": compare(-slope * modulus / 3.0, 1.0, 0.1),
        "force over d² and the strength drawn": compare(over.mean(), 1.0, np.inf),
        "scatter of that": compare(over.std() / over.mean(), 0.0, np.inf),
    }
    return results, simulations


def crush(comm, body, diameter, fracture, speed):
    """Crush a ball.

    Returns:
        First peak of the force over the diameter squared [Pa], the strength drawn [Pa] and the
        simulation.
    """
    s, cracks, passes = between_platens(comm, body, diameter, fracture, speed, DAMPING)
    peak = force = 0.0
    while force >= FALLEN * peak:
        s.step(everywhere=False)
        if s.state.num_steps % EVERY == 0:
            force = s.wall_forces().mean()
            peak = max(peak, force)
        if s.state.t > LATEST * passes:
            raise RuntimeError(f"a ball bears {force:.3g} N on, expected that it breaks")
    return peak / diameter**2, cracks.drawn()[0], s
