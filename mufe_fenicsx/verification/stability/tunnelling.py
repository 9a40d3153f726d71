"""Fast impact: blocks that press no harder, sink into each other and are noticed."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.laws import COMPLIANCE, LARGEST_DEPTH, edge_of_area
from ...contact.start.overlap import DEEPEST
from ...contact.walls import Wall
from ...errors import SolverError
from ...explicit.simulation import Simulation
from ...geometry.bodies.shapes import box
from ...materials.elastic import Elastic
from ...run.from_bodies import axis_planes, distribute
from ...theory.stability import sealed_speed, sinking_speed
from ..case import case, compare
from .limits import RHO, SIZE, E, bisect

#: ν = 0: plane waves in a bar without sides held are those of E.
MATERIAL = Elastic(E, 0.0, RHO)


def meet(comm, speed, divisions=(4, 4, 12), compliance=COMPLIANCE, travel=2.5):
    """Two bars meet end to end at a relative speed over that of waves.

    Mirrors on all sides make them parts of two plates as wide as you like: waves are plane, and
    there are no rims.

    Returns:
        Largest depth over the mean edge of facets; relative speed afterwards over that before (1:
        passed through, -1: bounced); the words of the program, if it stops; simulation.
    """
    side = SIZE
    length = SIZE * divisions[2] / divisions[0]
    points, cells = box((side, side, length), divisions)
    gap = 1e-3 * SIZE
    # The other one's diagonals run across.
    across = points * [-1.0, 1.0, 1.0] + [side, 0, gap]
    bodies = [(points - [0, 0, length], cells), (across, cells[:, [1, 0, 2, 3]])]
    mesh = distribute(comm, bodies)
    sign = np.where(mesh.grains[mesh.grain_of_node] == 1, -1.0, 1.0)
    v = 0.5 * speed * MATERIAL.wave_speed
    velocity = np.zeros_like(mesh.x)
    velocity[:, 2] = sign * v
    planes = axis_planes(np.zeros(3), np.full(3, side), "xy")
    walls = [Wall(name, *plane, mirror=True) for name, plane in planes.items()]
    s = Simulation(
        mesh, [MATERIAL] * mesh.num_grains, walls, velocity=velocity, compliance=compliance,
        refresh=20,
    )  # fmt: skip
    end = gap / (2 * v) + travel * length / MATERIAL.wave_speed
    deepest, message = 0.0, ""
    mass = s.solid.mass[:, None]
    try:
        while s.state.t < end:
            s.step()
            p = s.contact.pairs
            if p.closed.any():
                deepest = max(deepest, float((p.offset - p.gap)[p.closed].max()))
    except SolverError as error:
        message = str(error)
    momentum = [
        (mass * s.state.v)[sign == k].sum(axis=0)[2] / mass[sign == k].sum() for k in (1.0, -1.0)
    ]
    return SimpleNamespace(
        speed=speed, deepest=deepest / s.contact.edge,
        after=(momentum[0] - momentum[1]) / (2 * v), message=message, simulation=s,
        residual=s.energies()["residual"] / s.initial_kinetic if not message else math.nan,
    )  # fmt: skip


#: Long bars, so that sinking has the time to show.
LONG = (4, 4, 32)


def theory(compliance=COMPLIANCE):
    """Speed over that of waves at which the force of the facets is just enough.

    Facets are alike all over the ends, so that the mean edge is that of those that meet.
    """
    return sealed_speed(0.5 * LARGEST_DEPTH / compliance * MATERIAL.contact_modulus / E)


def stops_theory(compliance=COMPLIANCE, divisions=LONG):
    """Speed over that of waves at which bars sink ``DEEPEST`` edges while they meet."""
    edge = edge_of_area(0.5 / divisions[0] ** 2, 1)  # of the bars' width
    length = divisions[2] / divisions[0] / edge
    return sinking_speed(theory(compliance), compliance, LARGEST_DEPTH, DEEPEST, length)


def limit(comm, compliance=COMPLIANCE, trials=8):
    """Speed over that of waves at which the program stops long bars: measured, simulations."""
    last = []
    expected = stops_theory(compliance)

    def fails(part):
        found = meet(comm, part * expected, LONG, compliance, travel=1.9)
        last.append(found.simulation)
        return bool(found.message)

    return bisect(fails, 0.5, 2.0, trials) * expected, last


@case("stability-impact", num_bodies=1)
def fast_impact(comm, trials=7):
    """Blocks that meet at 0.4 of the speed of waves press as hard as contact can; faster ones sink.

    Args:
        comm: MPI communicator.
        trials: Bisections.
    """
    results, simulations = {}, []
    for compliance in (COMPLIANCE, 0.5):
        measured, more = limit(comm, compliance, trials)
        simulations += more
        # Plane waves but for the width of fronts, which an element or two are wide.
        results[f"c = {compliance:g}: speed at which bars sink, over theory"] = compare(
            measured / stops_theory(compliance), 1.0, 0.05
        )
    slow, fast = meet(comm, 0.1), meet(comm, 1.6)
    results["slow: relative speed afterwards over that before"] = compare(slow.after, -1.0, 0.1)
    results["slow: the program is content"] = compare(float(bool(slow.message)), 0.0, 0.0, 1.0)
    results["fast: the program says so"] = compare(float(bool(fast.message)), 1.0, 0.0)
    return results, [*simulations, slow.simulation, fast.simulation]
