"""A packing at rest under a load, for a million steps: drift of energies and forces."""

import math
from types import SimpleNamespace

import numpy as np

from ...contact.separation import separate
from ...contact.walls import Wall
from ...explicit.simulation import Simulation
from ...materials.sand import SAND
from ...run.from_bodies import axis_planes, build, drive, settle
from ..case import case, compare
from ..fidelity import lattice

#: Of the platen while it loads and of the record while it rests.
STRAIN, RECORDS = 0.04, 500
EPS = np.finfo(float).eps


def loaded_packing(comm, counts=(2, 2, 2), element_size=0.6, friction=0.3):
    """Balls in a box that yield at their contacts, pressed by ``STRAIN`` from all sides."""
    bodies = lattice(counts, element_size)[: math.prod(counts)]
    mesh = build(comm, bodies, SAND, np.zeros(3), np.zeros(3), axes="").mesh
    separate(mesh, 0.3)
    low, high = mesh.x.min(axis=0), mesh.x.max(axis=0)
    walls = [
        Wall(name, *plane, friction=friction) for name, plane in axis_planes(low, high).items()
    ]
    height = (high - low)[2]
    transit = height / SAND.wave_speed
    s = Simulation(mesh, [SAND] * mesh.num_grains, walls, friction=friction, damping=1.0 / transit)
    # From all sides: pressed from above alone, columns of balls buckle.
    moves = {
        f"{axis}_max": -STRAIN * height * unit for axis, unit in zip("xyz", np.eye(3), strict=True)
    }
    drive(s, moves, 300 * transit)
    s.walls.velocity[:] = 0.0
    settle(s, 1e-20)
    s.damping = 0.0
    return s


def rest(comm, num_steps=1_000_000, records=RECORDS):
    """What changes while the packing rests, without damping; of one rank.

    Args:
        comm: MPI communicator.
        num_steps: Time steps.
        records: Rows, evenly.

    Returns:
        Steps; difference of the sum of all energies from the first over the stored ones;
        kinetic over stored energy; largest change of a wall's force over the platen's;
        largest way of a node over the mean edge of facets; contacts; simulation.
    """
    s = loaded_packing(comm)
    first, x0 = s.energies(), s.state.x.copy()
    stored = first["elastic"] + first["contact"]
    forces0, contacts0 = s.wall_forces(), s.num_contacts
    every, start, rows = max(num_steps // records, 1), s.state.num_steps, []
    while s.state.num_steps - start < num_steps:
        s.step(everywhere=False)
        if (s.state.num_steps - start) % every == 0:
            e = s.energies()
            rows.append(
                (
                    s.state.num_steps - start, (e["residual"] - first["residual"]) / stored,
                    e["kinetic"] / stored,
                    np.abs(s.wall_forces() - forces0).max() / forces0[-1],
                    np.linalg.norm(s.state.x - x0, axis=1).max() / s.contact.edge,
                )
            )  # fmt: skip
    step, energy, kinetic, force, way = np.array(rows).T
    return SimpleNamespace(
        step=step, energy=energy, kinetic=kinetic, force=force, way=way,
        num_contacts=contacts0, change_of_contacts=s.num_contacts - contacts0,
        load=float(forces0[-1]), residual=first["residual"] / first["work"],
        friction=(s.energies()["friction"] - first["friction"]) / stored,
        num_cells=s.mesh.num_cells, simulation=s,
    )  # fmt: skip


@case("stability-resting", num_bodies=1)
def resting(comm, steps=100_000):
    """Eight yielding balls at rest under a platen, without damping: nothing creeps in.

    Args:
        comm: MPI communicator.
        steps: Time steps.
    """
    found = rest(comm, steps, 100)
    results = {
        # Rounding of positions, ε L, is forces that are off by E ε L h: each step adds at most
        # that, all of one sign; in a lattice of many it wanders as the root instead.
        "energy from nowhere over what is stored": compare(
            np.abs(found.energy).max(), 0.0, steps * EPS, scale=1.0
        ),
        "change of the forces on walls over the platen's": compare(
            found.force.max(), 0.0, 1e-6, scale=1.0
        ),
        "change of the number of contacts": compare(found.change_of_contacts, 0.0, 0.0, scale=1.0),
    }
    return results, [found.simulation]
