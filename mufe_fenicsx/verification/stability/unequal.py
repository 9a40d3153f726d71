"""A grain a thousand times smaller than its neighbour: its step, and how deep it sinks."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.laws import COMPLIANCE
from ...contact.points import RECESS
from ...contact.walls import Wall
from ...errors import SolverError
from ...geometry.shapes import box
from ...materials.elastic import Elastic
from ...simulation import Simulation
from ...theory.stability import swallowed_ratio
from ..build import distribute, drive
from ..case import case, compare
from .limits import RHO, SIZE, E, bisect

MATERIAL = Elastic(E, 0.0, RHO)
SIZES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)


def press(comm, ratio, pressure=1e-2, divisions=2, refresh=20):
    """A cube on the middle of one ``ratio`` times as large, pressed with a pressure over E.

    Returns:
        Step of the program [s], largest depth of the small one in the large one over the edge of
        its facets, theory at the pressure that was reached, words of the program, simulation.
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
    deepest = float((p.offset - p.gap)[p.closed].max(initial=0.0))
    force = abs(float(s.walls.force[1, 2])) / (E * side**2)
    return SimpleNamespace(
        ratio=ratio, step=s.dt, element=s.dt_element, depth=deepest / edges[1],
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


def limit_theory(pressure=1e-2, divisions=2, part=0.5):
    """The same: facets from the start, sharp vertices with α times their area from ``RECESS`` on.

        d/h = (c (1 + r) p/E* + α RECESS)/(1 + α),  α = 1 - (n - 1)²/n² + 2/n

    below a cube of n bricks along an edge: nodes of the rim have a third of the facets around.
    """
    n = divisions
    rim = 1 - (n - 1) ** 2 / n**2 + 2 / n
    facets = swallowed_ratio(pressure * E / MATERIAL.contact_modulus, COMPLIANCE, 1.0) + 1.0
    return (part * (1 + rim) - rim * RECESS) * facets - 1.0


@case("stability-size", num_bodies=1)
def unequal_size(comm, pressure=1e-3):
    """A cube a thousand times smaller than its neighbour: the step falls as its size.

    And it sinks as deep as the layers of the large one's facets say.

    Args:
        comm: MPI communicator.
        pressure: On the small one, over E.
    """
    rows, simulations = size_map(comm, (10.0, 100.0, 1000.0), pressure)
    results = {}
    for row in rows[1:]:
        name = f"{row.ratio:g} times smaller"
        # Deeper, sharp vertices carry too: their springs ask for up to 40 % less.
        results[f"{name}: step times the ratio, over that of 10"] = compare(
            row.step * row.ratio / (rows[0].step * 10), 1.0, 0.4
        )
        # The deepest point beside the mean of all.
        results[f"{name}: depth over that of springs"] = compare(row.depth / row.theory, 1.0, 0.15)
    deep = press(comm, 1000.0, 1e-2)
    results["1000 times smaller, ten times the pressure: the program says so"] = compare(
        float(bool(deep.message)), 1.0, 0.0
    )
    return results, [*simulations, deep.simulation]
