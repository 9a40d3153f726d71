"""Forces between nodes of several ranks: the bonds of docs/howto/extending.md."""

import re
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.run.snapshot import restore, snapshot
from mufe_fenicsx.state import ForceTerm

COMM = MPI.COMM_WORLD
SIDE = 1e-3
PAGE = Path(__file__).parents[2] / "docs" / "howto" / "extending.md"


def bonds_of_the_page():
    """The class that the page shows."""
    (block,) = re.findall(r"```python\n(from scipy[^`]*class Bonds[^`]*)```", PAGE.read_text())
    assert block.count("\n") < 80
    names = {"np": np, "ForceTerm": ForceTerm}
    exec(block, names)
    return names["Bonds"]


def column(comm, speed, longest=1e-4, k=1e6):
    """Three cubes on each other, bonded, whose ends part at ``speed`` [m/s] each."""
    points, cells = box((SIDE,) * 3, (2, 2, 2))
    bodies = [(points + np.array([0.0, 0.0, i * SIDE]), cells) for i in range(3)]

    def velocity(x, grain):
        return np.outer(speed * (x[:, 2] / SIDE - 1.5) * (0.5 + x[:, 0] / SIDE), [0.0, 0.0, 1.0])

    s = build(comm, bodies, Elastic(1e9, 0.15, 2500.0), (0, 0, 0), (0, 0, 0), "", velocity=velocity)
    s.add_term(bonds_of_the_page()(s.mesh, k, longest))
    s.update_time_step()
    return s


def heights(s):
    """Of all nodes of the column, in an order that knows no ranks [m]."""
    s.complete()
    found = COMM.allgather((s.mesh.x[s.mesh.named_nodes], s.state.x[s.mesh.named_nodes]))
    first, now = map(np.concatenate, zip(*found, strict=True))
    return now[np.lexsort(np.round(first / SIDE, 3).T), 2]


@pytest.mark.mpi
def test_bonds_hold_bodies_of_several_ranks():
    """As on one rank; momentum stays, and energy, that of bonds among it."""
    s, alone = column(COMM, 1.0), column(MPI.COMM_SELF, 1.0)
    free = column(COMM, 1.0, k=1.0)
    assert s.dt < 0.9 * free.dt
    for one in (s, alone, free):
        one.dt = min(s.dt, alone.dt)
    momentum = COMM.allreduce(s.solid.mass @ s.state.v)
    for _ in range(120):
        for one in (s, alone):
            one.step()
    e = s.energies()
    assert e["energy_bonds"] > 0.05 * e["kinetic"]
    assert abs(e["residual"]) < 1e-3 * (e["kinetic"] + e["energy_bonds"])
    s.complete()
    momentum -= COMM.allreduce(s.solid.mass @ s.state.v)
    assert np.abs(momentum).max() < 1e-12 * COMM.allreduce(s.solid.mass.sum())
    alone.complete()
    of_one = alone.state.x[alone.mesh.named_nodes]
    order = np.lexsort(np.round(alone.mesh.x[alone.mesh.named_nodes] / SIDE, 3).T)
    np.testing.assert_allclose(heights(s), of_one[order, 2], rtol=1e-12)


@pytest.mark.mpi
def test_broken_bonds_take_what_breaks_them():
    s = column(COMM, 20.0, longest=1e-6)
    for _ in range(200):
        s.step()
    (term,) = s.specimen.added_terms
    whole, num = COMM.allreduce(np.array([term.bonds["whole"].sum(), term.bonds["whole"].size]))
    assert num == 18 and whole == 0
    e = s.energies()
    assert e["energy_bonds"] == pytest.approx(num * 0.5 * 1e6 * 1e-6**2, rel=1e-12)
    # Each breaks at the end of a step, a little longer than its limit.
    assert abs(e["residual"]) < 0.2 * e["energy_bonds"]


@pytest.mark.mpi
def test_bonds_go_on_from_a_checkpoint():
    s, other = column(COMM, 6.0, longest=2e-6), column(COMM, 6.0, longest=2e-6)
    whole = 18
    while whole == 18:
        s.step()
        whole = COMM.allreduce(int(s.specimen.added_terms[0].bonds["whole"].sum()))
        assert s.state.num_steps < 300
    assert whole > 0
    tables, own, common = snapshot(s)
    kept = {
        name: {
            key: np.concatenate([*column.blocks(1000)]) if hasattr(column, "blocks") else column
            for key, column in table.items()
        }
        for name, table in tables.items()
    }
    restore(other, kept, own, common)
    for one in (s, other):
        for _ in range(30):
            one.step()
        one.complete()
    assert np.array_equal(s.state.x, other.state.x)
    assert s.energies()["energy_bonds"] == other.energies()["energy_bonds"]
