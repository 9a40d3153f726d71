"""What contact with a curved wall costs, beside a plane with as many contacts."""

import statistics
from functools import partial

import numpy as np

from .launch import case_of, launch, row, seconds_each

#: Largest time of a cylinder over that of a plane.
TARGET = 1.1
#: Radius of the cylinder over the edge of the slab: so large that all of the slab touches it.
FLAT = 1e6


def pressed_slabs(comm, *, divisions=60, calls=20, repeats=41):
    """A slab that rubs on a plane, and one on a cylinder that is nearly one, by turns. Local.

    Args:
        divisions: Cubes along the edges of the slabs, one across.
        calls: Evaluations of the forces in one measurement.
        repeats: Measurements of each.

    Returns:
        dict by wall: number of closed points, median time of an evaluation [s].
    """
    slabs = {name: _slab(comm, int(divisions), name) for name in ("plane", "cylinder")}
    spent = {name: [] for name in slabs}
    for _ in range(int(repeats)):
        for name, simulation in slabs.items():
            walls = simulation.contact.walls
            spent[name].append(seconds_each(int(calls), partial(walls.add_forces, False)))
    return {
        name: {"closed": int(slabs[name].contact.walls.pairs.closed.sum()),
               "seconds": statistics.median(spent[name])}
        for name in slabs
    }  # fmt: skip


def _slab(comm, divisions, name):
    """A slab on a wall at z = 0, pressed and drawn along it."""
    from ...contact.walls import Wall
    from ...geometry.bodies.shapes import box
    from ...materials.elastic import Elastic
    from ...run.from_bodies import build

    size = np.array([1.0, 1.0, 1.0 / divisions])
    body = box(size, (divisions, divisions, 1), -0.5 * size * [1.0, 1.0, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    wall = Wall("wall", np.zeros(3), up, friction=0.3)
    if name == "cylinder":
        wall = Wall("wall", FLAT * up, np.array([1.0, 0.0, 0.0]), friction=0.3, radius=FLAT)
    simulation = build(
        comm, [body], Elastic(1e9, 0.2, 2650.0), -size, size, "", walls=[wall],
        velocity=lambda x, grain: np.broadcast_to([1.0, 0.0, -10.0], x.shape),
    )  # fmt: skip
    for _ in range(5):
        simulation.step()
    return simulation


def curved_walls(parameters):
    """Forces of a cylinder's side against those of a plane, by turns on one rank.

    Parameters: ``divisions``, ``calls``, ``repeats``.
    """
    found = launch("pressed_slabs", parameters, 1)
    plane, cylinder = found["plane"], found["cylinder"]
    part = cylinder["seconds"] / plane["seconds"]
    results = {
        "closed_plane": {"computed": plane["closed"]},
        "closed_cylinder": {"computed": cylinder["closed"]},
        "plane_s": {"computed": plane["seconds"]},
        "cylinder_s": {"computed": cylinder["seconds"]},
        "cylinder_over_plane": row(part, TARGET, part <= TARGET),
    }
    return case_of("curved-walls", parameters, results)
