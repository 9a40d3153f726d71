"""Facets from other ranks: all that are near, and few that are not."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.contact import Contact
from mufe_fenicsx.contact.settings import ContactGrains, ContactSettings
from mufe_fenicsx.contact.snapshot import contact_tables
from mufe_fenicsx.contact.surface.active_nodes import nodes_of_pairs
from mufe_fenicsx.contact.surface.occupancy import Cells, occupied_cells
from mufe_fenicsx.contact.walls import Walls
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.run.from_bodies import distribute
from tests.bodies import sphere


def test_cells_find_all_boxes_within_reach_and_none_a_cell_farther_away():
    rng = np.random.default_rng(2)
    low = rng.random((300, 3)) * [1.0, 1.0, 0.5]
    other_low = rng.random((2000, 3)) * [1.0, 1.0, 0.6] + [0.2, -0.3, 0.3]
    high, other_high = (v + 0.05 * rng.random(v.shape) for v in (low, other_low))
    reach = 0.03
    cells = occupied_cells(low, high)
    part = cells.within(other_low.min(axis=0) - reach, other_high.max(axis=0) + reach)
    assert part.full.size < 0.8 * cells.full.size
    near = Cells.unpacked(part.packed()).near(other_low, other_high, reach)
    apart = np.maximum(other_low[:, None] - high, low - other_high[:, None])
    apart = apart.max(axis=2).min(axis=1)
    close, distant = apart <= reach, apart > reach + cells.size
    assert near[close].all() and not near[distant].any()
    assert close.sum() > 100 and distant.sum() > 100


def test_a_rank_without_facets_in_anothers_box_tells_of_no_cells():
    none = occupied_cells(np.empty((0, 3)), np.empty((0, 3)))
    part = Cells.unpacked(none.within(np.zeros(3), np.ones(3)).packed())
    assert not part.near(np.zeros((4, 3)), np.ones((4, 3)), 0.1).any()


def heap():
    """Bricks and balls in any position, near each other or a little in each other."""
    rng = np.random.default_rng(4)
    kinds = box((1.0, 0.9, 0.7), (5, 4, 4), (-0.5, -0.45, -0.35)), sphere(0.5, 0.17)
    grid = np.stack(np.meshgrid(*map(np.arange, (3, 2, 2)), indexing="ij"), axis=-1).reshape(-1, 3)
    bodies = []
    for k, place in enumerate(grid):
        points, cells = kinds[k % 3 == 2]
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        bodies.append((points @ turn.T + 0.95 * place + 0.1 * rng.random(3), cells))
    return bodies


def found(comm, kind):
    """Rows that name candidates of all pairs, and crossing edges, on all ranks. Collective."""
    mesh = distribute(comm, heap())
    one = np.ones(mesh.num_grains)
    settings = ContactSettings(points=kind)
    contact = Contact(mesh, mesh.x, Walls([]), ContactGrains(one, one), settings)
    contact.search(mesh.x)
    table, pairs, edges = contact_tables(contact, mesh), contact.pairs, contact.edges
    p, e = table["pairs"], table["edge_pairs"]
    facet = np.concatenate([*table["candidates"]["facet"].blocks(1000)])
    point = np.column_stack([p["grain"], p["point"], p["part"], p["partner"]])
    candidates = np.column_stack(
        [
            np.repeat(point, p["count"], axis=0),
            facet,
            edges.beside[pairs.candidate],
        ]
    )
    # The direction of an edge may depend on the ranks; each end goes with its share.
    sides = []
    for name, which in (("first", edges.pairs.first), ("second", edges.pairs.second)):
        order = np.argsort(e[name], axis=1)
        sides += [np.take_along_axis(v, order, 1) for v in (e[name], edges.edges.share[which])]
    crossings = np.column_stack([e["grain"], e["partner"], *sides])
    return [np.concatenate(comm.allgather(rows)) for rows in (candidates, crossings)]


@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["facets", "nodes"])
def test_pairs_are_those_of_one_rank(kind):
    """Candidates of each point, crossing edges, and what corners share: nothing is missing."""
    together, alone = found(MPI.COMM_WORLD, kind), found(MPI.COMM_SELF, kind)
    for rows, expected in zip(together, alone, strict=True):
        assert len(expected) > 20
        rows, expected = (r[np.lexsort(r.T[::-1])] for r in (rows, expected))
        np.testing.assert_array_equal(rows, expected)


@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["facets", "nodes"])
def test_steps_read_and_act_on_no_other_ghosts_than_those_exchanged(kind):
    """Forces are the same bits where all other ghosts have no positions, and none is left behind.

    Grains move towards the middle of all, so that contacts close.
    """
    comm = MPI.COMM_WORLD
    if comm.size == 1:
        pytest.skip("needs several ranks")
    mesh = distribute(comm, heap())
    one, grain = np.ones(mesh.num_grains), mesh.grain_of_node
    middle = np.column_stack([np.bincount(grain, values) for values in mesh.x.T])
    middle /= np.bincount(grain)[:, None]
    forces, unread = [], 0
    for poisoned in (False, True):
        settings = ContactSettings(0.3, points=kind)
        contact = Contact(mesh, mesh.x, Walls([]), ContactGrains(one, one), settings)
        contact.search(mesh.x, ahead=contact.edge)
        contact.motion.skin = np.inf  # no search from here on
        contact.begin_step(mesh.x)
        contact.add_forces(np.zeros_like(mesh.x), mesh.x, accept=True)
        if poisoned:
            read, _ = nodes_of_pairs(contact)
            others = ~read[contact.own.nodes.size :]
            contact.ghosts.positions.ghosts[others] = np.nan
            unread = comm.allreduce(int(others.sum()))
        for part in (0.02, 0.04, 0.05, 0.06):
            x = mesh.x + part * (np.array([1.0, 0.5, 0.5]) - middle)[mesh.grain_of_node]
            f = np.zeros_like(x)
            contact.begin_step(x)
            contact.add_forces(f, x)
        assert not contact.ghosts.forces.ghosts.any()
        forces.append(f)
        contact.destroy()
    assert unread > 50 and comm.allreduce(float(np.abs(forces[0]).sum())) > 0
    np.testing.assert_array_equal(*forces)
