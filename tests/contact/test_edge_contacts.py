"""Crossing edges in the contact table and in the fields at nodes."""

import mufe_fenicsx  # noqa: F401, before dolfinx: it loads MPI

# isort: split
import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.bulk.solid import Solid
from mufe_fenicsx.contact.friction import PairFriction
from mufe_fenicsx.contact.laws import COMPLIANCE, edge_of_area
from mufe_fenicsx.contact.mark import ContactMark
from mufe_fenicsx.contact.results.network import find_network, num_active_pairs
from mufe_fenicsx.contact.results.nodal_fields import nodal_contact
from mufe_fenicsx.contact.stiffness.tangent import ContactTangent
from mufe_fenicsx.explicit.simulation import Simulation
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.mesh import create_grain_mesh
from mufe_fenicsx.verification.sliding_normal import ridge
from mufe_fenicsx.verification.tets import rotation

COMM = MPI.COMM_WORLD
QUARTZ = Elastic(100e9, 0.15, 2650.0)
TURN = rotation([1.0, 2.0, -0.7], 1.1)
FRICTION = 0.3
NUM_PAIRS = 3


class Ridges:
    """Pairs of ridges across each other, the two of a pair on different ranks; rigid.

    The upper ones are moved by hand. Edges have the length 1/4. Collective.
    """

    def __init__(self, gap, friction=FRICTION, friction_kinetic=None):
        (lower, cells), (upper, _) = ridge(4), ridge(4)
        upper = upper @ np.array([[0, 1.0, 0], [1, 0, 0], [0, 0, -1]]) + [0, 0, gap]
        shift = np.array([0.013, -0.021, 0.0])
        bodies = [
            (lower if side == 0 else upper + shift * (1 + k)) + [4.0 * k, 0.0, 0.0]
            for k in range(NUM_PAIRS)
            for side in range(2)
        ]
        grain = np.arange(2 * NUM_PAIRS)
        rank_of_grain = ((grain // 2 + grain % 2) % COMM.size).astype(np.int32)
        mine = np.flatnonzero(rank_of_grain == COMM.rank)
        self.mesh = create_grain_mesh(
            COMM,
            np.concatenate([bodies[g] for g in mine]) @ TURN.T,
            np.concatenate([cells + k * len(lower) for k in range(mine.size)]),
            np.repeat(mine, len(cells)),
            grain + 1,
            rank_of_grain,
        )
        self.simulation = Simulation(
            self.mesh, [QUARTZ] * self.mesh.num_grains, friction=friction,
            friction_kinetic=friction_kinetic,
        )  # fmt: skip
        self.contact = self.simulation.contact
        self.x = self.mesh.x.copy()
        self.grain = self.mesh.grains[self.mesh.grain_of_node]
        self.f = np.zeros_like(self.x)

    def move(self, vector, steps):
        """Upper ridges, in axes of the lower ones.

        Returns:
            Normal forces on the upper ones after each step [N], shape (steps, NUM_PAIRS).
        """
        forces = []
        for _ in range(steps):
            self.x[self.grain % 2 == 1] += TURN @ vector / steps
            self.f[:] = 0.0
            self.contact.begin_step(self.x)
            self.contact.add_forces(self.f, self.x)
            forces.append(self.by_grain(self.f @ TURN[:, 2])[1::2])
        return np.array(forces)

    def dissipated(self):
        return COMM.allreduce(self.contact.dissipation.total)

    def by_grain(self, values):
        """Sums of nodal values over each grain, of all ranks."""
        total = np.zeros((2 * NUM_PAIRS, *values.shape[1:]))
        np.add.at(total, self.grain, values)
        return COMM.allreduce(total)

    def fields(self):
        """Nodal fields, and their integrals over the surface of each grain."""
        fields = nodal_contact(self.contact, self.mesh.num_nodes)
        area = np.zeros(self.mesh.num_nodes)
        area[self.contact.own.nodes] = self.contact.own.area
        return fields, *(
            self.by_grain((area * fields[name].T).T)
            for name in ("contact_pressure", "contact_shear")
        )

    def table(self):
        """Network, after a look at its balances."""
        mass = self.simulation.solid.mass
        network = COMM.bcast(find_network(self.contact, self.mesh, mass, self.x))
        # Force and moment on each grain are those of its nodes: round-off of sums.
        c, size = network.contacts, np.abs(self.f).max()
        found = network.sum_over_contacts(c.force, -c.force)
        assert np.abs(found - self.by_grain(self.f)).max() <= 1e-13 * size
        on_a = c.torque + np.cross(np.nan_to_num(c.centroid), c.force)
        found = network.sum_over_contacts(on_a, -on_a)
        assert np.abs(found - self.by_grain(np.cross(self.x, self.f))).max() <= 1e-12 * size
        # All that was dissipated is booked to its pair.
        assert c.work.sum() == pytest.approx(self.dissipated(), rel=1e-12)
        return network


def springs(vector):
    """Stiffness of the crossings after a move from the start [N/m], by theory, (NUM_PAIRS,).

    1/k = 2 c h / (E* A/2) + Σ ξ (1 - ξ) D, D as the mesh of one ridge has it.
    """
    points, cells = ridge(4)
    mesh = create_grain_mesh(
        MPI.COMM_SELF, points, cells, np.zeros(len(cells), int), np.array([1]), np.array([0])
    )
    solid = Solid(mesh, [QUARTZ])
    area = 4 * 0.5 * 0.25**2  # of the triangles at each inner node, a third
    h, modulus = edge_of_area(0.5 * 0.25**2, 1), QUARTZ.E / (1 - QUARTZ.nu**2)
    softness = np.full(NUM_PAIRS, 2 * COMPLIANCE * h / modulus / (0.5 * area / 2))
    for axis, sign in ((0, 1), (1, -1)):
        shift = np.array([0.013, -0.021])[axis] * (1 + np.arange(NUM_PAIRS)) + vector[axis]
        node, xi = np.divmod(sign * shift / 0.25, 1.0)
        for k in range(NUM_PAIRS):
            x = np.array([[0.25 * (node[k] + end), 0, 0] for end in range(2)])
            ends = np.linalg.norm(mesh.x[:, None] - x, axis=2).argmin(axis=0)
            D = solid.edge_compliance(ends[None], np.array([[0, 0, 1.0]]))[0]
            softness[k] += xi[k] * (1 - xi[k]) * D
    return 1 / softness


@pytest.mark.mpi
def test_crossing_edges_are_in_the_contact_table_and_in_the_nodal_fields():
    """Pressed and rubbed over several searches; edges touch and nothing else."""
    ridges = Ridges(gap=0.01)
    contact = ridges.contact
    forces = ridges.move([0, 0, -0.02], 20)[-1:]
    before, steps, vector = contact.num_searches, 100, np.array([0.17, -0.17, 0.0])
    for _ in range(steps):
        forces = np.vstack([forces, ridges.move(vector / steps, 1)])
        assert not contact.pairs.closed.any()
    assert contact.num_searches >= before + 2
    network = ridges.table()
    c = network.contacts
    assert c.a.tolist() == [0, 2, 4] and c.b.tolist() == [1, 3, 5]
    assert np.all(c.num_points == 1) and num_active_pairs(contact) == NUM_PAIRS
    assert network.num_active().tolist() == [1] * 2 * NUM_PAIRS

    # Edges at right angles: straight down on the lower one, friction on it along the motion.
    # Rigid motion: exact but for the rounding of positions.
    recess = COMM.allreduce(contact.edges.pairs.recess.max(initial=0.0), op=MPI.MAX)
    N, depth = c.normal_force, 0.01 - recess
    assert c.normal == pytest.approx(np.tile(-TURN[:, 2], (NUM_PAIRS, 1)), abs=1e-12)
    assert pytest.approx(springs(vector) * depth, rel=1e-9) == N
    assert forces[0] == pytest.approx(springs(np.zeros(3)) * depth, rel=1e-9)
    way = np.linalg.norm(vector)
    along = TURN @ vector / way
    assert c.friction == pytest.approx(FRICTION * N[:, None] * along, rel=1e-9, abs=1e-9 * N[0])
    # They stick until the spring is as long as mu N / kt.
    slip = way - FRICTION * depth * (2 - QUARTZ.nu) / (2 * (1 - QUARTZ.nu))
    # Trapezoidal rule but for the one step in which slip begins.
    mean = np.trapezoid(forces, axis=0) / steps
    assert c.work == pytest.approx(FRICTION * mean * slip, rel=1 / steps)

    # Traction at nodes makes up these forces on either side, and all of the slip is shared out.
    fields, normal_force, friction = ridges.fields()
    pressure, gap = fields["contact_pressure"], fields["contact_gap"]
    assert normal_force == pytest.approx(np.repeat(N, 2), rel=1e-12)
    assert np.abs(friction[0::2] - c.friction).max() < 1e-12 * N[0]
    assert np.abs(friction[1::2] + c.friction).max() < 1e-12 * N[0]
    assert np.all(pressure >= 0)
    assert gap[pressure > 0] == pytest.approx(-depth, rel=1e-9)
    assert ridges.by_grain(fields["contact_slip"]) == pytest.approx(slip, rel=1e-9)


def test_work_and_slip_of_crossings_outlive_them():
    """Past nodes of both ridges, whose vertices then carry as well, and apart again."""
    ridges = Ridges(gap=0.01)
    ridges.move([0, 0, -0.02], 20)
    ridges.move([0.3, 0.2, 0.0], 300)
    assert ridges.table().contacts.active.all()
    ridges.move([0, 0, 0.001], 10)
    fields, *_ = ridges.fields()
    slip = fields["contact_slip"]
    ridges.move([0, 0, 0.3], 30)
    c = ridges.table().contacts
    assert not c.active.any() and num_active_pairs(ridges.contact) == 0
    assert c.a.tolist() == [0, 2, 4] and np.all(c.work > 0)
    fields, normal_force, friction = ridges.fields()
    assert not normal_force.any() and not friction.any()
    # Sums in another order. Vertices that slip add theirs to that of the edges.
    way = np.hypot(0.3, 0.2)
    assert np.all(fields["contact_slip"] >= slip * (1 - 1e-12))
    assert np.all(ridges.by_grain(fields["contact_slip"]) > 0.98 * way)


@pytest.mark.parametrize(
    "friction", [0.0, 0.02, 0.9, PairFriction(0.9, ["a", "b"], {("b", "a"): (0.03, 0.02)})]
)
def test_tangent_of_a_crossing_is_the_derivative_of_its_forces(friction):
    """Between nodes of both edges, where its stiffness changes along them; slipping and stuck.

    Tolerance: differences over 1e-6 of the edge.
    """
    (lower, cells), (upper, _) = ridge(4), ridge(4)
    upper = upper @ np.array([[0, 1.0, 0], [1, 0, 0], [0, 0, -1]]) + [0.06, -0.05, 0.0]
    mesh = create_grain_mesh(
        MPI.COMM_SELF, np.vstack([lower, upper]), np.vstack([cells, cells + len(lower)]),
        np.repeat([0, 1], len(cells)), np.array([1, 2]), np.array([0, 0]),
    )  # fmt: skip
    contact = Simulation(mesh, [QUARTZ] * 2, friction=friction).contact
    above = mesh.grain_of_node == np.flatnonzero(mesh.grains == 1)[0]
    x, f = mesh.x.copy(), np.zeros_like(mesh.x)

    def forces(x):
        f[:] = 0.0
        contact.begin_step(x)
        contact.add_forces(f, x)
        return f.copy()

    x[above] -= [0, 0, 0.006]
    forces(x)
    mark = ContactMark(contact)
    x[above] += [4e-4, 3e-4, -1e-4]
    rng = np.random.default_rng(2)
    q = rng.standard_normal(x.shape)

    def after(x):
        mark.restore()
        return forces(x)

    after(x)
    pairs = contact.edges.pairs
    on = np.flatnonzero(pairs.closed)
    assert on.size == 1 and not contact.pairs.closed.any()
    assert pairs.sliding[on[0]] == (friction != 0.9)
    assert np.all(contact.edges.edges.compliance[[pairs.first[on], pairs.second[on]]] > 0)
    rows, columns, blocks = ContactTangent(contact, mesh)(mark)
    nodes, product = contact.own.nodes, np.zeros_like(x)
    np.add.at(product, nodes[rows], np.einsum("bij,bj->bi", blocks, q[nodes[columns]]))
    step = 1e-7
    slope = -(after(x + step * q) - after(x - step * q)) / (2 * step)
    assert abs(product - slope).max() < 1e-6 * abs(slope).max()


def test_a_crack_at_a_crossing_leaves_its_depth():
    """Less area is around the ends of the edge then, by which new crossings begin."""
    ridges = Ridges(0.01)
    ridges.move([0.0, 0.0, -0.03], 40)
    s, before = ridges.simulation, ridges.contact.edges.pairs
    s.state.x[:] = ridges.x
    crossing = np.flatnonzero(before.closed)[0]
    edge = ridges.contact.edges.edges.ends[before.first[crossing]]
    nodes, cells = s.mesh.inner_facets()
    s.grow(cells[np.isin(nodes, ridges.contact.own.nodes[edge]).sum(axis=1) == 1])
    after = s.contact.edges.pairs
    assert after.size[after.closed].min() < 0.95 * before.size[crossing]
    depths = [(p.offset - p.gap - p.recess)[p.closed] for p in (before, after)]
    # To the rounding of gaps.
    np.testing.assert_allclose(*depths, rtol=1e-12)
