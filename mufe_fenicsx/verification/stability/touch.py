"""First touch: what the energy balance misses when a tool meets a body at rest."""

import numpy as np

from ...bulk.tools import Tool
from ...geometry.bodies.shapes import box
from ...materials.elastic import Elastic
from ...run.energy_guard import EnergyGuard
from ...run.from_bodies import build
from ..case import case, compare
from .limits import NU, RHO, SIZE, E, message_of

#: Speed of the plate over that of waves, and gaps over the edge of the block, which settle where in
#: a step contacts close.
SPEED, GAPS = 1.5e-3, np.linspace(1.0e-3, 1.3e-3, 7)
#: Steps after the touch that are looked at.
AFTER = 30


def missing(comm, divisions, gap, factor=0.9):
    """A plate meets a free block at rest.

    Args:
        comm: MPI communicator of one rank.
        divisions: Bricks along its edges.
        gap: Between both at the start, over the edge.
        factor: Time step over its limit.

    Returns:
        Largest residual over M v²/2; what the program says, "" where it goes on; simulation.
    """
    edge, material = SIZE, Elastic(E, NU, RHO)
    speed = SPEED * material.wave_speed
    points, cells = box((2 * edge, 2 * edge, 0.4 * edge), (1, 1, 1), (-0.5 * edge, -0.5 * edge, 0))
    plate = Tool("plate", points + (1 + gap) * edge * np.eye(3)[2], cells, velocity=(0, 0, -speed))
    s = build(
        comm, [box((edge,) * 3, (divisions,) * 3)], material, np.zeros(3),
        np.full(3, edge), axes="", tools=[plate], time_step_factor=factor,
    )  # fmt: skip
    guard, worst, said = EnergyGuard(s, 0.1), 0.0, ""
    end = gap * edge / speed + AFTER * s.dt
    while s.state.t < end:
        s.step()
        energies = s.energies()
        worst = max(worst, abs(energies["residual"] + energies["switching"]))
        said = said or message_of(guard.check, energies, "at the touch")
    return worst / s.energy_of_touch(), said, s


@case("stability-touch", num_bodies=1)
def first_touch(comm, divisions=4):
    """A blow misses at most k (v Δt)²/8 for each node that it meets.

    With √(k/m) Δt of at most 0.9 √2 these are 0.405 of m v²/2. The nodes of a face have the part
    1/2n of the mass of a block of n bricks along each edge.

    Args:
        comm: MPI communicator.
        divisions: Bricks along the edges of the finest block; the others have 1 and 2.
    """
    results, simulations = {}, []
    for n, factor in ((1, 0.9), (1, 0.45), (2, 0.9), (divisions, 0.9)):
        found = [missing(comm, n, gap, factor) for gap in GAPS]
        simulations += [s for *_, s in found]
        worst, bound = max(one for one, *_ in found), 0.25 * 2 * factor**2 / (2 * n)
        name = f"{n}³ bricks, step {factor:g}"
        results[f"{name}: missing over M v²/2, at most"] = compare(max(worst, bound), bound, 0)
        results[f"{name}: missing over M v²/2"] = compare(worst, bound, np.inf)
        # Beyond the limit of 0.1 a run goes back and on with half the step.
        stops = sum(said != "" for _, said, _ in found)
        results[f"{name}: stops"] = compare(stops, 0, np.inf if worst > 0.1 else 0)
    return results, simulations
