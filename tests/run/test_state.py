"""Everything that steps change comes back from a checkpoint: found by walking over all objects."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.geometry.grains import save_grains
from mufe_fenicsx.run.from_scene import load_mesh, make_simulation
from mufe_fenicsx.run.preparation import Prepared
from mufe_fenicsx.run.snapshot import restore, snapshot
from tests.bodies import RADIUS, packed_grains
from tests.run.test_checkpoint import scene

COMM = MPI.COMM_SELF

#: What may differ, by a part of its path, and why nothing hangs on it.
SCRATCH = {
    "limit.schedule._moved": "set when the limit is looked for, and read there alone",
    "limit.schedule._waited": "as the last",
    "motion.largest": "motion in a step: set in each before contact reads it",
    "motion._moves": "as the last",
    "contact.motion._step": "sent and received in each step",
    "contact.motion._previous": "measured from there only where motion is not known",
    "contact.motion._moves": "as contact.motion._step",
    "walls.near._moves": "set in each step",
    "positions.array": "points that no pair has stay where the last search found them",
    "stable._springs": "listed anew where the limit is looked for",
    "stable.rows._q": "room for products with the stiffness",
    "stable.rows._y": "as the last",
}


def walk(thing, path, found, seen):
    """All arrays and numbers that an object of this package holds, by their paths."""
    if isinstance(thing, np.ndarray):
        if thing.dtype != object and thing.dtype.names is None:  # whose views are there too
            found[path] = thing.copy()
    elif isinstance(thing, bool | int | float | np.generic):
        found[path] = np.asarray(thing)
    elif id(thing) in seen:
        return
    elif isinstance(thing, dict):
        seen.add(id(thing))
        for key, value in thing.items():
            walk(value, f"{path}[{key}]", found, seen)
    elif isinstance(thing, list | tuple):
        seen.add(id(thing))
        for key, value in enumerate(thing):
            walk(value, f"{path}[{key}]", found, seen)
    elif type(thing).__module__.startswith("mufe_fenicsx.kernels"):
        return  # addresses of arrays that others hold
    elif type(thing).__module__.startswith("mufe_fenicsx") and hasattr(thing, "__dict__"):
        seen.add(id(thing))
        for key, value in vars(thing).items():
            walk(value, f"{path}.{key}", found, seen)


def all_of(simulation):
    found = {}
    walk(simulation, "simulation", found, set())
    return found


@pytest.fixture
def made(tmp_path):
    """Makes the simulation of a scene with friction, yielding, rigid grains and a servo."""
    save_grains(tmp_path / "grains", packed_grains((2, 2, 2), h=0.7 * RADIUS))

    def make():
        mesh = load_mesh(COMM, tmp_path / "grains")
        simulation = make_simulation(scene(), Prepared.of(scene(), mesh))
        simulation.walls.velocity[simulation.walls.names.index("z_max"), 2] = -20.0
        return simulation

    return make


def test_all_that_changes_comes_back(made):
    one, other = made(), made()
    first = all_of(one)
    for _ in range(300):
        one.step(everywhere=False)
    one.complete()
    tables, own, common = snapshot(one)
    then = all_of(one)
    changed = {
        path
        for path in then
        if path not in first or not np.array_equal(first[path], then[path], equal_nan=True)
    }
    assert len(changed) > 100
    restored = {}
    for name, table in tables.items():
        restored[name] = {
            key: np.concatenate([*column.blocks(1000)]) if hasattr(column, "blocks") else column
            for key, column in table.items()
        }
    restore(other, restored, own, common)
    # Energies without a step between: what pairs have of their points is there.
    assert other.contact.energy() == one.contact.energy()
    assert other.contact.energy()[0] > 0.0
    one.contact.bind()  # new pairs of its last search, if any
    then = all_of(one)
    now = all_of(other)
    lost = [
        path
        for path in sorted(then.keys() | now.keys())
        if path not in now
        or path not in then
        or not np.array_equal(then[path], now[path], equal_nan=True)
    ]
    lost = [path for path in lost if not any(part in path for part in SCRATCH)]
    assert not lost, "\n".join(lost)
