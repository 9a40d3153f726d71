"""Dust: small fragments that go on as rigid bodies, in the shape in which they came loose."""

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.bulk.cracks.cracks import Cracks
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.fracture import Fracture
from mufe_fenicsx.run.from_bodies import build
from tests.bulk.test_growth import written

COMM, ALONE = MPI.COMM_WORLD, MPI.COMM_SELF
EDGE, SIGMA = 0.1e-3, 60e6
ELASTIC = Elastic(60e9, 0.2, 2500.0)
CUBE = box((2 * EDGE,) * 3, (2,) * 3)
NONE = np.empty((0, 2), dtype=np.int64)
TETS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1], [0.4, 0.3, -0.8]]) * EDGE


def law(dust, **more):
    return Fracture(SIGMA, 3.0 * EDGE * SIGMA**2 / 60e9, dust=dust, **more)


def broken(shapes, dust, cut, velocity=None, material=ELASTIC, **options):
    """Bodies whose facets have failed where ``cut(middles of both cells)`` says so."""
    s = build(
        ALONE, shapes, material, (0, 0, 0), (EDGE,) * 3, axes="", velocity=velocity, **options
    )
    s.add_term(Cracks(s.specimen, law(dust)))
    (cracks,) = s.specimen.added_terms
    s.step()
    middle = s.mesh.x[s.mesh.cells].mean(axis=1)[cracks.facets.across]
    s.grow(cracks.declare_open(np.flatnonzero(cut(middle))))
    cracks.points["furthest"][:] = 1.0
    return s, cracks


def moments(s, nodes=slice(None)):
    """Momentum and angular momentum of nodes."""
    s.complete()
    p = s.solid.mass[nodes, None] * s.state.v[nodes]
    return np.concatenate([p.sum(axis=0), np.cross(s.state.x[nodes], p).sum(axis=0)])


def off_corner(middle):
    """Facets that part the tetrahedra at an edge of a cube of bricks from the rest."""
    near = (middle / EDGE < [0.6, 0.6, 1.0]).all(axis=2)
    return near[:, 0] != near[:, 1]


def stirred(x, grain):
    """Motion with all kinds of strain, and a turn."""
    y = x / EDGE
    return 0.5 * np.sin(y @ [[5, 3, 7], [4, 6, 1], [2, 8, 5]])


def test_what_comes_loose_keeps_its_momenta_and_the_balance_closes():
    """Energy of deformation goes to ``cracks_dust``, with what springs inside hold."""
    s, cracks = broken([CUBE], 6, off_corner, stirred, damping=1e7)
    for _ in range(20):
        s.step()
    cracks.points["furthest"][:] = 1.0
    before, energies = moments(s), s.energies()
    s.update_time_step = lambda **_: None  # else energies of a new step are counted anew
    s.grow(NONE)
    dust = cracks.constraint
    after, now = moments(s), s.energies()
    (own,) = np.unique(dust.bodies.piece)
    nodes = np.unique(s.mesh.cells[s.mesh.piece_of_cell == own])
    assert 2 <= np.count_nonzero(s.mesh.piece_of_cell == own) <= 6
    assert sorted(dust.carried.nodes) == list(nodes)
    size = np.abs(s.solid.mass[nodes, None] * s.state.v[nodes]).sum()
    assert after == pytest.approx(before, abs=1e-14 * size)
    assert after[3:] == pytest.approx(before[3:], abs=1e-14 * size * EDGE)
    # Of the bodies themselves too.
    r, p = dust.bodies.centre[0], dust.bodies.mass[0] * dust.bodies.velocity[0]
    whole = np.concatenate([p, dust.bodies.momentum[0] + np.cross(r, p)])
    assert whole == pytest.approx(moments(s, nodes), abs=1e-13 * size)
    assert now["cracks_dust"] > 1e-3 * energies["kinetic"]
    lost = energies["kinetic"] - now["kinetic"]
    assert now["cracks_dust"] == pytest.approx(lost, rel=1e-9)
    assert now["residual"] == pytest.approx(energies["residual"], abs=1e-13 * now["kinetic"])
    assert now["elastic"] == pytest.approx(energies["elastic"], rel=1e-12)
    # Damping goes on from the motion of now; a stress that is frozen opens nothing.
    s.step()
    then = s.energies()
    assert then["residual"] == pytest.approx(now["residual"], abs=0.02 * now["cracks_dust"])
    s.state.deviator[dust.of_cell == 0] = 1e3 * SIGMA * np.array([2.0, -1.0, -1.0, 0.0, 0.0, 0.0])
    for _ in range(8):
        s.step()
    assert not dust.inside(cracks.facets.across[cracks.opened]).any()


def test_open_facets_inside_bear_no_more_and_hold_for_good():
    """Their springs would turn the body by themselves, for forces on sides apart have a couple."""

    def inner(middle):
        near = (middle / EDGE < [0.6, 0.6, 1.0]).all(axis=2)
        return near.all(axis=1)

    s, cracks = broken([CUBE], 6, lambda m: off_corner(m) | inner(m), stirred)
    middle = s.mesh.x[s.mesh.cells].mean(axis=1)[cracks.facets.across[cracks.opened]]
    inside = inner(middle)
    p = cracks.points
    p["furthest"][inside] = (p["strength"] / p["stiffness"] + 0.3 * p["ultimate"])[inside]
    for _ in range(20):
        s.step()
    energies = s.energies()
    s.grow(NONE)
    dust, now = cracks.constraint, s.energies()
    assert dust.bodies.piece.size == 1 and np.count_nonzero(dust.of_cell == 0) > 1
    assert inside.any() and (cracks.points["open"][inside] < 0.0).any()
    assert now["residual"] == pytest.approx(energies["residual"], abs=1e-13 * now["kinetic"])
    assert now["elastic"] == pytest.approx(energies["elastic"], rel=1e-12)
    assert now["cracks_fracture"] == energies["cracks_fracture"]
    f = np.zeros_like(s.state.x)
    cracks.add_forces(f, s.state, 0.0)
    assert not f[dust.carried.nodes].any()
    s.grow(NONE)
    assert dust is cracks.constraint and dust.bodies.piece.size == 1
    assert (s.mesh.piece_of_cell[dust.of_cell == 0] == dust.bodies.piece[0]).all()


@pytest.mark.parametrize("damping", [0.0, 2e5])
def test_a_tetrahedron_that_spins_freely_keeps_energy_momentum_and_shape(damping):
    """Damping takes what its account says: of 3000 steps to the power."""
    shapes = [(TETS, np.array([[0, 1, 2, 3], [0, 2, 1, 4]]))]

    def velocity(x, grain):
        out = np.array([2.0, 5.0, 40.0]) * np.sign(x[:, 2:] - 1e-9)
        return out + np.cross([2e5, 1e5, -2e5], x)

    s, cracks = broken(shapes, 1, lambda middle: np.ones(len(middle), bool), velocity)
    s.grow(NONE)
    bodies, x = cracks.constraint.bodies, s.state.x
    assert bodies.piece.tolist() == [0, 1]
    cells = s.mesh.cells
    edges = np.linalg.norm(
        x[cells[:, [0, 0, 0, 1, 1, 2]]] - x[cells[:, [1, 2, 3, 2, 3, 3]]], axis=2
    )
    s.damping = damping
    s.update_time_step()
    s.step()
    first, energies, L = s.energies(), [], moments(s)
    t = s.state.t
    for k in range(3000):
        s.step(everywhere=False)
        if not k % 100:
            energies.append(s.energies())
    now = s.energies()
    fade = np.exp(-damping * (s.state.t - t))
    assert fade == 1.0 if damping == 0.0 else fade < 0.9
    assert moments(s)[:3] == pytest.approx(L[:3] * fade, rel=1e-5 if damping else 1e-12)
    x = s.state.x
    after = np.linalg.norm(
        x[cells[:, [0, 0, 0, 1, 1, 2]]] - x[cells[:, [1, 2, 3, 2, 3, 3]]], axis=2
    )
    assert after == pytest.approx(edges, rel=1e-12)
    for e in energies:
        assert e["residual"] == pytest.approx(first["residual"], abs=1e-6 * first["kinetic"])
    if not damping:
        assert moments(s) == pytest.approx(L, rel=1e-11)
        assert now["kinetic"] == pytest.approx(first["kinetic"], rel=1e-6)


def pressed(dust):
    """Stress and shortening of a column of five bricks, the middle one of which is loose."""
    up, tall = np.eye(3)[2], 3.0 * EDGE
    walls = [Wall("low", 0.0 * up, up), Wall("high", tall * up, -up)]

    def cut(middle):
        layer = np.floor(middle[:, :, 2] / (0.6 * EDGE)) == 2
        return layer[:, 0] != layer[:, 1]

    s, cracks = broken(
        [box((EDGE, EDGE, tall), (1, 1, 5))], dust, cut, None, Elastic(60e9, 0.0, 2500.0),
        walls=walls, damping=2e7, points="facets",
    )  # fmt: skip
    s.grow(NONE)
    assert s.mesh.num_pieces.tolist() == [3]
    s.walls.velocity[1] = -0.01 * EDGE / 1e-6 * up
    while s.state.t < 1e-6:
        s.step(everywhere=False)
    gone = tall - s.walls.point[1, 2]
    s.walls.velocity[1] = 0.0
    while s.state.t < 3e-6:
        s.step(everywhere=False)
    low, high = s.wall_forces()
    assert low == pytest.approx(high, rel=1e-3)
    return high / EDGE**2, gone, cracks.constraint


def test_pressed_dust_bears_what_a_piece_that_deforms_does():
    """Less the compliance of its own brick: what is left tells the force."""
    soft, gone, none = pressed(0)
    stiff, same, dust = pressed(6)
    assert none is None and dust.bodies.piece.size == 1
    wanted = same / (gone / soft - 0.6 * EDGE / 60e9)
    assert stiff == pytest.approx(wanted, rel=1e-3)
    assert stiff > 1.1 * soft


def bursting(comm=ALONE, dust=4, bodies=2, rate=3e5):
    """Cubes of 48 tetrahedra that fly apart bit by bit, and their cracks."""
    shapes = [(CUBE[0] + 3.0 * k * EDGE * np.eye(3)[1], CUBE[1]) for k in range(bodies)]

    def velocity(x, grain):
        centre = (1.0 + 3.0 * grain[:, None] * np.eye(3)[1]) * EDGE
        return rate * (1.0 + 0.1 * grain[:, None]) * (x - centre)

    s = build(comm, shapes, ELASTIC, (0, 0, 0), (EDGE,) * 3, axes="", velocity=velocity)
    s.add_term(Cracks(s.specimen, law(dust, modulus=3.0, seed=1)))
    return s, s.specimen.added_terms[0]


def until(s, steps):
    while s.state.num_steps < steps:
        s.step(everywhere=False)
    s.complete()
    return s


def test_nothing_changes_where_no_piece_is_small():
    """Not a bit, with pieces, parts of nodes and open facets."""
    cut = [off_corner] * 2
    (one, cracks), (other, _) = (
        broken([CUBE], dust, cut, stirred) for dust, cut in zip((1, 0), cut, strict=True)
    )
    for s in (one, other):
        s.grow(NONE)
        until(s, 100)
    assert one.mesh.num_pieces.tolist() == [2] and not cracks.constraint.bodies.piece.size
    assert np.array_equal(one.state.x, other.state.x)
    assert np.array_equal(one.state.v, other.state.v)


def columns_of(dust):
    """All that bodies have, and their nodes, by grain and piece."""
    c, b = dust.carried, dust.bodies
    ends = zip(c.offset[:-1], c.offset[1:], strict=True)
    rows = [np.concatenate([c.mass[i:j], c.place[i:j].ravel()]) for i, j in ends]
    return {
        (b.grain[k], b.piece[k]): np.concatenate([*(np.ravel(of[k]) for of in b), rows[k]])
        for k in range(b.mass.size)
    }


def test_dust_goes_on_to_the_last_bit_as_the_mesh_grows(monkeypatch):
    """Bodies of before a growth are those after it, whole as they were; others join them."""
    grow, joined = Simulation.grow, []

    def watched(self, between):
        before, x = columns_of(self.specimen.added_terms[0].constraint), self.state.x
        nodes = self.specimen.added_terms[0].constraint.carried.nodes
        grow(self, between)
        dust = self.specimen.added_terms[0].constraint
        after = columns_of(dust)
        for name, values in before.items():
            assert np.array_equal(values, after[name]), name
        assert np.isin(x[nodes], self.state.x[dust.carried.nodes]).all()
        if before and len(after) > len(before):
            joined.append(len(after))

    monkeypatch.setattr(Simulation, "grow", watched)
    s, cracks = bursting()
    until(s, 800)
    assert len(joined) > 3
    of_cell = cracks.constraint.of_cell
    assert set(np.bincount(of_cell[of_cell >= 0])) >= {1, 2}
    assert s.energies()["cracks_dust"] > 0.0


def test_resume_gives_the_same_bits(tmp_path):
    s, _ = bursting()
    until(s, 120)
    assert s.specimen.added_terms[0].constraint.bodies.piece.size

    def make(mesh, walls):
        other = Simulation(mesh, [ELASTIC] * mesh.num_grains, walls)
        other.add_term(Cracks(other.specimen, law(4, modulus=3.0, seed=1)))
        return other

    other = written(s, tmp_path, make)(bursting()[0])
    assert s.energies() == other.energies()
    for one in (s, other):
        until(one, 800)
    for name in ("x", "v", "a", "deviator"):
        assert np.array_equal(getattr(s.state, name), getattr(other.state, name)), name
    assert s.energies() == other.energies()
    assert s.energies()["cracks_dust"] > 0.0


@pytest.mark.mpi
def test_ranks_have_the_same_dust():
    found = []
    for comm in (COMM, ALONE):
        s, cracks = bursting(comm, bodies=3)
        until(s, 150)
        dust = cracks.constraint
        rows = [
            (s.mesh.grains[g], p, m, *v)
            for g, p, m, v in zip(*(getattr(dust.bodies, n) for n in ("grain", "piece", "mass",
                                                                   "velocity")), strict=True)
        ]  # fmt: skip
        rows = sorted(row for some in comm.allgather(rows) for row in some)
        found.append((np.array(rows), s.energies()))
    (some, e), (all_of_them, alone) = found
    assert len(some) == len(all_of_them) > 30
    assert some == pytest.approx(all_of_them, rel=1e-7, abs=1e-9)
    for name, value in alone.items():
        assert e[name] == pytest.approx(value, rel=1e-6, abs=1e-9 * alone["kinetic"]), name


def test_added_mass_leaves_the_motion_as_it_is():
    s, cracks = bursting()
    until(s, 300)
    dust, (x, v) = cracks.constraint, (s.state.x.copy(), s.state.v.copy())
    random = np.random.default_rng(1)
    of_dust = dust.carried.nodes
    s.solid.mass[of_dust[:-9]] *= 1.0 + random.random(of_dust.size - 9)
    kept = columns_of(dust)
    s.limit.take_masses()
    dust.complete(s.state)
    assert s.state.v == pytest.approx(v, abs=1e-13 * np.abs(v).max())
    assert dust.carried.at == pytest.approx(x[of_dust], abs=1e-14 * EDGE)
    b, c = dust.bodies, dust.carried
    p = np.zeros((b.mass.size, 6))
    r = x[of_dust] - b.centre[c.body]
    mv = s.solid.mass[of_dust, None] * v[of_dust]
    np.add.at(p, c.body, np.hstack([mv, np.cross(r, mv)]))
    assert b.mass[:, None] * b.velocity == pytest.approx(p[:, :3], abs=1e-13 * np.abs(mv).max())
    assert b.momentum == pytest.approx(p[:, 3:], abs=1e-13 * np.abs(mv).max() * EDGE)
    # What has the masses of before stays to the last bit.
    last = (b.grain[-1], b.piece[-1])
    assert np.array_equal(columns_of(dust)[last], kept[last])


def test_what_a_wall_holds_is_no_dust():
    low = Wall("low", np.zeros(3), np.eye(3)[2], bonded=True)
    s, cracks = broken([CUBE], 6, off_corner, walls=[low])
    s.grow(NONE)
    assert s.mesh.num_pieces.tolist() == [2] and not cracks.constraint.bodies.piece.size


@pytest.mark.parametrize(("dust", "line"), [(-1, "dust = -1"), (1.5, "dust = 1.5")])
def test_wrong_numbers_are_one_line(dust, line):
    with pytest.raises(InputError, match=line):
        law(dust)


def test_the_kinematic_law_is_refused():
    s = build(ALONE, [CUBE], ELASTIC, (0, 0, 0), (2 * EDGE,) * 3, law="kinematic")
    with pytest.raises(InputError, match='kinematic, expected "matched" with dust'):
        Cracks(s.specimen, law(4))
