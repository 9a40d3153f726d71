"""A block whose facets have all lost a part of their stiffness, in thermal motion."""

import numpy as np

from ..bulk.cracks.cracks import Cracks
from ..geometry.bodies.shapes import box
from ..materials.elastic import Elastic
from ..materials.fracture import Fracture
from ..run.from_bodies import build
from .case import at_least, case, compare

E, NU, RHO, EDGE, STRENGTH = 100e9, 0.2, 2650.0, 1e-4, 100e6
#: Speeds of the motion over σ/√(E ρ): no facet opens as far as it was.
MOTION = 0.05
#: Of the first steps, after which the energy is that of the start for the judgement.
LOOKS = 20


@case("damaged-block", num_bodies=1)
def damaged_block(
    comm, cubes=5, share=0.75, steps=100_000, damage_from=0.2, damage_to=0.95, factor=0.9,
    damping=0.07, undamped_steps=20_000, friction=0.0,
):  # fmt: skip
    """Facets that have softened open and close all the time, and no energy comes of it.

    Where a damaged facet closes its stiffness changes. Central differences gain energy from that
    kink at any step, exponentially, unless a dashpot takes it. The block shows both: with the
    dashpot no growth, and without it growth.

    Args:
        comm: MPI communicator.
        cubes: Along each side of the block, of six tetrahedra.
        share: Of the facets, which are opened.
        steps: Time steps with the dashpot.
        damage_from, damage_to: Part of their stiffness that facets have lost.
        factor: Time step over the limit of stability.
        damping: Over the critical one.
        undamped_steps: Time steps without the dashpot.
        friction: Of facets that are pressed; it damps, so that nothing need grow without a dashpot.
    """
    lost = damage_from, damage_to
    s, block = block_in_motion(comm, cubes, share, lost, factor, damping, friction)
    energies = course_of_energies(s, steps)
    free, _ = block_in_motion(comm, cubes, share, lost, factor, 0.0, friction)
    wild = course_of_energies(free, undamped_steps)
    results = {
        "largest energy over that of the start": compare(
            max(energies.max() / energies[0] - 1.0, 0.0), 0.0, 1e-6, scale=1.0
        ),
        # The rest is that of motion as a whole, and round-off.
        "energy at the end over that half way": compare(
            max(energies[-1] / energies[LOOKS // 2] - 1.0, 0.0), 0.0, 1e-6, scale=1.0
        ),
        "without a dashpot: energy over that of the start": at_least(
            wild[-1] / wild[0], 0.0 if friction else 1.05
        ),
        "facets": compare(block.opened.size, 0.0, np.inf),
    }
    return results, [s, free]


def block_in_motion(comm, cubes, share, lost, factor, damping, friction=0.0):
    """A simulation in motion whose opened facets have lost a part of their stiffness."""
    random = np.random.default_rng(1)
    s = build(
        comm, [box((cubes * EDGE,) * 3, (cubes,) * 3)], Elastic(E, NU, RHO), (0, 0, 0), (0, 0, 0),
        axes="", time_step_factor=factor,
    )  # fmt: skip
    energy = 3.0 * EDGE * STRENGTH**2 / E
    block = Cracks(s.specimen, Fracture(STRENGTH, energy, friction=friction, damping=damping))
    s.add_term(block)
    s.step()
    s.grow(block.declare_open(np.flatnonzero(random.random(block.strength.size) < share)))
    p = block.points
    slope = p["strength"] / p["ultimate"]
    left = p["stiffness"] * (1.0 - random.uniform(*lost, p.shape))
    first = p["strength"] / p["stiffness"]
    # T(D)/D is what is left of the stiffness.
    p["furthest"] = (p["strength"] + slope * first) / (left + slope)
    v, mass = random.normal(size=s.state.v.shape), s.solid.mass
    s.state.v[:] = MOTION * STRENGTH / np.sqrt(E * RHO) * (v - mass @ v / mass.sum())
    s.update_time_step()
    return s, block


def course_of_energies(s, steps):
    """Energies that can come back, of the start and of ``LOOKS`` times [J]."""
    found = []
    for k in range(LOOKS + 1):
        while s.state.num_steps - 1 < k * steps // LOOKS:
            s.step(everywhere=False)
        e = s.energies()
        found.append(e["kinetic"] + e["elastic"] + e["cracks_stored"] + e["cracks_opening"])
    return np.array(found)
