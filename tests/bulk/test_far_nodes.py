"""Forces between nodes of several ranks: the bonds of docs/howto/extending.md."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.machine.mpi_launcher import environment_without_launcher, find_mpirun
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
    # Each breaks at the end of a step, in which ends may part by twice its limit.
    assert e["energy_bonds"] == pytest.approx(num * 0.5 * 1e6 * 1e-6**2, rel=0.7)
    # The target of the energy balance, of the kinetic energy at the start.
    assert abs(e["residual"]) < 1e-3 * COMM.allreduce(s.specimen.initial_kinetic)


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


def test_static_increments_refuse_springs_without_stiffness():
    points, cells = box((SIDE,) * 3, (1, 1, 1))
    bodies = [(points, cells), (points + np.array([0.0, 0.0, SIDE]), cells)]
    rock = Elastic(1e9, 0.15, 2500.0)
    s = build(MPI.COMM_SELF, bodies, rock, (0, 0, 0), (0, 0, 0), "", increment=1e-3)
    s.add_term(bonds_of_the_page()(s.mesh, 1e6, 1e-4))
    with pytest.raises(InputError, match="force term bonds has springs alone"):
        s.step()


ALONE = """
from mpi4py import MPI
import numpy as np
import mufe_fenicsx.bulk.added_term as added
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.machine.mpi_launcher import environment_without_launcher, find_mpirun
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.state import ForceTerm

added.PATIENCE = 0.5


class Bad(ForceTerm):
    name, calls = "bad", 0

    def add_forces(self, f, state, dt):
        self.calls += 1
        if MPI.COMM_WORLD.rank == 1 and self.calls == 4:
            raise ValueError("my own mistake")


points, cells = box((1e-3,) * 3, (1, 1, 1))
bodies = [(points, cells), (points + np.array([0.0, 0.0, 1e-3]), cells)]
s = build(MPI.COMM_WORLD, bodies, Elastic(1e9, 0.1, 2500.0), (0, 0, 0), (0, 0, 0), "")
s.add_term(Bad())
for _ in range(9):
    s.step()
"""


def test_a_term_that_fails_on_one_rank_ends_all(tmp_path):
    (tmp_path / "alone.py").write_text(ALONE)
    done = subprocess.run(
        [find_mpirun(), "-n", "2", sys.executable, "alone.py"], cwd=tmp_path,
        env=environment_without_launcher(), capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode != 0 and "force term bad (Bad) fails: ValueError" in done.stderr
