"""Contact stiffness: what a stiff layer costs in time step, and a soft one in stiffness."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.laws import COMPLIANCE
from ...theory.stability import uniaxial_strain
from ..case import case, compare
from .limits import (
    SIZE,
    E,
    Snapshot,
    bisect,
    growth,
    highest_frequency,
    pressed_block,
)

#: Compliance of the layer, c in c h/E*.
LAYERS = (0.01, 0.03, 0.1, COMPLIANCE, 1.0, 3.0)


def penalty_map(comm, layers=LAYERS, trials=12):
    """One row for each compliance: limits of a pressed cube and its error of stiffness.

    Limits [s]: ``exact`` 2/ω of cube and springs, ``measured``, ``springs`` √2/ω of springs
    alone, ``light`` √2 √(m/k) of the node with the largest k/m (theory), ``program`` what it uses.
    ``soft``: loss of stiffness between the platens, and its theory 2 c h/L.
    """
    rows, simulations = [], []
    for c in layers:
        s = pressed_block(comm, compliance=c)
        stress = s.wall_forces().mean() / SIZE**2
        exact = 2.0 / highest_frequency(s)
        start = Snapshot(s)
        program = s.stable(0.0, s.stable.of_elements())  # of the springs that are closed
        measured = bisect(lambda f, s=s, a=start, e=exact: growth(s, a, f * e)[1], 0.5, 1.5, trials)
        contact = s.contact
        springs = contact.points.to_nodes(
            (contact.points.area / contact.points.layer)[:, None] * _active(contact)[:, None],
            contact.own.nodes.size,
        )[:, 0]
        mass = s.solid.mass[contact.own.nodes]
        # As large as that of the law: beside a strain of 0.001 the stiffest layer loses 0.01.
        strain = uniaxial_strain((s.walls.point[1, 2] - s.walls.point[0, 2]) / SIZE)
        # Facets of the same size on both faces; a platen has no layer.
        pressed = _active(contact)
        layer = np.average(contact.points.layer[pressed], weights=contact.points.area[pressed])
        rows.append(
            SimpleNamespace(
                c=c, exact=exact, measured=measured * exact, program=program,
                springs=math.sqrt(2.0) / highest_frequency(s, bulk=False),
                light=math.sqrt(2.0 / (springs / mass).max()),
                soft=1.0 - stress / (E * strain),
                soft_theory=1.0 - 1.0 / (1 + 2 * layer * E / SIZE),
            )
        )  # fmt: skip
        simulations.append(s)
    return rows, simulations


def _active(contact):
    """Whether each point is pressed on a platen, shape (num_points,)."""
    on = np.zeros(contact.points.num_points, dtype=bool)
    on[contact.walls.pairs.node[contact.walls.pairs.closed]] = True
    return on


@case("stability-penalty", num_bodies=1)
def penalty(comm, trials=10):
    """The stiffer the layer of contact, the shorter the step: as the root of its compliance.

    Args:
        comm: MPI communicator.
        trials: Bisections.
    """
    rows, simulations = penalty_map(comm, (0.01, COMPLIANCE, 1.0), trials)
    results = {}
    for row in rows:
        name = f"c = {row.c:g}"
        results[f"{name}: measured limit over 2/ω"] = compare(
            row.measured / row.exact, 1.0, 1.5 * 2.0**-trials + 5e-3
        )
        # Springs that act on three nodes at once are a little softer for each of them.
        results[f"{name}: step of the program over its limits"] = compare(
            row.program / min(row.exact, row.springs), 1.0, 0.03
        )
        # Even pressure, sharp vertices too shallow to carry; layers are no logarithm.
        results[f"{name}: loss of stiffness"] = compare(row.soft, row.soft_theory, 0.02)
    step = math.sqrt(rows[0].c / rows[1].c)
    results["springs: step falls as the root of c"] = compare(
        rows[0].springs / rows[1].springs, step, 0.01
    )
    return results, simulations
