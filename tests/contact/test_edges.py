"""Crossing edges: search and forces against slow twins."""

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.bulk.solid import Solid
from mufe_fenicsx.contact.pairs.table import RowTable
from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.kernels.build.pair_rows import EDGE_PAIR
from mufe_fenicsx.kernels.contact.edge_search import (
    find_edge_pairs,
    list_sharp_edges,
    segment_distance,
    sharp_edges,
    sort_edges_into_cells,
)
from mufe_fenicsx.kernels.contact.edges import EdgeForces, edge_energy
from mufe_fenicsx.kernels.geometry.rings import neighbours, rings
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.mesh import create_grain_mesh
from mufe_fenicsx.verification.sliding_normal import ridge

#: Outward facets of a tetrahedron with positive volume.
TET = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], dtype=np.int32)


def two_tets(rng):
    """Edge 0-1 of the first tetrahedron above edge 4-5 of the second, crossing, turned."""
    upper = np.array([[-1.0, 0, 0], [1, 0, 0], [0, 0.8, 1.5], [0, -0.9, 1.4]])
    lower = np.array([[0.0, -1, 0], [0, 1, 0], [-0.8, 0, -1.5], [0.9, 0, -1.4]])
    x = np.vstack([upper, lower]) + 0.1 * rng.standard_normal((8, 3))
    q, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return x @ (q * np.sign(np.linalg.det(q))).T


ENDS = np.array([[0, 1], [4, 5]], dtype=np.int32)
BEYOND = np.array([[2, 3], [6, 7]], dtype=np.int32)


def test_distance_of_segments_against_sampling():
    rng = np.random.default_rng(0)
    s = np.linspace(0, 1, 201)
    for _ in range(100):
        x = rng.standard_normal((4, 3))
        d = segment_distance(x, 0, 1, 2, 3)
        p = x[0] + s[:, None] * (x[1] - x[0])
        q = x[2] + s[:, None] * (x[3] - x[2])
        sampled = np.linalg.norm(p[:, None] - q[None], axis=2).min()
        spacing = 0.5 * (np.linalg.norm(x[1] - x[0]) + np.linalg.norm(x[3] - x[2])) / 200
        # No sample is nearer, and one is within a spacing of both.
        assert d <= sampled * (1 + 1e-12) <= d + 2 * spacing


def test_sharp_edges_of_a_tetrahedron_and_none_of_what_is_flat_or_concave():
    x = np.array([[1.0, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]])
    if np.linalg.det(x[1:] - x[0]) < 0:
        x[[0, 1]] = x[[1, 0]]
    numbers = np.arange(4)
    for sign, angle, expected in ((1, 20, 6), (1, 109, 6), (1, 110, 0), (-1, 20, 0)):
        # Turned inside out all its edges are concave; normals differ by 109.5 degrees.
        facets = TET[:, ::sign].copy()
        cosine = np.cos(np.radians(angle))
        across = neighbours(facets, *rings(facets, len(x)))
        sharp = sharp_edges(x, facets, across, cosine)
        ends, beyond, sides, key = list_sharp_edges(facets, across, numbers, sharp)
        assert len(ends) == expected and np.unique(key).size == expected
        for e, o, f in zip(ends, beyond, sides, strict=True):
            assert {*e, *o} == {0, 1, 2, 3}
            assert {*e, o[0]} == set(facets[f[0]]) and {*e, o[1]} == set(facets[f[1]])


def test_edge_pairs_against_all_pairs():
    rng = np.random.default_rng(1)
    n, num_own, reach = 300, 180, 0.12
    x = np.empty((2 * n, 3))
    x[::2] = rng.random((n, 3))
    x[1::2] = x[::2] + 0.15 * rng.standard_normal((n, 3))
    ends = np.arange(2 * n, dtype=np.int32).reshape(n, 2)
    grain = rng.integers(0, 5, n).astype(np.int32)
    low = x[: 2 * num_own].min(axis=0)
    size = 0.2
    shape = tuple((np.ptp(x[: 2 * num_own], axis=0) / size).astype(np.int64) + 1)
    cells = sort_edges_into_cells(x, ends, num_own, low, size, shape)
    own, other = find_edge_pairs(x, ends, grain, grain, num_own, reach, low, size, shape, *cells)
    found = sorted(zip(own.tolist(), other.tolist(), strict=True))
    twin = [
        (i, j)
        for i in range(num_own)
        for j in range(n)
        if grain[i] < grain[j] and segment_distance(x, *ends[i], *ends[j]) <= reach
    ]
    assert found == twin and len(twin) > 100


class Pair(RowTable):
    """State of one pair of edges."""

    def __init__(self):
        super().__init__(EDGE_PAIR, 1, 0.0)
        self.second[:], self.outside[:], self.gap[:] = 1, 0.0, 0.0
        self.largest_depth[:], self.size[:], self.ratio[:] = 10.0, 1.0, 0.9
        one = np.ones(2)
        self.edges = SimpleNamespace(
            ends=ENDS, beyond=BEYOND, area=one, layer=one, share=np.ones((2, 2)),
            compliance=np.zeros(2),
        )  # fmt: skip

    def force(self, x, friction=1e9, bound=10.0, accept=False, kinetic=None):
        f, kinetic = np.zeros_like(x), friction if kinetic is None else kinetic
        both = np.array([[friction, kinetic]])
        self.lost = EdgeForces(self, self.edges, both, x, f)(bound, accept)
        return f

    def energy(self):
        return edge_energy(self.state, self.closed)[0]


def pressed(x, depth):
    """Move the second body into the first one along the normal of the crossing, which is given."""
    pair = Pair()
    pair.force(x)
    n = pair.normal[0].copy()
    x[4:] += (pair.gap[0] + depth) * n
    return n


@pytest.mark.parametrize("compliance", [0.0, 0.7])
@pytest.mark.parametrize("seed", range(5))
def test_forces_are_the_gradient_of_the_energy_and_in_balance(seed, compliance):
    """Stuck and pressed: f = -dU/dx in normal and tangential direction, no net force or moment.

    With the stiffness that changes along both edges, too.
    """
    rng = np.random.default_rng(seed)
    x = two_tets(rng)
    pressed(x, 0.05)
    pair = Pair()
    pair.edges.compliance[:] = compliance, 2.0 * compliance
    pair.force(x)  # closes with its stick points at the crossing
    assert pair.closed[0]
    x = x + 0.03 * rng.standard_normal(x.shape)
    f = pair.force(x)
    assert pair.outside[0] <= 0
    size = np.abs(f).max()
    assert np.linalg.norm(pair.shear) > 1e-3
    # Round-off, over the square of the sine between the edges.
    assert np.abs(f.sum(axis=0)).max() < 1e-14 * size
    assert np.abs(np.cross(x, f).sum(axis=0)).max() < 1e-13 * size

    numeric, step = np.zeros_like(x), 1e-6
    for i in np.ndindex(x.shape):
        d = np.zeros_like(x)
        d[i] = step
        sides = []
        for y in (x + d, x - d):
            pair.force(y)
            sides.append(pair.energy())
        numeric[i] = -(sides[0] - sides[1]) / (2 * step)
    # Central differences: step² and eps/step.
    np.testing.assert_allclose(f, numeric, atol=1e-8 * size)


def test_looking_when_it_is_due_finds_what_looking_always_does():
    """Bodies that tumble past each other; bounds by how far their nodes moved."""
    rng = np.random.default_rng(11)
    closed = looked = 0
    for k in range(40):
        x, bound = two_tets(rng), 0.0
        n = pressed(x, -0.4 * rng.random())
        spin, way = 0.02 * rng.standard_normal((2, 3)), 0.01 * rng.standard_normal((2, 3))
        if k % 2:  # straight on
            spin[:], way[:] = 0.0, [0.0 * n, 0.005 * n]
        lazy, eager = Pair(), Pair()
        for _ in range(150):
            move = np.repeat(way, 4, axis=0) + np.cross(np.repeat(spin, 4, axis=0), x)
            x += move
            bound += np.linalg.norm(move[:4], axis=1).max() + np.linalg.norm(move[4:], axis=1).max()
            eager.next_check[:] = np.minimum(eager.next_check, bound)
            before = lazy.next_check[0]
            f = lazy.force(x, 0.3, bound)
            np.testing.assert_array_equal(f, eager.force(x, 0.3, bound))
            looked += before <= bound
            closed += bool(eager.closed[0])
    assert closed > 300 and looked < 0.9 * 40 * 150


def test_friction_of_a_crossing():
    """Dragged along both edges it slips at mu N; the work of the drag is stored or dissipated."""
    rng = np.random.default_rng(7)
    x = two_tets(rng)
    n = pressed(x, 0.05)
    mu, pair = 0.3, Pair()
    before = pair.force(x, mu)
    way = 0.1 * ((x[1] - x[0]) / 2 + (x[5] - x[4]) / 3)
    way -= n * n.dot(way)
    work = dissipated = 0.0
    steps = 400
    for _ in range(steps):
        x[:4] += way / steps
        now = pair.force(x, mu)
        dissipated += pair.lost[0]
        work -= (0.5 * (before + now)[:4].sum(axis=0)).dot(way / steps)
        before = now
    N = pair.stiffness[0] * -pair.gap[0]
    assert pair.gap[0] == pytest.approx(-0.05, abs=1e-12)
    drag = np.linalg.norm(pair.shear[0])
    assert drag == pytest.approx(mu * N, rel=1e-12)
    # Against the motion, which is straight.
    assert pair.shear[0] @ way == pytest.approx(-drag * np.linalg.norm(way), rel=1e-9)
    stored = 0.5 * drag**2 / (pair.stiffness[0] * pair.ratio[0])
    # Trapezoidal rule but for the one step in which slip begins.
    assert work == pytest.approx(stored + dissipated, rel=1e-3 / steps)
    assert dissipated > 0
    assert pair.slip[0] * mu * N == pytest.approx(dissipated, rel=1e-2)


def test_a_crossing_slips_at_the_kinetic_coefficient():
    """It holds up to the static one, then slips at the kinetic one until it sticks."""
    rng = np.random.default_rng(7)
    x = two_tets(rng)
    pressed(x, 0.05)
    static, kinetic, pair = 0.5, 0.2, Pair()
    along = (x[1] - x[0]) / np.linalg.norm(x[1] - x[0])
    ratios = []
    for step in (*[1e-4] * 400, -2e-4, 0.0):
        x[:4] += step * along
        pair.force(x, static, kinetic=kinetic)
        ratios.append(np.linalg.norm(pair.shear[0]) / (pair.stiffness[0] * -pair.gap[0]))
    slipping = np.isclose(ratios, kinetic, rtol=1e-9)
    first = int(np.argmax(slipping[1:])) + 1
    # One step adds kt 1e-4 to the spring, 0.9 of 1e-4 over the depth of N.
    assert ratios[first - 1] == pytest.approx(static, abs=0.9 * 1e-4 / 0.05)
    assert slipping[first:400].all() and pair.slip[0] > 0
    assert not pair.sliding[0] and ratios[-1] < kinetic


def test_a_crossing_moves_on_along_a_ridge():
    """Two ridges slide along one of them: past its nodes one crossing takes over from the next.

    The depth stays. The spring is the same at all places, but for what the mesh lacks of compliance
    between nodes, 1/k = 1/k₀ + Σ ξ (1 - ξ) D, and friction works mu N along the way.
    """
    n, depth, friction = 8, 2e-3, 0.3  # edges at the ends of a ridge are softer
    (lower, cells), (upper, _) = ridge(n), ridge(n)
    lower, upper = lower - [0.013, 0, 0], upper - [0.021, 0, 0]
    upper = upper @ np.array([[0, 1.0, 0], [1, 0, 0], [0, 0, -1]]) + [0, 0, 1e-4]
    mesh = create_grain_mesh(
        MPI.COMM_SELF,
        np.vstack([lower, upper]),
        np.vstack([cells, cells + len(lower)]),
        np.repeat([0, 1], len(cells)),
        np.array([1, 2]),
        np.array([0, 0]),
    )
    material = Elastic(100e9, 0.15, 2650.0)
    contact = Simulation(mesh, [material] * 2, friction=friction, points="nodes").contact
    above = mesh.grain_of_node == np.flatnonzero(mesh.grains == 1)[0]
    x = mesh.x.copy()

    def move(vector):
        x[above] += vector
        contact.begin_step(x)
        contact.add_forces(np.zeros_like(x), x)
        pairs = contact.edges.pairs
        return pairs, np.flatnonzero(pairs.closed)

    def between(pairs, on):
        place, D = pairs.place[on].clip(0, 1), contact.edges.edges.compliance
        return (place * (1 - place) * D[np.column_stack([pairs.first, pairs.second])[on]]).sum(1)

    def keys_of_closed():
        edges = contact.edges
        return edges.keys(edges.edges.key)[edges.pairs.closed].tolist()

    for _ in range(20):
        pairs, on = move([0, 0, -(depth + 1e-4) / 20])
    keys = set(keys_of_closed()[:1])
    before, steps, way, k = contact.dissipation.total, 600, 1.5 / n, []
    softness = 1 / pairs.stiffness[on[0]] - between(pairs, on)[0]
    for _ in range(steps):
        pairs, on = move([way / steps, 0, 0])
        keys.update(keys_of_closed())
        # Rigid motion: the depth is kept to rounding of positions.
        assert pairs.gap[on] == pytest.approx(-depth, rel=1e-9)
        # Beside a node one fades out while the next one fades in.
        assert 1 <= on.size <= 2
        parts = pairs.stiffness[on] * (softness + between(pairs, on))
        assert parts.sum() == pytest.approx(1, rel=1e-9)
        k.append(pairs.stiffness[on].sum())
        # On the lower one along the motion: the spring is carried over past the node.
        assert np.all(pairs.shear[on, 0] > 0)
    assert len(keys) >= 2 and max(k) > 1.2 * min(k)
    assert np.linalg.norm(pairs.shear[on[0]]) == pytest.approx(friction * k[-1] * depth, rel=1e-9)
    slip = contact.dissipation.total - before
    # Less the way until it slips, mu N / kt: 2e-3 of the whole.
    assert slip == pytest.approx(friction * np.mean(k) * depth * way, rel=2e-3)
    # A search whose reach is the depth of points, which are far away, keeps it.
    before, force = keys_of_closed(), pairs.shear[on].copy()
    contact.search(x, skin=0.1 * depth / contact.edge)
    assert contact.motion.reach < depth and keys_of_closed() == before
    pairs, on = move([0, 0, 0])
    assert pairs.shear[on] == pytest.approx(force, rel=1e-9)


def test_a_crossing_that_comes_in_beside_one_that_stays_begins_without_force():
    """An edge lies across both legs of a ridge with a kink, near its node, as deep in both.

    One crossing carries, farther from its end than it fades out. The other one comes in from the
    side, when its facets turn: it takes nothing over, or each time it did energy would come from
    nowhere.
    """
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    nodes = [[-c, s, 0], [0, 0, 0], [c, s, 0]]  # of the ridge of the first body, which lies above
    facets = [[-c - 0.4, s - 0.7, 1], [-c + 0.4, s + 0.7, 1], [0, 0, 0], [0, 0, 0]]
    edge = [[-1, 0.015, 0.02], [1, 0.015, 0.02], [0, 0.8, -1], [0, -0.8, -1]]
    x, leg, across = np.array([*nodes, *facets, *edge]), np.array([c, s, 0]), np.array([-s, c, 0])

    def turn(angle):
        """Facets of the second leg, about it: at 0 their normals enclose the direction down."""
        down, side = [0, 0, 1], across
        for row, sign in ((5, 1), (6, -1)):
            a = angle + sign * 0.7
            x[row] = leg + np.sin(a) * side + np.cos(a) * np.array(down)

    pairs = RowTable(EDGE_PAIR, 2, 0.0)
    pairs.first[:], pairs.second[:], pairs.size[:] = [0, 1], 2, 1.0
    pairs.largest_depth[:], pairs.ratio[:] = 10.0, 0.9
    pairs.edges = SimpleNamespace(
        ends=np.array([[0, 1], [1, 2], [7, 8]], np.int32),
        beyond=np.array([[3, 4], [5, 6], [9, 10]], np.int32),
        area=np.ones(3), layer=np.ones(3), share=np.array([[0.5, 1.0], [1.0, 0.5], [0.5, 0.5]]),
        compliance=np.zeros(3),
    )  # fmt: skip

    def force():
        f = np.zeros_like(x)
        EdgeForces(pairs, pairs.edges, np.array([[0.3, 0.3]]), x, f)(0.0, False)
        return -f[7:, 2].sum()

    def press(depth):
        x[7:9, 2] = depth
        return force()

    out = 1.0  # its normals end 0.13 before the direction down, and 0.1 are allowed
    turn(out)
    press(-1e-6)
    pairs.next_check[:] = -1.0
    carried = press(0.02)
    assert pairs.closed.tolist() == [True, False]
    assert 0.02 < 1 - pairs.place[0, 0] < 0.04
    for angle in np.linspace(out, 0.5, 30):
        turn(angle)
        pairs.next_check[1] = 0.0  # is looked at
        assert force() == pytest.approx(carried, rel=1e-9)  # rounding of the place
    assert pairs.outside[1] < 0.0


@pytest.mark.parametrize("element", ["averaged", "p1"])
def test_relative_compliance_of_the_ends_of_edges(element):
    """(e1 - e2)ᵀ K⁻¹ (e1 - e2), K where all nodes are held but those around both ends.

    Against K from products of the elements, to rounding. Held nodes make it less than that of a
    large body, where the pair of forces dies out in some edges.
    """
    points, cells = ridge(4)
    rng = np.random.default_rng(5)
    points += 0.02 * rng.standard_normal(points.shape)
    mesh = create_grain_mesh(
        MPI.COMM_SELF, points, cells, np.zeros(len(cells), int), np.array([1]), np.array([0])
    )
    solid = Solid(mesh, [Elastic(3.0, 0.3, 1.0)], element)
    num = mesh.num_nodes
    K = np.zeros((3 * num, 3 * num))
    for q, column in zip(np.eye(3 * num), K.T, strict=True):
        product = np.zeros((num, 3))
        solid.add_stiffness(product, q.reshape(-1, 3), mesh.x)
        column[:] = product.ravel()
    edges = mesh.cells[rng.choice(len(mesh.cells), 20, False), :2]
    direction = rng.standard_normal((20, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    found = solid.edge_compliance(edges, direction)
    for ends, n, value in zip(edges, direction, found, strict=True):
        f = np.zeros((num, 3))
        f[ends] = n, -n
        near = np.zeros(num, dtype=bool)
        near[mesh.cells[np.isin(mesh.cells, ends).any(axis=1)]] = True
        free = np.repeat(near, 3)
        twin = f.ravel()[free] @ np.linalg.solve(K[np.ix_(free, free)], f.ravel()[free])
        assert value == pytest.approx(twin, rel=1e-10)


def test_a_pair_of_forces_on_an_edge_is_felt_by_its_neighbours_alone():
    """What is left out beyond them is below a tenth, on a ridge of six edges held at its foot."""
    points, cells = ridge(6)
    mesh = create_grain_mesh(
        MPI.COMM_SELF, points, cells, np.zeros(len(cells), int), np.array([1]), np.array([0])
    )
    solid = Solid(mesh, [Elastic(1.0, 0.2, 1.0)])
    num, z = mesh.num_nodes, mesh.x[:, 2]
    K = np.zeros((3 * num, 3 * num))
    for q, column in zip(np.eye(3 * num), K.T, strict=True):
        product = np.zeros((num, 3))
        solid.add_stiffness(product, q.reshape(-1, 3), mesh.x)
        column[:] = product.ravel()
    free = np.repeat(z > z.min() + 0.1, 3)
    top = np.flatnonzero(np.abs(mesh.x[:, 1:]).max(axis=1) < 1e-9)
    top = top[np.argsort(mesh.x[top, 0])]
    edges = np.stack([top[:-1], top[1:]], axis=1)
    found = solid.edge_compliance(edges, np.tile([0, 0, 1.0], (len(edges), 1)))
    for ends, value in zip(edges[1:-1], found[1:-1], strict=True):
        f = np.zeros((num, 3))
        f[ends, 2] = 1, -1
        whole = f.ravel()[free] @ np.linalg.solve(K[np.ix_(free, free)], f.ravel()[free])
        assert 0.9 < value / whole < 1


def test_relative_compliance_in_grains_of_few_elements():
    """Two tetrahedra: all nodes but the two are held, to rounding. A tetrahedron alone: none."""
    points = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    for cells in ([[0, 1, 2, 3]], [[0, 1, 2, 3], [1, 2, 3, 4]]):
        mesh = create_grain_mesh(
            MPI.COMM_SELF, points[: 3 + len(cells)], np.array(cells), np.zeros(len(cells), int),
            np.array([1]), np.array([0]),
        )  # fmt: skip
        solid = Solid(mesh, [Elastic(1.0, 0.25, 1.0)])
        ends = [int(np.linalg.norm(mesh.x - points[k], axis=1).argmin()) for k in (1, 2)]
        n = np.array([0.6, 0.0, 0.8])
        found = solid.edge_compliance(np.array([ends]), n[None])[0]
        if len(cells) == 1:
            assert found == 0
            continue
        K = np.zeros((6, 6))
        for k in range(6):
            q, product = np.zeros((5, 3)), np.zeros((5, 3))
            q[ends[k // 3], k % 3] = 1
            solid.add_stiffness(product, q, mesh.x)
            K[:, k] = product[ends].ravel()
        f = np.concatenate([n, -n])
        assert found == pytest.approx(f @ np.linalg.solve(K, f), rel=1e-10)
