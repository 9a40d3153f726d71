"""A grain a thousand times smaller than its neighbour: its step, and how deep it sinks."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.laws import COMPLIANCE, edge_of_area
from ...contact.start.overlap import DEEPEST
from ...contact.surface.points import RECESS
from ...contact.walls import Wall
from ...errors import SolverError
from ...explicit.simulation import Simulation
from ...geometry.bodies.shapes import box
from ...materials.elastic import Elastic
from ...run.from_bodies import distribute, drive
from ...theory.stability import swallowed_ratio
from ..case import case, compare
from .limits import NEVER, RHO, SIZE, E, Snapshot, bisect, growth, highest_frequency

MATERIAL = Elastic(E, 0.0, RHO)
SIZES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)


def press(comm, ratio, pressure=1e-2, divisions=2, refresh=20):
    """A cube on the middle of one ``ratio`` times as large, pressed with a pressure over E.

    Returns:
        Step of the program over its factor [s] (``step``), largest depth of the small one in the
        large one over the edge of its facets, theory at the pressure of the contact that was
        reached, words of the program, simulation.
    """
    large, large_cells = box((SIZE,) * 3, (2, 2, 2), (-0.5 * SIZE, -0.5 * SIZE, -SIZE))
    side = SIZE / ratio
    small, small_cells = box((side,) * 3, (divisions,) * 3)
    small -= [0.43 * side, 0.46 * side, 0.0]
    up = np.eye(3)[2]
    mesh = distribute(comm, [(large, large_cells), (small, small_cells)])
    walls = [
        Wall("base", -SIZE * up, up, bonded=True),
        Wall("platen", side * up, -up, bonded=True),
    ]
    transit = side / MATERIAL.wave_speed
    s = Simulation(
        mesh, [MATERIAL] * 2, walls, friction=0.0, damping=1.0 / transit, refresh=refresh
    )
    edges = [math.sqrt(4 / math.sqrt(3) * 0.5 * (a / divisions) ** 2) for a in (SIZE, side)]
    depth = _depth(s, pressure, edges, side)
    message = ""
    try:
        # What the small one gives way itself, and what it sinks in.
        drive(s, {"platen": -(depth + pressure * side) * up}, 40 * transit)
    except SolverError as error:
        message = str(error)
    p = s.contact.pairs
    depths = (p.offset - p.gap)[p.closed]
    deepest = float(depths.max(initial=0.0))
    # Not that of the platen, which works against the damping as well.
    force = float(p.stiffness[p.closed] @ depths) / (E * side**2)
    return SimpleNamespace(
        ratio=ratio, step=s.dt / s.time_step_factor, element=s.dt_element, depth=deepest / edges[1],
        theory=_depth(s, force, edges, side) / edges[1], pressure=force, message=message,
        simulation=s,
    )  # fmt: skip


def _depth(s, pressure, edges, side):
    """Depth [m] at which the springs below the small cube carry the pressure.

        p L² = Σ a (d - d0) E*/(c (h + H)):

    facets from the start, sharp vertices with their own area from ``RECESS`` on.
    """
    own = s.contact.own
    bottom = (s.mesh.grains[s.mesh.grain_of_node[own.nodes]] == 1) & (
        np.abs(s.mesh.x[own.nodes, 2]) < 1e-9 * side
    )
    x = s.mesh.x[own.nodes]
    rim = bottom & (
        np.isclose(x[:, 0], x[bottom, 0].min()) | np.isclose(x[:, 0], x[bottom, 0].max())
        | np.isclose(x[:, 1], x[bottom, 1].min()) | np.isclose(x[:, 1], x[bottom, 1].max())
    )  # fmt: skip
    of_rim = own.area[rim].sum()
    layer = COMPLIANCE * sum(edges) / MATERIAL.contact_modulus
    recess = RECESS * edges[1]
    depth = pressure * E * layer
    if depth <= recess:
        return depth
    return (pressure * E * layer * side**2 + of_rim * recess) / (side**2 + of_rim)


def size_map(comm, sizes=SIZES, pressure=1e-3):
    """:func:`press` for several ratios of size."""
    rows = [press(comm, ratio, pressure) for ratio in sizes]
    return rows, [row.simulation for row in rows]


def limit(comm, pressure=1e-2, trials=8):
    """Ratio of sizes at which the program stops; theory; simulations."""
    last = []

    def fails(ratio):
        found = press(comm, ratio, pressure)
        last.append(found.simulation)
        return bool(found.message)

    return bisect(fails, 10.0, 2000.0, trials), last


def limit_theory(comm, pressure=1e-2, divisions=2):
    """The same: facets from the start, sharp vertices with α times their area from ``RECESS`` on.

        d/h = (c (1 + r) p/E* + α RECESS)/(1 + α),  α = 1 - (n - 1)²/n² + 2/n

    below a cube of n bricks along an edge: nodes of the rim have a third of the facets around. The
    program stops where d, less what a vertex is recessed, is ``DEEPEST`` of the edge that goes
    with the area of that point: the corners with the fewest facets come first.
    """
    n = divisions
    rim = 1 - (n - 1) ** 2 / n**2 + 2 / n
    s = press(comm, 10.0, 1e-2, divisions).simulation  # deep enough for vertices
    pairs, points = s.contact.pairs, s.contact.points
    edge = edge_of_area(points.facet_area[pairs.node[pairs.closed]], 1)
    part = edge.min() / edge.max() * (DEEPEST + RECESS)
    facets = swallowed_ratio(pressure * E / MATERIAL.contact_modulus, COMPLIANCE, 1.0) + 1.0
    return (part * (1 + rim) - rim * RECESS) * facets - 1.0


def step_limits(row):
    """Limits of the step of a pressed cube, :func:`press`, times its ratio [s].

    Returns:
        ``alone``, 2/ω of tetrahedra alone; ``exact``, with the springs that are closed;
        ``measured``, by the growth of noise; ``closed``, the program's where it counts nothing
        but what is closed; ``step``, the program's, which counts what is near as closed.
    """
    s = row.simulation
    s.damping, s.limit.schedule.steps = 0.0, NEVER
    s.state.v[:] = 0.0
    alone, exact = (2.0 / highest_frequency(s, springs=springs) for springs in (False, True))
    start = Snapshot(s)
    measured = exact * bisect(lambda f: growth(s, start, f * exact)[1], 0.5, 1.5, 8)
    closed = s.limit.within(0.0, s.dt_element)
    found = {"alone": alone, "exact": exact, "measured": measured, "closed": closed,
             "step": row.step}  # fmt: skip
    return SimpleNamespace(**{name: value * row.ratio for name, value in found.items()})


@case("stability-size", num_bodies=1)
def unequal_size(comm, pressure=1e-3, trials=6):
    """A cube a thousand times smaller than its neighbour: the step falls as its size.

    And it sinks as deep as the layers of the large one's facets say.

    Args:
        comm: MPI communicator.
        pressure: On the small one, over E.
        trials: Bisections.
    """
    rows, simulations = size_map(comm, (10.0, 100.0, 1000.0), pressure)
    results = {}
    for row in rows:
        name, limits = f"{row.ratio:g} times smaller", step_limits(row)
        # Bisection to 1 %; springs of so soft layers add less than 1 % to the tetrahedra's.
        results[f"{name}: measured limit over that of the cube alone"] = compare(
            limits.measured / limits.alone, 1.0, 0.02
        )
        results[f"{name}: the program's, of what is closed, over 2/ω"] = compare(
            limits.closed / limits.exact, 1.0, 0.02
        )
        # What is near counts as closed: to the safe side.
        results[f"{name}: step of the program over the limit, at most 1"] = compare(
            max(limits.step / limits.measured, 1.0), 1.0, 0.0
        )
        # The deepest point beside the mean of all.
        results[f"{name}: depth over that of springs"] = compare(row.depth / row.theory, 1.0, 0.05)
    found, more = limit(comm, 1e-2, trials)
    # Bisection between 10 and 2000, and checks each 20 steps on the way.
    results["ten times the pressure: ratio at which the program stops, over theory"] = compare(
        found / limit_theory(comm, 1e-2), 1.0, 200 ** (0.5 / 2**trials) - 1 + 0.03
    )
    return results, [*simulations, *more]
