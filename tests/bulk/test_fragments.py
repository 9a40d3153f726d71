"""Pieces of a broken grain: which they are, how they touch, and what contact takes over."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.bulk.cracks.cracks import STEPS_BETWEEN_PIECES, Cracks
from mufe_fenicsx.contact.results.network import find_network
from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.kernels.geometry.topology import number_pieces
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.fracture import Fracture
from mufe_fenicsx.run.from_bodies import build
from tests.bodies import RADIUS, sphere
from tests.bulk.test_growth import written

COMM, ALONE = MPI.COMM_WORLD, MPI.COMM_SELF
SIDE = 1e-3
ELASTIC = Elastic(1e9, 0.2, 2500.0)
BRICK = box((SIDE, SIDE, 2 * SIDE), (3, 3, 6))
BALL = sphere(RADIUS, 0.4 * RADIUS)
Y = np.array([0.0, 1.0, 0.0])


def across(mesh, above, label=1):
    """Pairs of cells of a grain that are on both sides of a plane, by their middles."""
    _, cells = mesh.inner_facets()
    side = above(mesh.x[mesh.cells].mean(axis=1))[cells]
    of_grain = mesh.labels[mesh.grains[mesh.grain_of_cell[cells[:, 0]]]] == label
    return cells[(side[:, 0] != side[:, 1]) & of_grain]


def upper(mesh):
    """Flags of the nodes of cells above the middle of a brick."""
    nodes = np.zeros(mesh.num_nodes, dtype=bool)
    nodes[mesh.cells[mesh.x[mesh.cells].mean(axis=1)[:, 2] > SIDE]] = True
    return nodes


@pytest.mark.parametrize(
    ("holding", "before", "wanted"),
    [
        ([], [0, 0, 0, 0, 0, 0], [1, 1, 0, 0, 0, 2]),
        ([[1, 3]], [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1]),
        ([], [1, 1, 0, 0, 0, 0], [1, 1, 0, 0, 0, 2]),
        ([], [1, 1, 1, 1, 1, 0], [2, 2, 1, 1, 1, 0]),
    ],
)
def test_pieces_keep_their_numbers(holding, before, wanted):
    """Cells in a row of two, three and one; of what parts the most cells keep the number."""
    cells = np.array(
        [[0, 1, 2, 3], [1, 2, 3, 4], *([5, 6, 7, 8 + k] for k in range(3)), range(12, 16)]
    )
    grain, held = np.zeros(6, dtype=np.int32), np.array(holding, dtype=np.int64).reshape(-1, 2)
    for name in (np.arange(6), np.arange(6)[::-1]):
        order = np.argsort(name)
        found = number_pieces(
            cells[order], np.array(before, np.int32)[order], grain, np.argsort(name[order]),
            np.argsort(order)[held],
        )  # fmt: skip
        assert len(np.unique(found)) == len(set(wanted))
        if name[0] == 0:
            assert found.tolist() == wanted


def sheared(s):
    """Drive the upper wall down and aside; time steps are the same for all."""
    s.walls.velocity[s.walls.names.index("z_max")] = [0.3, 0.0, -1.0]
    s.dt, s.update_time_step = 7e-8, lambda **_: None
    for _ in range(300):
        s.step()


@pytest.mark.parametrize(("points", "rel"), [("facets", 1e-9), ("nodes", 2e-3)])
def test_halves_of_a_brick_are_two_bricks(points, rel):
    """The same contact as of two bodies that are meshed apart.

    To rounding where points are in facets; at nodes the last digits say which edges end in others.
    """
    points_, cells = BRICK
    high = points_[cells].mean(axis=1)[:, 2] > SIDE
    halves = []
    for which in (~high, high):
        nodes, mine = np.unique(cells[which], return_inverse=True)
        halves.append((points_[nodes], mine.reshape(-1, 4)))
    options = {"friction": 0.3, "points": points}
    one, two = (
        build(ALONE, bodies, ELASTIC, (0, 0, 0), (SIDE, SIDE, 2 * SIDE), "z", **options)
        for bodies in ([BRICK], halves)
    )
    one.grow(across(one.mesh, lambda x: x[:, 2] > SIDE))
    assert one.mesh.num_pieces.tolist() == [2]
    for s in (one, two):
        sheared(s)
    # Edges that lie on each other, of one node both, do not meet.
    edges, of_node = one.contact.edges, one.mesh.origin[one.contact.own.nodes]
    ends = [of_node[edges.edges.ends[of]] for of in (edges.pairs.first, edges.pairs.second)]
    assert (ends[0][:, :, None] != ends[1][:, None, :]).all()
    assert two.energies()["contact"] > 0
    size = two.energies()["elastic"]
    assert one.energies() == pytest.approx(two.energies(), abs=rel * size)
    assert one.wall_forces() == pytest.approx(two.wall_forces(), rel=rel)
    mine, theirs = (find_network(s.contact, s.mesh, s.solid.mass, s.state.x) for s in (one, two))
    between = [n.contacts.force[n.contacts.b < n.labels.size] for n in (mine, theirs)]
    assert between[0] == pytest.approx(between[1], abs=rel * np.abs(between[1]).max())
    assert mine.num_active().tolist() == [0] and mine.num_fragments.tolist() == [2]
    # What pieces of one grain do to each other is no contact of grains, in any table.
    assert mine.contacts.within.sum() == theirs.num_active()[0] == 1
    assert (one.mean_active_contacts(), two.mean_active_contacts()) == (0.0, 1.0)
    assert (one.num_active_grains(), two.num_active_grains()) == (1, 2)
    assert [p.between_grains.sum() > 0 for p in (mine.patches, theirs.patches)] == [False, True]
    assert mine.patches.force_share[mine.patches.with_walls].sum() == pytest.approx(1.0)
    at_walls = one.walls.pairs.closed.sum()
    assert one.contact.counts()[0] == at_walls < two.contact.counts()[0]


def platens(comm=ALONE, balls=1):
    """Balls one beside the other between platens that come together, the first in two."""
    points, cells = BALL
    bodies = [(points + 2.5 * k * RADIUS * Y, cells) for k in range(balls)]
    low, high = points.min(axis=0), points.max(axis=0)
    s = build(comm, bodies, ELASTIC, low, high, "z", friction=0.3)
    s.walls.velocity[s.walls.names.index("z_max"), 2] = -2.0
    return s


@pytest.mark.mpi
def test_halves_of_a_ball_carry_the_load_again():
    s = platens(COMM, balls=3)
    for _ in range(60):
        s.step()
    s.grow(across(s.mesh, lambda x: x[:, 2] > 0.05 * RADIUS))
    assert COMM.allreduce(int(s.mesh.num_pieces.sum())) == 4
    while s.state.t < 1.2e-4:
        s.step(everywhere=False)
    energies, contact = s.energies(), s.contact
    assert abs(energies["residual"]) < 1e-3 * energies["work"]
    p = contact.pairs
    own = np.count_nonzero(p.closed & (contact.points.grain_of_point[p.node] == p.grain))
    assert COMM.allreduce(own) > 5
    # As much as three whole balls bear, less what the cut lets go.
    whole = platens(COMM, balls=3)
    while whole.state.t < 1.2e-4:
        whole.step(everywhere=False)
    ratio = s.wall_forces() / whole.wall_forces()
    assert (ratio > 0.75).all() and (ratio < 1.01).all()


def cracked(steps=300):
    """A pressed brick whose middle opened in shear, all points of which are about to fail."""
    s = build(ALONE, [BRICK], ELASTIC, (0, 0, 0), (SIDE, SIDE, 2 * SIDE), "z", friction=0.5)
    cracks = Cracks(s.specimen, Fracture(1e6, 1.0))
    s.add_term(cracks)
    places = s.mesh.x[cracks.facets.nodes(s.mesh)[:, :3], 2]
    middle = (np.abs(places - SIDE) < 1e-9).all(axis=1)
    cracks.strength[:] = np.where(middle, 1e6, np.inf)
    cracks._follow(s.solid)
    s.walls.velocity[s.walls.names.index("z_max"), 2] = -0.3
    for _ in range(steps):
        s.step()
    s.grow(cracks.declare_open(np.flatnonzero(middle)))
    assert s.mesh.piece_of_cell is None  # it hangs by its cohesion
    kept = cracks.points
    kept["furthest"] = kept["strength"] / kept["stiffness"] + 1.01 * kept["ultimate"]
    s.state.v[upper(s.mesh)] += [0.1, 0.05, 0.0]
    s.specimen.initial_kinetic = s.kinetic_energy()
    return s, cracks


@pytest.mark.parametrize("apart", [0.0, 1e-7])
def test_contact_takes_over_what_a_crack_bore(apart):
    """No force jumps where a pressed and sheared half comes loose, and no energy is lost.

    Faces that stand apart by less than the springs of the crack are pressed bear as well.
    """
    s, cracks = cracked()
    while (s.state.num_steps + 1) % STEPS_BETWEEN_PIECES:
        s.step()
    s.step()
    s.state.x[upper(s.mesh), 2] += apart
    s.contact.begin_step(s.state.x)
    s.contact.add_forces(np.zeros_like(s.state.x), s.state.x)
    bore = np.zeros_like(s.state.x)
    cracks.add_forces(bore, s.state, 0.0)
    others, bears = np.zeros_like(bore), np.zeros_like(bore)
    s.contact.evaluate(others)
    before, work = s.energies(), cracks.parts_of_energy(s.state)
    s.grow(cracks.facets_to_open(s.state))
    assert s.mesh.num_pieces.tolist() == [2] and s.mesh.version == 1
    s.contact.evaluate(bears)
    bears -= others
    high, largest = upper(s.mesh), np.abs(bore).max()
    assert np.abs(bore[high].sum(axis=0)[:2]).min() > 1e-3 * largest
    assert bears[high].sum(axis=0) == pytest.approx(bore[high].sum(axis=0), abs=1e-9 * largest)
    assert bears == pytest.approx(bore, abs=0.01 * largest)
    after, now = s.energies(), cracks.parts_of_energy(s.state)
    assert after["residual"] == pytest.approx(before["residual"], abs=1e-12 * before["elastic"])
    assert now["stored"] == 0.0 < work["stored"]
    assert now["friction"] == work["friction"]
    gained = after["contact"] - before["contact"] - work["stored"]
    assert before["switching"] - after["switching"] == pytest.approx(gained, rel=1e-6)
    for _ in range(300):
        s.step()
    end = s.energies()
    assert abs(end["residual"] - after["residual"]) < 1e-3 * (end["work"] + end["elastic"])


def test_lost_faces_meet_without_a_blow():
    """Sides of a crack that bears no more overlap; what comes loose is pressed from there on."""
    s, cracks = cracked()
    cracks.points["open"] = -1.0
    while s.mesh.num_pieces.tolist() != [2]:
        s.step(everywhere=False)
    pairs = s.contact.pairs
    assert pairs.gap[pairs.within].min() < -1e-6
    assert s.energies()["switching"] == 0.0


def test_points_of_pieces_do_not_come_in_at_once():
    """One that is deeper than it can have moved, past sides of a crack, begins without a force."""
    s = build(ALONE, [BRICK], ELASTIC, (0, 0, 0), (SIDE, SIDE, 2 * SIDE), "z")
    s.grow(across(s.mesh, lambda x: x[:, 2] > SIDE))
    contact, f = s.contact, np.zeros_like(s.state.x)
    s.state.x[upper(s.mesh), 2] -= 0.01 * SIDE
    contact.ghosts.place(s.state.x)  # without a motion that is known
    contact.evaluate(f)
    pairs = contact.pairs
    assert pairs.gap[pairs.within].min() < -0.009 * SIDE and np.abs(f).max() == 0.0
    # From there on it bears.
    s.state.x[upper(s.mesh), 2] -= 0.001 * SIDE
    contact.begin_step(s.state.x)
    contact.add_forces(f, s.state.x)
    assert np.abs(f).max() > 0.0


def test_halves_meet_again_where_they_lost_touch():
    """Contact that took over closes at a gap: it is not seen later, at its full depth.

    Steps are so short that a contact of as much energy closes to 1 % of it.
    """
    s, _ = cracked()
    while s.mesh.num_pieces.tolist() != [2]:
        s.step()
    s.dt, s.update_time_step = 1e-8, lambda **_: None
    top = s.walls.names.index("z_max")
    s.walls.velocity[top, 2] = 5.0
    p = s.contact.pairs
    took = np.flatnonzero(p.offset > 0.0)
    assert took.size > 30 and p.closed[took].all()
    while p.closed[took].any():
        s.step()
    s.walls.velocity[top] = s.state.v[:] = 0.0
    s.state.v[upper(s.mesh), 2] = -0.5
    s.take_over()
    s.dt = 1e-8
    s.step()
    before, most = s.energies(), 0.0
    assert s.contact.pairs is p and (p.gap[took] > 0.0).all()
    while not p.closed[took].all():
        s.step()
        most = max(most, s.energies()["contact"])
    assert (p.gap[took] > 0.0).all()
    assert abs(s.energies()["residual"] - before["residual"]) < 0.01 * most


@pytest.mark.mpi
def test_a_resumed_break_goes_on_with_the_same_bits(tmp_path):
    """Pieces have their numbers, and their contact what it remembers."""
    s = platens(COMM, balls=3)
    for _ in range(40):
        s.step()
    s.grow(across(s.mesh, lambda x: x[:, 2] > 0.05 * RADIUS))
    s.grow(across(s.mesh, lambda x: (x[:, 0] > 0.05 * RADIUS) & (x[:, 2] > 0.05 * RADIUS)))
    for _ in range(100):
        s.step()

    def make(mesh, walls):
        return Simulation(mesh, [ELASTIC] * mesh.num_grains, walls, friction=0.3)

    other = written(s, COMM.bcast(tmp_path), make)(platens(COMM, balls=3))
    assert other.mesh.num_pieces.tolist() == s.mesh.num_pieces.tolist()
    for one in (s, other):
        for _ in range(100):
            one.step()
    assert np.array_equal(s.state.x, other.state.x) and np.array_equal(s.state.v, other.state.v)
    assert s.energies() == other.energies()
