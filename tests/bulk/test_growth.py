"""Grains whose facets open: what was there goes on, and all follows the new mesh."""

import gc
import weakref
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI

import mufe_fenicsx.contact.contact as contact_module
import mufe_fenicsx.mesh as mesh_module
from mufe_fenicsx.bulk.far_nodes import names_of_nodes
from mufe_fenicsx.bulk.tools import Tool
from mufe_fenicsx.contact.snapshot import Rows, contact_tables
from mufe_fenicsx.contact.surface.grown import GrownSurface
from mufe_fenicsx.contact.walls import Wall
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.kernels.geometry.topology import boundary_sides, nodes_of_sides
from mufe_fenicsx.loading.pressure import Pressure
from mufe_fenicsx.materials.auto import Auto
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.materials.neo_hookean import NeoHookean
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.output.checkpoint import Checkpoint, CheckpointWriter, read_tables
from mufe_fenicsx.run.from_bodies import build, distribute, simulate
from mufe_fenicsx.run.snapshot import restore, restore_mesh, snapshot
from mufe_fenicsx.scene import MassScaling
from mufe_fenicsx.state import ForceTerm
from tests.bodies import RADIUS, sphere
from tests.bulk.test_far_nodes import bonds_of_the_page

COMM, ALONE = MPI.COMM_WORLD, MPI.COMM_SELF
SIDE = 1e-3
ELASTIC = Elastic(1e9, 0.2, 2500.0)
YIELDING = J2(1e9, 0.2, 2500.0, ((0.0, 1e6), (0.1, 2e6)))
CUBE = box((SIDE,) * 3, (4, 4, 4))
X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


def between(mesh, on, label=1):
    """Pairs of cells of a grain on both sides of the facets all of whose nodes are ``on``."""
    nodes, cells = mesh.inner_facets()
    of_grain = mesh.labels[mesh.grains[mesh.grain_of_cell[cells[:, 0]]]] == label
    return cells[on(mesh.x[nodes]).all(axis=1) & of_grain]


def middle(x):
    return np.abs(x[..., 0] - 0.5 * SIDE) < 1e-9


def inside(x):
    return middle(x) & (np.abs(x[..., 1:] - 0.5 * SIDE) < 0.3 * SIDE).all(axis=-1)


def stretched(x, _):
    """Velocities that part the halves of the first cube and turn it."""
    return 1.5 * np.sin(2e3 * x + [1.0, 2.0, 3.0]) + np.cross([0.0, 300.0, 500.0], x)


def as_arrays(tables):
    """Tables with their columns whole."""
    return {
        name: {
            column: np.concatenate([values.values[:0], *values.blocks(values.shape[0] + 1)])
            if isinstance(values, Rows)
            else values
            for column, values in table.items()
        }
        for name, table in tables.items()
    }


def in_order(table):
    """Rows in the order of their names, where they have any but their grain."""
    columns = (values for key, values in table.items() if key != "grain")
    names = [values for values in columns if values.dtype.kind == "i" and values.ndim == 1]
    return np.lexsort(names) if names else slice(None)


def assert_same(table, other, name="", rel=0.0):
    """Tables with the same rows, numbers to ``rel`` of the largest of their column."""
    order, other_order = in_order(table), in_order(other)
    assert table.keys() == other.keys(), name
    for key, values in table.items():
        values, others = values[order], other[key][other_order]
        assert values.shape == others.shape, (name, key)
        if values.dtype.kind != "f" or not rel:
            assert np.array_equal(values, others, equal_nan=values.dtype.kind == "f"), (name, key)
            continue
        size = np.abs(values[np.isfinite(values)]).max(initial=0.0)
        near = np.allclose(values, others, rtol=rel, atol=rel * size, equal_nan=True)
        assert near, (name, key)


def free_cube(material, element="averaged", steps=0, **options):
    s = build(
        ALONE, [CUBE], material, (0, 0, 0), (SIDE,) * 3, "", velocity=stretched, element=element,
        **options,
    )  # fmt: skip
    for _ in range(steps):
        s.step()
    return s


def parts_by_flood(cells, facets, across, opened):
    """A mark of each corner of a cell, the same where a walk around its node joins the cells."""
    mark = np.arange(cells.size).reshape(cells.shape)
    still = [(f, pair) for f, pair in zip(facets, across, strict=True) if tuple(pair) not in opened]
    changed = True
    while changed:
        changed = False
        for facet, (a, b) in still:
            for node in facet:
                at = [(cell, np.flatnonzero(cells[cell] == node)[0]) for cell in (a, b)]
                least = min(mark[at[0]], mark[at[1]])
                changed |= mark[at[0]] != mark[at[1]]
                mark[at[0]] = mark[at[1]] = least
    return mark


@pytest.mark.mpi
def test_nodes_part_as_a_walk_around_them_says():
    """Against a twin in Python, for facets by chance that open in three goes."""
    bodies = [box((SIDE,) * 3, (2, 2, 2), 2 * k * SIDE * X) for k in range(3)]
    first = mesh = distribute(COMM, bodies)
    facets, across = first.inner_facets()
    go = np.random.default_rng(COMM.rank).integers(0, 6, len(across))
    for k in range(3):
        mesh = mesh.grow(across[go == k])
    assert mesh.version == 3
    opened = {tuple(pair) for pair in across[go < 3].tolist()}
    mark = parts_by_flood(first.cells, facets, across.tolist(), opened)
    # The same partition of corners: as many pairs of both numbers as numbers.
    pairs = np.unique(np.stack([mark.ravel(), mesh.cells.ravel()], axis=1), axis=0)
    assert len(pairs) == len(np.unique(mark)) == mesh.num_nodes > 1.5 * first.num_nodes
    assert np.array_equal(mesh.x[mesh.cells], first.x[first.cells])
    for begin, end in pairwise(mesh.node_offset):
        assert np.ptp(mesh.nodes[begin:end]) == end - begin - 1
    assert np.array_equal(mesh.grain_of_node[mesh.cells], first.grain_of_node[first.cells])
    # A facet between cells is surface where they have not all three nodes in common.
    one, other = mesh.cells[across].transpose(1, 0, 2)
    apart = (one[:, :, None] == other[:, None, :]).sum(axis=(1, 2)) < 3
    assert len(mesh.facets) == len(first.facets) + 2 * np.count_nonzero(apart)
    assert not set(map(tuple, across[apart].tolist())) - opened
    # Names stay; those of parts follow, and numbers over all ranks are in a row.
    grain, number = names_of_nodes(first, first.cells.ravel())
    now, number_now = names_of_nodes(mesh, mesh.cells.ravel())
    old = np.diff(first.node_offset)[first.grain_of_cell].repeat(4)
    assert np.array_equal(grain, now)
    assert np.array_equal(number[number_now < old], number_now[number_now < old])
    assert len(np.unique(number_now[number_now < old])) == len(np.unique(number))
    count = COMM.allgather(mesh.num_nodes)
    assert mesh.first_node == sum(count[: COMM.rank])
    where = mesh.V.tabulate_dof_coordinates()
    assert where[: mesh.num_nodes] == pytest.approx(mesh.x[mesh.node_of_dof], abs=1e-15)
    assert np.array_equal(
        mesh.cell_function(np.arange(mesh.num_cells)).x.array[mesh.cell_order],
        np.arange(mesh.num_cells),
    )


@pytest.mark.mpi
def test_grains_that_stay_keep_their_surface(monkeypatch):
    """Blocks of rows of before, and blocks made anew: to the last bit as all of it made anew."""
    far = [(CUBE[0] + [0.0, 0.0, 1.1 * k * SIDE], CUBE[1]) for k in range(3)]
    ball = sphere(0.4 * SIDE, 0.2 * SIDE)
    bodies = [*far, (ball[0] + [3 * SIDE, 0.0, 0.0], ball[1])]
    found = []
    for everything in (False, True):
        if everything:
            monkeypatch.setattr(
                contact_module, "GrownSurface", lambda *given: GrownSurface(*given[:-1], True)
            )
        s = build(ALONE, bodies, ELASTIC, -SIDE * np.ones(3), 5 * SIDE * np.ones(3))
        for label, every in ((1, 3), (2, 1), (1, 1)):
            s.grow(between(s.mesh, middle, label)[::every])
        assert s.mesh.version > 1 and s.mesh.num_pieces.tolist() == [2, 2, 1, 1]
        layers, smooth = s.contact.layers, s.contact.layers.smooth
        parts = s.contact.own, layers.points, smooth, layers
        found.append(
            {
                (type(part).__name__, name): value
                for part in parts
                for name, value in vars(part).items()
                if isinstance(value, np.ndarray)
            }
        )
    some, whole = found
    assert some.keys() == whole.keys() and len(some) > 40
    for name, values in whole.items():
        assert some[name].dtype == values.dtype and np.array_equal(some[name], values), name


@pytest.mark.parametrize("element", ["averaged", "p1"])
def test_what_a_growth_leaves_is_what_the_grown_mesh_has_anew(element):
    """To the last bit, of balls whose facets open by chance and a cube that is cut along a wave."""
    ball, (points, cells) = sphere(SIDE, 0.3 * SIDE), box((SIDE,) * 3, (6, 6, 6))
    wave = 0.02 * SIDE * np.sin(8.0 * points[:, 1:] / SIDE).prod(axis=1)
    bodies = [(points + np.where(middle(points), wave, 0.0)[:, None] * X, cells)]
    bodies += [(ball[0] + 4 * k * SIDE * X, ball[1]) for k in (1, 2, 3)]
    mesh = distribute(COMM, bodies)
    materials, (facets, across) = [ELASTIC] * mesh.num_grains, mesh.inner_facets()
    s = Simulation(mesh, materials, element=element)
    go = np.random.default_rng(COMM.rank).integers(0, 20, len(across))
    x = mesh.x[facets]
    cut = np.abs(x[..., 0] - 0.5 * SIDE - 0.02 * SIDE * np.sin(8.0 * x[..., 1:] / SIDE).prod(-1))
    of_cube = mesh.grains[mesh.grain_of_cell[across[:, 0]]] == 0
    in_turn = np.where((cut < 1e-9).all(axis=1), 4.0 * x[..., 2].mean(axis=1) / SIDE, 20.0)
    go = np.where(of_cube, in_turn.astype(int), go)
    for k in range(4):
        s.grow(across[go == k])
    mesh = s.mesh
    assert mesh.version == 4
    anew = Simulation(mesh, materials, element=element)
    sides = boundary_sides(mesh.cells, mesh.cell_offset)
    assert np.array_equal(mesh.facets, nodes_of_sides(mesh.cells, sides))
    assert np.array_equal(mesh.side_of_facet, sides)
    ours, theirs = (
        {
            **{f"points {key}": value for key, value in vars(one.contact.points).items()},
            **{f"smooth {key}": value for key, value in vars(one.contact.layers.smooth).items()},
            **{key: getattr(one.solid, key) for key in ("mass", "volume0", "first_time_step")},
            "compliance": one.contact.layers.compliance_of_edge,
        }
        for one in (s, anew)
    )
    cracks = mesh.source.facets < 0
    assert (ours["compliance"] > 0).any()
    assert COMM.allreduce(int(ours["smooth bulge"][cracks].any()))
    for key, values in ours.items():
        assert np.array_equal(values, theirs[key]), key


@pytest.mark.parametrize(
    ("material", "element"), [(ELASTIC, "averaged"), (YIELDING, "averaged"), (ELASTIC, "p1")]
)
def test_a_cube_that_is_cut_is_the_one_of_two_halves(material, element, monkeypatch):
    """To rounding: the twin has other numbers of nodes and cells, and sums in another order."""
    s = free_cube(material, element, 40)
    s.grow(between(s.mesh, middle))
    # The half of the first cell keeps the nodes; the other has copies, in their order.
    points, cells = CUBE
    copied = np.flatnonzero(middle(points))
    copy = np.arange(len(points))
    copy[copied] = len(points) + np.arange(copied.size)
    beyond = points[cells].mean(axis=1)[:, 0] > 0.5 * SIDE
    halves = np.concatenate([points, points[copied]]), np.where(beyond[:, None], copy[cells], cells)
    monkeypatch.setattr(mesh_module, "_check_bodies", lambda *_: None)  # one label, two pieces
    mesh = distribute(ALONE, [halves])
    piece = (mesh.x[mesh.cells].mean(axis=1)[:, 0] > 0.5 * SIDE).astype(np.int32)
    mesh = replace(mesh, piece_of_cell=piece)
    twin = Simulation(mesh, [material], element=element)
    ours, theirs = s.mesh.named_nodes, mesh.named_nodes
    assert s.mesh.num_nodes == len(points) + 25
    assert len(s.mesh.facets) == len(mesh.facets) == 6 * 32 + 2 * 32
    assert twin.solid.mass[theirs] == pytest.approx(s.solid.mass[ours], rel=1e-14)
    tables, own, common = snapshot(s)
    tables = as_arrays(tables)
    restore(twin, {name: dict(table) for name, table in tables.items()}, own, common)
    f = np.zeros_like(mesh.x)
    twin.solid.add_internal_forces(f, twin.state, 0.0)
    assert f[theirs] == pytest.approx(s.specimen.f[ours], abs=1e-12 * abs(f).max())
    for one in (s, twin):
        for _ in range(60):
            one.step()
    assert s.energies() == pytest.approx(twin.energies(), rel=1e-9, abs=1e-14)
    ours, theirs = (as_arrays(snapshot(one)[0]) for one in (s, twin))
    del ours["topology"], ours["pieces"]
    for name in ("pairs", "candidates", "edge_pairs"):  # facets have other numbers, and so an order
        del ours[name], theirs[name]
    assert ours.keys() == theirs.keys()
    for name, table in ours.items():
        assert_same(table, theirs[name], name, rel=1e-9)
    assert (s.state.plastic_strain.max() > 0) == (material is YIELDING)


def test_facets_that_part_nothing_change_nothing_and_wait():
    s, other = (free_cube(YIELDING, steps=10) for _ in range(2))
    nodes, cells = s.mesh.inner_facets()
    centre = (np.abs(s.mesh.x[nodes] - 0.5 * SIDE) < 1e-9).all(axis=-1).any(axis=1)
    around = cells[centre & middle(s.mesh.x[nodes]).all(axis=1)]
    s.grow(around[:1])
    assert s.mesh.version == 0
    for _ in range(20):
        for simulation in (s, other):
            simulation.step()
    for name in ("x", "v", "a", "deviator", "plastic_strain"):
        assert np.array_equal(getattr(s.state, name), getattr(other.state, name))
    # The node in the middle parts by all of the facets around it in that plane.
    assert len(around) == 6 and other.mesh.grow(around[1:]) is other.mesh
    assert s.mesh.grow(around[1:]).num_nodes == s.mesh.num_nodes + 1


def pressed(comm, steps=60, **options):
    """A cube at a wall, a second one that comes with friction, a third one far away."""
    places = SIDE * np.array([[1.001, 0.1, 0.1], [5.0, 0.0, 0.0]])
    bodies = [CUBE, *(box((SIDE,) * 3, (3, 3, 3), place) for place in places)]
    speed = np.array([0.0 * X, [-6.0, 3.0, 1.0], 0.0 * X])
    s = build(
        comm, bodies, YIELDING, (0, 0, 0), (6 * SIDE,) * 3, "x", {"x_min": 0.3},
        lambda x, grain: speed[grain], friction=0.3, **options,
    )  # fmt: skip
    for _ in range(steps):
        s.step()
    return s


def closed(tables, name, kept):
    """What closed pairs remember but what a search books, each column in increasing order."""
    table, kept = tables[name], set(kept) - {"work", "known"}
    return {key: np.sort(table[key][table["closed"]], axis=0) for key in kept}


def of_pairs(s):
    """Work of friction of each pair of grains on this rank [J]."""
    c = s.contact
    return c.dissipation.totals(c.pairs, c.walls.pairs, c.edges.pairs)


@pytest.mark.mpi
def test_growth_leaves_contact_energies_and_momentum_as_they_are():
    s = pressed(COMM)
    before, tables = s.energies(), as_arrays(contact_tables(s.contact, s.mesh))
    accounts = of_pairs(s)
    f, mass, old = s.specimen.f.copy(), s.solid.mass, s.state
    walls, momentum = s.wall_forces(), COMM.allreduce(mass @ old.v)
    assert min(before[name] for name in ("friction", "plastic_dents", "contact", "plastic")) > 0
    searches, rate = s.contact.num_searches, 2.0 / s.stable.of_tets()
    s.stable.rate_of_tets = 0.0  # the cut grain has the finest mesh, and so the highest frequency
    s.grow(between(s.mesh, middle))
    assert s.mesh.version == 1 and s.state is not old
    # New facets look for others at once.
    assert s.contact.num_searches == searches + 1
    # Parts of nodes have higher frequencies, found to 2 % (the iteration's residual).
    highest = 2.0 / s.stable.of_tets()
    assert rate < highest < 1.02 * s.stable.rate_of_tets
    assert s.state.a == pytest.approx(s.specimen.f / s.solid.mass[:, None], rel=1e-12)
    after, now = s.energies(), as_arrays(contact_tables(s.contact, s.mesh))
    same = ("friction", "switching", "contact", "damping", "work", "plastic", "plastic_dents")
    for name in same:
        assert after[name] == pytest.approx(before[name], rel=1e-14), name
    total = before["kinetic"] + before["elastic"]
    assert after["residual"] == pytest.approx(before["residual"], abs=1e-14 * total)
    assert np.array_equal(s.wall_forces(), walls)
    source = s.mesh.source.nodes
    for name in ("x", "u", "v"):
        assert np.array_equal(getattr(s.state, name), getattr(old, name)[source])
    beside = ~np.isin(np.arange(s.mesh.num_nodes), s.mesh.cells[np.isin(
        s.mesh.cells, np.flatnonzero(np.bincount(source)[source] > 1)).any(axis=1)])  # fmt: skip
    assert np.array_equal(s.specimen.f[beside], f[source][beside])
    assert np.array_equal(s.solid.mass[beside], mass[source][beside])
    assert np.array_equal(s.state.a[beside], old.a[source][beside])
    whole = COMM.allreduce(np.append(s.solid.mass @ s.state.v, s.solid.mass.sum()))
    first = np.append(momentum, COMM.allreduce(mass.sum()))
    assert whole == pytest.approx(first, rel=1e-14)
    assert COMM.allreduce(s.specimen.f.sum(axis=0)) == pytest.approx(
        COMM.allreduce(f.sum(axis=0)), abs=1e-13 * COMM.allreduce(np.abs(f).sum())
    )
    for name, pairs in (("pairs", s.contact.pairs), ("wall_pairs", s.walls.pairs)):
        ours, theirs = (closed(of, name, pairs.kept) for of in (tables, now))
        for key in ours:
            assert np.array_equal(ours[key], theirs[key]), (name, key)
    for key in ("dent", "beyond", "slip"):
        ours, theirs = (np.sort(of["points"][key][of["points"][key] != 0]) for of in (tables, now))
        assert np.array_equal(ours, theirs), key
    assert np.array_equal(of_pairs(s)[1], accounts[1])
    assert of_pairs(s)[2] == pytest.approx(accounts[2], rel=1e-14)
    limit = max(abs(after["residual"]), 1e-4 * total)
    for _ in range(60):
        s.step()
    end = s.energies()
    assert abs(end["residual"]) < 10 * limit
    assert end["friction"] > after["friction"]


@pytest.mark.mpi
def test_a_crack_that_ends_in_a_contact_closes_the_balance():
    """The surface beside it stays as smooth as it was: the contact bears and stores the same."""
    points, cells = sphere(RADIUS, 0.3 * RADIUS)
    bodies = [(points + place * RADIUS * X, cells) for place in (0.0, 2.002, 6.0)]
    speed = np.array([[-5.0, 0.0, -1.0], [5.0, 0.0, 1.0], [0.0] * 3])[[1, 0, 2]]
    s = build(
        COMM, bodies, ELASTIC, (0, 0, 0), (1, 1, 1), "", friction=0.3,
        velocity=lambda x, grain: speed[grain],
    )  # fmt: skip
    while s.state.t < 4e-6:
        s.step()
    cells = s.mesh.inner_facets()[1]
    beyond = s.mesh.x[s.mesh.cells].mean(axis=1)[:, 1] > 0.0
    first = s.mesh.grains[s.mesh.grain_of_cell[cells[:, 0]]] == 0
    before = s.energies()
    s.grow(cells[first & (beyond[cells[:, 0]] != beyond[cells[:, 1]])])
    after = s.energies()
    assert after["contact"] == pytest.approx(before["contact"], rel=1e-12, abs=0.0)
    assert after["residual"] == pytest.approx(before["residual"], abs=1e-13 * before["kinetic"])
    for _ in range(60):
        s.step()
    assert abs(s.energies()["residual"]) < 1e-3 * before["kinetic"]


def test_a_closed_crack_beneath_a_contact_changes_nothing():
    """A ball is drawn over the mouth of one half through a cube: points in facets bear the same."""
    points, cells = sphere(0.5 * SIDE, 0.15 * SIDE, (0.4 * SIDE, 0.53 * SIDE, 1.51 * SIDE))
    ways, found = SIDE * np.array([[0.0, 0.0, -0.04], *[[0.04, 0.0, 0.0]] * 5]), []
    for cracked in (False, True):
        s = build(ALONE, [CUBE, (points, cells)], ELASTIC, (0, 0, 0), (SIDE,) * 3, "")
        if cracked:
            s.grow(between(s.mesh, lambda x: middle(x) & (x[..., 2] > 0.49 * SIDE)))
        contact, x = s.contact, s.mesh.x.copy()
        for way in np.repeat(ways, 20, axis=0):
            x[s.mesh.grain_of_node == 1] += way / 20
            contact.begin_step(x)
            contact.add_forces(np.zeros_like(x), x)
            of_facets = contact.pairs.node < contact.points.num_in_facets
            found.append(np.sort(contact.pairs.normal_force[contact.pairs.closed & of_facets]))
    for whole, cracked in zip(found[: len(found) // 2], found[len(found) // 2 :], strict=True):
        # The cube lies as it did: to the rounding of gaps.
        np.testing.assert_allclose(cracked, whole, rtol=1e-9)
    assert whole.size > 5


def pressed_on(mesh, walls):
    """Such a simulation as of :func:`pressed` on a mesh."""
    return Simulation(mesh, [YIELDING] * mesh.num_grains, walls, friction=0.3)


def written(s, folder, make=pressed_on):
    """Write a checkpoint; gives what brings another one to it, made by ``make(mesh, walls)``."""
    tables, own, common = snapshot(s)
    ranks = s.mesh.rank_of_grain
    header = {"state": common, "rank_of_grain": ranks.tolist(), "written_by": ranks.tolist()}
    path = CheckpointWriter(COMM, folder).write(s.state.num_steps, tables, own, header)
    checkpoint = Checkpoint(path, COMM.size, header)

    def go_on(other):
        mesh = other.mesh
        tables, own = read_tables(mesh.comm, checkpoint, mesh.grains, mesh.rank_of_grain)
        other = make(restore_mesh(mesh, tables), other.walls.walls)
        restore(other, tables, own, common)
        return other

    return go_on


@pytest.mark.mpi
def test_a_checkpoint_after_growth_goes_on_with_the_same_bits(tmp_path):
    """Also what waits for more: facets that parted nothing before part nodes with later ones."""
    s, other = pressed(COMM), pressed(COMM, steps=0)
    folder = COMM.bcast(tmp_path)
    s.grow(between(s.mesh, inside)[:1])
    s.step()
    s.grow(between(s.mesh, lambda x: middle(x) & (x[..., 1] < 0.51 * SIDE)))
    for _ in range(30):
        s.step()
    s.grow(between(s.mesh, inside)[-1:])
    go_on = written(s, folder)
    other = go_on(other)
    assert (other.mesh.version, other.mesh.num_nodes) == (1, s.mesh.num_nodes)
    first = None
    for _ in range(2):
        for _ in range(20):
            s.step()
            other.step()
        for name in ("x", "v", "a", "deviator", "plastic_strain"):
            assert np.array_equal(getattr(s.state, name), getattr(other.state, name)), name
        found = s.energies()
        assert found == other.energies()
        first = first or found
        for one in (s, other):
            one.grow(between(one.mesh, middle))
        assert s.mesh.version == other.mesh.version == 2
    if COMM.rank == 0:  # which reads what all ranks wrote
        alone = go_on(pressed(ALONE, steps=0))
        for _ in range(20):
            alone.step()
        assert alone.energies() == pytest.approx(first, rel=1e-9, abs=1e-16)


class Weight(ForceTerm):
    """A force of rows that a growth has to keep: m g on all nodes."""

    name = "weight"
    STATE = {"nodes": ("weights",)}
    SHARED = ("weights",)

    def __init__(self, mesh, weights):
        self.mesh, self.weights = mesh, weights

    def add_forces(self, f, state, dt):
        f += self.weights[:, None] * X

    def energy(self, state):
        return -float(self.weights @ state.u[:, 0])


class Pull(Weight):
    """One whose rows both parts of a node have whole: its potential jumps, which is booked."""

    name = "pull"
    SHARED = ()


def test_terms_and_added_mass_follow():
    """Masses, forces and the balance of energies, where each node has mass and weight added."""
    options = {"mass_scaling": MassScaling(added=0.05, added_to_grain=0.1)}
    factor = np.full(len(CUBE[0]), 1.5)
    s = free_cube(ELASTIC, gravity=[0.0, 0.0, -1e5], mass_factor=factor, **options)
    s.damping = 100.0
    s.add_term(Weight(s.mesh, 1e5 * s.solid.mass))
    s.add_term(Pull(s.mesh, 1e5 * s.solid.mass))
    s.add_term(Pressure(s.mesh, 1e5))
    s.add_term(Pressure(s.mesh, 10.0, where=lambda centre, n: n[:, 2] > 0.9, name="top"))
    for _ in range(40):
        s.step()
    assert s.scaling.added.any()
    s.scaling.added_to_node[:] = 0.1 * s.scaling.first_mass
    s.scaling.set_masses()
    s.limit.take_masses()
    mass, f, before = s.solid.mass.sum(), s.specimen.f.sum(axis=0), s.energies()
    s.grow(between(s.mesh, middle))
    after = s.energies()
    assert s.damping == 100.0 and s.mesh.num_nodes == CUBE[0].shape[0] + 25
    assert [len(term.facets) for term in s.specimen.added_terms[3:]] == [192, 32]
    assert s.solid.mass.sum() == pytest.approx(mass, rel=1e-14)
    assert s.specimen.f.sum(axis=0) == pytest.approx(f, abs=1e-9 * abs(f).max())
    for name in (*s.specimen.energy_columns, "damping"):
        assert after[name] == pytest.approx(before[name], rel=1e-12), name
    size = before["kinetic"] + before["elastic"]
    assert after["residual"] == pytest.approx(before["residual"], abs=1e-13 * size)
    for _ in range(200):
        s.step()
    assert s.energies()["residual"] == pytest.approx(before["residual"], abs=0.01 * size)
    assert s.solid.mass.sum() == pytest.approx(mass, rel=1e-14)


def test_the_front_of_a_crack_is_no_convex_edge():
    """Its facets lie on each other: which way they turn is rounding, and their bisector nothing."""
    corner = [0.123, 0.0456, 0.789]
    mesh = distribute(ALONE, [(CUBE[0] + corner, CUBE[1])])
    half = between(mesh, lambda x: middle(x - corner) & (x[..., 1] - corner[1] < 0.51 * SIDE))
    s = Simulation(mesh.grow(half), [ELASTIC])
    own, x = s.contact.own, s.mesh.x - corner
    facet, edge = np.nonzero(own.sharp_edge)
    ends = x[own.nodes[own.facets[facet, [edge, (edge + 1) % 3]]]]
    faces = (ends < 1e-9) | (ends > SIDE - 1e-9)
    assert len(facet) > 96 and (faces.sum(axis=(0, 2)) >= 2).all()
    assert np.isfinite(s.contact.layers.compliance_of_edge).all()


GLUED = Wall("base", 0 * Z, Z, bonded=True, velocity=0.5 * Z)
COMING = box((SIDE, SIDE, 0.2 * SIDE), (1, 1, 1), 1.001 * SIDE * Z)


@pytest.mark.parametrize(
    ("materials", "options"),
    [
        ([ELASTIC] * 2, {"walls": [GLUED]}),
        ([ELASTIC] * 2, {"walls": [Wall("base", 0 * Z, Z, mirror=True)]}),
        ([ELASTIC] * 2, {"walls": [Wall("base", -1e-6 * Z, Z, target=0.1, speed=1.0)]}),
        ([ELASTIC] * 2, {"law": "kinematic"}),
        ([ELASTIC] * 2, {"points": "nodes"}),
        ([ELASTIC, Rigid(1e9, 0.2, 2500.0)], {}),
        ([Auto(1e9, 0.2, 2500.0, ((0.0, 1e6),)), ELASTIC], {}),
        ([NeoHookean(1e6, 0.4, 1000.0), ELASTIC], {}),
        ([YIELDING] * 2, {"tools": [Tool("ram", *COMING, velocity=-2 * Z)]}),
    ],
    ids=["glued", "mirror", "servo", "kinematic", "nodes", "rigid", "released", "rubber", "tool"],
)
def test_what_holds_and_moves_a_grain_goes_on(materials, options):
    """Forces, motion and the balance of energy; the kinematic law keeps none while bodies touch."""
    bodies = [CUBE, box((SIDE,) * 3, (2, 2, 2), [1.001 * SIDE, 0.1 * SIDE, 0.0])]
    speed = np.array([0.0 * X, [-4.0, 1.0, 0.0], 0 * X])
    s = build(
        ALONE, bodies, materials, (0, 0, 0), (SIDE,) * 3, "", friction=0.3,
        velocity=lambda x, grain: speed[grain], **options,
    )  # fmt: skip
    while s.state.t < 2e-6:
        s.step(everywhere=False)
    s.complete()
    old, before, walls, loads = s.state, s.energies(), s.wall_forces(), s.tools.reaction.copy()
    size = 1e-3 * before["kinetic"]
    left = [weakref.ref(part) for part in (s.mesh, s.solid, s.contact, s.specimen, s.stable)]
    gc.disable()
    s.grow(between(s.mesh, middle))
    there = [part() for part in left]
    gc.enable()
    assert there == [None] * len(left)  # thousands of growths follow each other
    after = s.energies()
    source = s.mesh.source.nodes
    assert s.mesh.num_nodes == len(source) == len(old.x) + 25
    for name in ("x", "u", "v"):
        assert np.array_equal(getattr(s.state, name), getattr(old, name)[source])
    assert np.array_equal(s.wall_forces(), walls) and np.array_equal(s.tools.reaction, loads)
    assert after["residual"] == pytest.approx(before["residual"], abs=1e-10 * size)
    while s.state.t < 4e-6:
        s.step(everywhere=False)
    for wall in s.walls.walls:
        held = np.abs(wall.gap(s.mesh.x)) < 1e-12
        if wall.bonded or wall.mirror:
            assert held.sum() == 25 + 5 + 9
            height = s.walls.point[0, 2]
            assert s.state.x[held, 2] == pytest.approx(height, abs=1e-15)
    assert "law" in options or abs(s.energies()["residual"] - before["residual"]) < 10 * size


def test_bonds_hold_the_nodes_that_keep_their_names():
    upper = CUBE[0] + SIDE * Z, CUBE[1]
    s = build(
        ALONE, [CUBE, upper], ELASTIC, (0, 0, 0), (SIDE,) * 3, "",
        velocity=lambda x, grain: np.where(grain == 1, 1.0, -1.0)[:, None] * Z,
    )  # fmt: skip
    s.add_term(bonds_of_the_page()(s.mesh, 1e5, 1e-4))
    for _ in range(30):
        s.step()
    before, bonds = s.energies(), s.specimen.added_terms[0].bonds
    s.grow(between(s.mesh, middle))
    (term,) = s.specimen.added_terms
    assert term.mesh is s.mesh and len(term.bonds["whole"]) == 25
    for name, values in term.bonds.items():
        assert np.array_equal(values, bonds[name])
    after = s.energies()
    assert after["energy_bonds"] == before["energy_bonds"] > 0
    first, second = np.split(term.far.positions(s.state.x), 2)
    assert np.array_equal(second - first, term.bonds["apart"])
    for _ in range(100):
        s.step()
    size = before["kinetic"] + before["elastic"]
    assert abs(s.energies()["residual"] - before["residual"]) < 1e-2 * size


class Nameless(ForceTerm):
    """A term that says nothing of its nodes."""

    name = "nameless"


@pytest.mark.parametrize(
    ("open_in", "line"),
    [
        (lambda s: [[0, s.mesh.num_cells]], r"between the cells 0 and \d+, expected two of \d+"),
        (lambda s: [[0, 0]], "between the cells 0 and 0, expected two of"),
        (lambda s: [[0, s.mesh.num_cells - 1]], "expected two of .* that share a facet"),
        (lambda s: [[0.5, 1.0]], "facets to open of shape .* whole numbers"),
        (lambda s: [0, 1], "facets to open of shape"),
        (lambda s: between(s.mesh, lambda x: x[..., 0] > SIDE, 2)[:1], "in the rigid grain 2"),
        (lambda s: s.add_term(Nameless()) or between(s.mesh, middle), "nameless names no mesh"),
    ],
)
def test_what_cannot_open_is_one_line(open_in, line):
    bodies = [CUBE, box((SIDE,) * 3, (1, 1, 1), 2 * SIDE * X)]
    materials = [ELASTIC, Rigid(1e9, 0.2, 2500.0) if "rigid" in line else ELASTIC]
    s = build(ALONE, bodies, materials, (0, 0, 0), (SIDE,) * 3, "")
    parts = s.mesh, s.state
    with pytest.raises(InputError, match=line):
        s.grow(open_in(s))
    assert (s.mesh, s.state) == parts and s.mesh.opened == []
    s.step()


def test_increments_of_a_mesh_that_has_grown():
    """A cube that is cut along its axis under pressure is as stiff as one that is whole."""
    forces = []
    for cut in (False, True):
        for solver in ("direct", "products"):
            mesh = distribute(ALONE, [CUBE])
            mesh = mesh.grow(between(mesh, middle)) if cut else mesh
            top = Wall("top", SIDE * Z, -Z, velocity=[0, 0, -1e-3 * SIDE])
            walls = [Wall("low", 0 * X, Z), top]
            s = simulate(mesh, [Elastic(1e9, 0.0, 2500.0)], walls, 1.0, linear_solver=solver)
            s.step()
            forces.append(s.wall_forces()[1])
            assert s.u.x.array == pytest.approx(s.state.u[mesh.node_of_dof].ravel())
    assert forces == pytest.approx(4 * forces[:1], rel=1e-4)


def test_increments_and_membranes_do_not_grow():
    s = build(ALONE, [CUBE], ELASTIC, (0, 0, 0), (SIDE,) * 3, increment=1e-3)
    with pytest.raises(InputError, match="growth of the mesh in increments"):
        s.grow(between(s.mesh, middle))
    s = build(
        ALONE, [CUBE, box((SIDE,) * 3, (1, 1, 1), 2 * SIDE * X)], ELASTIC, (0, 0, 0), (SIDE,) * 3,
        "", sleeves=["sleeve"],
    )  # fmt: skip
    with pytest.raises(InputError, match="membrane sleeve beside a mesh that grows"):
        s.grow(between(s.mesh, middle))


def test_nodes_that_become_vertices_in_a_contact_carry_from_there_on():
    """A ball between walls, so coarse that its poles are behind them and carry nothing, is cut."""
    points, cells = sphere(0.5e-3, 0.1e-3)
    s = build(ALONE, [(points, cells)], ELASTIC, points.min(axis=0), points.max(axis=0), axes="z")
    s.walls.velocity[s.walls.names.index("z_max"), 2] = -1.0
    while s.state.t < 2e-6:
        s.step()
    s.walls.velocity[:] = 0.0
    assert not s.contact.counts()[0]
    _, pairs = s.mesh.inner_facets()
    right = s.mesh.x[s.mesh.cells].mean(axis=1)[:, 0] > 0.0
    s.grow(pairs[right[pairs[:, 0]] != right[pairs[:, 1]]])
    for _ in range(20):
        s.step()
    assert not s.wall_forces().any() and s.kinetic_energy() == 0.0
